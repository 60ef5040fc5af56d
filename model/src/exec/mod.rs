//! The functional pipeline: a microprogram run on values.
//!
//! `Machine::step` is the unit on one screen: every instruction, in the order of the texel's
//! journey, each handed to the stage of the same name. Twins share these stems with the shaders.

mod embed;
mod fetch;
mod image;
mod interpolate;
mod layer;
mod output;
mod position;
mod probe;
mod taps;

pub use position::Corners;
pub use probe::Probe;
pub use taps::{GridTap, LayerTap, Taps};

use crate::request::Request;
use crate::trace::{Fetch, Trace};
use layer::LayerParameters;
use ntmu_isa::instruction::{Instruction, VECTOR_COUNT};
use ntmu_isa::{Asset, Program};

/// A unit that holds one asset and runs one program.
pub struct Decoder<'a> {
    asset: &'a Asset,
    program: &'a Program,
    layers: Vec<LayerParameters>,
}

/// Lanes of a register, and accumulators of a unit.
const LANES: usize = ntmu_isa::limits::MAX_LANES as usize;

impl<'a> Decoder<'a> {
    /// Loads an asset and a program that was compiled for it or linked against it.
    #[must_use]
    pub fn new(asset: &'a Asset, program: &'a Program) -> Decoder<'a> {
        let layers: Vec<LayerParameters> = asset.layers.iter().map(LayerParameters::new).collect();
        Decoder {
            asset,
            program,
            layers,
        }
    }

    /// The asset.
    #[must_use]
    pub fn asset(&self) -> &'a Asset {
        self.asset
    }

    /// The channel codes of one texel; `probe` sees every intermediate value.
    ///
    /// The request must come from the asset's own shape.
    pub fn texel(&self, request: Request, probe: &mut impl Probe) -> Vec<i32> {
        Machine::new(self).texel(request, probe).to_vec()
    }

    /// Everything that one texel makes visible on its way.
    #[must_use]
    pub fn taps(&self, request: Request) -> Taps {
        let mut taps = Taps::new(request);
        self.texel(request, &mut taps);
        taps
    }

    /// The addresses that a run of texels touches, in their order.
    ///
    /// Only the program's `position` and `fetch` are run: nothing else touches memory.
    #[must_use]
    pub fn trace(&self, requests: impl IntoIterator<Item = Request>) -> Trace {
        let mut machine = Machine::new(self);
        let mut trace = Trace::new();
        for request in requests {
            for instruction in self.program.instructions() {
                if let Instruction::Position { .. } | Instruction::Fetch { .. } = instruction {
                    machine.step(instruction, request, &mut trace);
                }
            }
            trace.end_texel();
        }
        trace
    }
}

/// The registers of the unit while it runs a texel.
struct Machine<'d, 'a> {
    decoder: &'d Decoder<'a>,
    corners: [Corners; 2],
    /// Per grid, the codes of the four corners one after the other.
    codes: [Vec<u8>; 2],
    /// Signed bytes, held at the width in which they are multiplied.
    vectors: [Vec<i16>; VECTOR_COUNT as usize],
    accumulators: Vec<i32>,
    /// The accumulators hold products of a hard GELU's gate.
    is_gated: bool,
    emitted: Vec<i32>,
}

impl<'d, 'a> Machine<'d, 'a> {
    fn new(decoder: &'d Decoder<'a>) -> Machine<'d, 'a> {
        Machine {
            decoder,
            corners: [Corners::default(); 2],
            codes: [Vec::new(), Vec::new()],
            vectors: std::array::from_fn(|_| vec![0; LANES]),
            accumulators: vec![0; LANES],
            is_gated: false,
            emitted: vec![0; decoder.asset.shape.outputs.len()],
        }
    }

    fn texel(&mut self, request: Request, probe: &mut impl Probe) -> &[i32] {
        for instruction in self.decoder.program.instructions() {
            self.step(instruction, request, probe);
        }
        &self.emitted
    }

