//! Texel: the codes of one texel, for whoever asks for one at a time.

use super::general;
use super::kernel::{Dense8, GROUP_ROWS};
use super::plan::{IntegerLayer, IntegerSums, PlannedLayer, Then};
use super::register::{Held, REGISTERS};
use super::tile::TileScratch;
use super::{Engine, Inputs};
use crate::request::Request;
use ntmu_isa::accumulate::wrap;
use ntmu_isa::layer::IntegerParameters;

/// What one texel needs on its way; made once, used for any number of texels.
#[derive(Clone, Debug)]
pub struct Scratch(Way);

/// How a texel is decoded.
#[derive(Clone, Debug)]
enum Way {
    /// Row by row, where every layer reads bytes and sums in any order.
    Rows(RowScratch),
    /// As one texel of a tile, all others of which are computed in vain.
    Tile(Box<TileScratch>),
}

#[derive(Clone, Debug)]
struct RowScratch {
    /// Stored bytes, in groups of [`GROUP_ROWS`].
    registers: [Vec<[u8; 4]>; REGISTERS],
    sums: Vec<[i32; GROUP_ROWS]>,
}

/// A layer that reads bytes and sums in any order.
fn byte_layer(layer: &PlannedLayer) -> Option<(&IntegerLayer, &Dense8)> {
    match layer {
        PlannedLayer::Integer(layer) if layer.ordered.is_empty() => {
            match (&layer.sums, layer.output) {
                (IntegerSums::Bytes(dense), None | Some(Held::Bytes)) => Some((layer, dense)),
                (IntegerSums::Bytes(_) | IntegerSums::Words(_), _) => None,
            }
        }
        PlannedLayer::Integer(_) | PlannedLayer::Half(_) => None,
    }
}

impl Scratch {
    pub(super) fn new(engine: &Engine<'_>) -> Scratch {
        if !engine
            .layers
            .iter()
            .all(|layer| byte_layer(layer).is_some())
        {
            return Scratch(Way::Tile(Box::new(TileScratch::new(engine))));
        }
        let lanes = engine.widths.lanes().next_multiple_of(GROUP_ROWS);
        Scratch(Way::Rows(RowScratch {
            registers: std::array::from_fn(|_| vec![[0; 4]; lanes / 4]),
            sums: vec![[0; GROUP_ROWS]; lanes / GROUP_ROWS],
        }))
    }
}

impl Engine<'_> {
    /// The channel codes of one texel: one for each channel, in `codes`. Allocates nothing.
    ///
    /// The request must come from the asset's own shape, the scratch from this engine.
    pub fn texel(&self, scratch: &mut Scratch, request: Request, codes: &mut [i32]) {
        let place = (request.x(), request.y(), request.mip());
        match &mut scratch.0 {
            Way::Rows(scratch) => self.texel_rows(scratch, place, codes),
            Way::Tile(scratch) => {
                self.put_texel(scratch, 0, place);
                self.tile(scratch);
                for (code, row) in codes.iter_mut().zip(scratch.codes()) {
                    *code = row.0[0];
                }
            }
        }
    }

    fn texel_rows(&self, scratch: &mut RowScratch, place: (u32, u32, u8), codes: &mut [i32]) {
        let RowScratch { registers, sums } = scratch;
        let count = self.asset.shape.input_count() as usize;
        if let Inputs::Bytes(embed) = &self.inputs {
            let lanes = &mut registers[0].as_flattened_mut()[..count];
            embed.texel(self.asset, self.kernels, place, lanes);
        }
        for (index, layer) in self.layers.iter().enumerate() {
            let (Some((layer, dense)), Some(parameters)) =
                (byte_layer(layer), self.asset.layers[index].integer())
            else {
                return;
            };
            let sums = &mut sums[..dense.rows().div_ceil(GROUP_ROWS)];
            let [input, output] = [index, index + 1].map(|at| at % REGISTERS);
            self.kernels.row_sums(dense, &registers[input], sums);
            if layer.output.is_none() {
                self.emit(layer, parameters, sums, codes);
                break;
            }
            let mut written = std::mem::take(&mut registers[output]);
            let source = self.asset.layers[index].skip.map(|skip| {
                let register = (index + 1 - usize::from(skip.span)) % REGISTERS;
                registers[register].as_flattened()
            });
            let bytes = written.as_flattened_mut();
            match &layer.then {
                Then::Fused(finish) => {
                    self.kernels.row_finish(finish, source, sums);
                    let (low, high) = layer.ranges[0];
                    for (byte, &sum) in bytes.iter_mut().zip(sums.as_flattened()) {
                        *byte = sum.clamp(low + 128, high + 128) as u8;
                    }
                }
                Then::Rows(..) | Then::General => {
                    let rows = sums.as_flattened()[..dense.rows()].iter();
                    for (row, (byte, &sum)) in bytes.iter_mut().zip(rows).enumerate() {
                        let sum = wrap(i64::from(sum), self.asset.profile.accumulator.bits);
                        let from = source.map_or(0, |bytes| i32::from(bytes[row]) - 128);
                        let value = general::hidden(self.asset, index, parameters, row, sum, from);
                        *byte = (value + 128) as u8;
                    }
                }
            }
            registers[output] = written;
        }
    }

    fn emit(
        &self,
        layer: &IntegerLayer,
        parameters: &IntegerParameters,
        sums: &mut [[i32; GROUP_ROWS]],
        codes: &mut [i32],
    ) {
        if let Then::Fused(finish) = &layer.then {
            self.kernels.row_finish(finish, None, sums);
            let rows = sums.as_flattened().iter().zip(&layer.ranges);
            for (code, (&sum, &(low, high))) in codes.iter_mut().zip(rows) {
                *code = sum.clamp(low, high);
            }
            return;
        }
        let (profile, formats) = (&self.asset.profile, &self.asset.shape.outputs);
        let rows = sums.as_flattened().iter().zip(formats).enumerate();
        for (code, (row, (&sum, &format))) in codes.iter_mut().zip(rows) {
            let sum = wrap(i64::from(sum), profile.accumulator.bits);
            *code = general::output(profile, parameters, format, row, sum);
        }
    }
}