    fn step(&mut self, instruction: &Instruction, request: Request, probe: &mut impl Probe) {
        let asset = self.decoder.asset;
        match *instruction {
            Instruction::Position { grid } => {
                let g = usize::from(grid);
                self.corners[g] = position::corners(&asset.shape, g, request);
                probe.position(g, &self.corners[g]);
            }
            Instruction::Fetch { grid } => {
                let g = usize::from(grid);
                fetch::codes(asset, g, &self.corners[g], &mut self.codes[g]);
                let layout = self.decoder.program.layout();
                probe.fetch(&fetch::addresses(asset, layout, g, &self.corners[g]));
                probe.codes(g, &self.codes[g]);
            }
            Instruction::Concat { dst, lane, grid } => {
                let g = usize::from(grid);
                let lanes = &mut self.vectors[usize::from(dst)][usize::from(lane)..];
                let written = embed::concat(asset, g, &self.codes[g], lanes);
                probe.embedded("concat", lane, &lanes[..written]);
            }
            Instruction::Lerp { dst, lane, grid } => {
                let g = usize::from(grid);
                let lanes = &mut self.vectors[usize::from(dst)][usize::from(lane)..];
                let weights = self.corners[g].weights();
                let written = interpolate::lerp(asset, g, &self.codes[g], weights, lanes);
                probe.embedded("lerp", lane, &lanes[..written]);
            }
            Instruction::Wave { dst, lane, octaves } => {
                let lanes = &mut self.vectors[usize::from(dst)][usize::from(lane)..];
                let written = embed::waves(request, octaves, lanes);
                probe.embedded("wave", lane, &lanes[..written]);
            }
            Instruction::Level { dst, lane } => {
                let lanes = &mut self.vectors[usize::from(dst)][usize::from(lane)..];
                lanes[0] = embed::level(request, asset.shape.mip_count);
                probe.embedded("level", lane, &lanes[..1]);
            }
            Instruction::Dense {
                layer,
                src,
                inputs,
                outputs,
            } => {
                let parameters = &self.decoder.layers[usize::from(layer)];
                let input = &self.vectors[usize::from(src)][..usize::from(inputs)];
                let accumulators = &mut self.accumulators[..usize::from(outputs)];
                parameters.dense(&asset.layers[usize::from(layer)], input, accumulators);
                self.is_gated = false;
                probe.accumulators(layer, accumulators);
            }
            Instruction::Relu { outputs } => {
                layer::relu(&mut self.accumulators[..usize::from(outputs)]);
                probe.activated(&self.accumulators[..usize::from(outputs)]);
            }
            Instruction::Leaky { shift, outputs } => {
                let accumulators = &mut self.accumulators[..usize::from(outputs)];
                layer::leaky(accumulators, shift, asset.profile.leak);
                probe.activated(accumulators);
            }
            Instruction::Gate { layer, outputs } => {
                let accumulators = &mut self.accumulators[..usize::from(outputs)];
                let layer = &asset.layers[usize::from(layer)];
                layer::gate(accumulators, layer, asset.profile.requantize);
                self.is_gated = true;
                probe.activated(accumulators);
            }
            Instruction::Rescale {
                layer,
                dst,
                outputs,
            } => {
                let values = self.rescaled(layer, outputs);
                layer::saturate_to(values, &mut self.vectors[usize::from(dst)]);
                probe.outputs(
                    layer,
                    &self.vectors[usize::from(dst)][..usize::from(outputs)],
                );
            }
            Instruction::RescaleSkip {
                layer,
                dst,
                skip,
                outputs,
            } => {
                let mut values = self.rescaled(layer, outputs);
                let source = &self.vectors[usize::from(skip)];
                layer::add_skip(asset, usize::from(layer), source, &mut values);
                layer::saturate_to(values, &mut self.vectors[usize::from(dst)]);
                probe.outputs(
                    layer,
                    &self.vectors[usize::from(dst)][..usize::from(outputs)],
                );
            }
            Instruction::Emit { layer, outputs } => {
                let accumulators = &self.accumulators[..usize::from(outputs)];
                let layer = &asset.layers[usize::from(layer)];
                output::emit(asset, layer, accumulators, &mut self.emitted);
                probe.emitted(&self.emitted);
            }
            Instruction::End {} => {}
        }
    }

    /// The held accumulators on the scale of the layer's output, zero point included.
    fn rescaled(&self, layer: u16, outputs: u16) -> Vec<i64> {
        let asset = self.decoder.asset;
        let layer = &asset.layers[usize::from(layer)];
        let accumulators = &self.accumulators[..usize::from(outputs)];
        layer::rescale(accumulators, layer, asset.profile.requantize, self.is_gated)
    }
}

impl Probe for Trace {
    fn fetch(&mut self, fetch: &Fetch) {
        Trace::fetch(self, *fetch);
    }
}
