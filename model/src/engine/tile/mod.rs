//! Tile: the codes of 64 texels, layer after layer.

mod half;
mod integer;

use super::kernel::{Halves, Sums};
use super::lane::Lane;
use super::plan::PlannedLayer;
use super::register::{REGISTERS, Register};
use super::{Engine, Inputs};
use ntmu_isa::half::Half;

/// What a tile needs on its way.
#[derive(Clone, Debug)]
pub(super) struct TileScratch {
    registers: [Register; REGISTERS],
    sums: Vec<Sums>,
    half_sums: Vec<Halves>,
    /// One texel's inputs of a layer that is summed lane by lane.
    words: Vec<i16>,
    halves: Vec<Half>,
}

impl TileScratch {
    pub(super) fn new(engine: &Engine<'_>) -> TileScratch {
        let widths = engine.widths;
        let (integers, halves) = widths.scratch_lanes();
        TileScratch {
            registers: std::array::from_fn(|_| Register::new(widths)),
            sums: vec![Sums::ZERO; widths.rows],
            half_sums: vec![Halves::ZERO; if halves > 0 { widths.rows } else { 0 }],
            words: vec![0; integers],
            halves: vec![Half::ZERO; halves],
        }
    }

    /// Where the inputs of the synthesizer go.
    pub(super) fn inputs(&mut self) -> &mut Register {
        &mut self.registers[0]
    }

    /// One row of 64 codes for each channel, after [`Engine::tile`].
    pub(super) fn codes(&self) -> &[Sums] {
        &self.sums
    }

    /// Sets one texel's inputs, in order.
    pub(super) fn put_bytes(&mut self, texel: usize, lanes: &[u8]) {
        u8::put(&mut self.registers[0].quads, texel, lanes);
    }

    /// Sets one texel's inputs, in order.
    pub(super) fn put_words(&mut self, texel: usize, lanes: &[i16]) {
        i16::put(&mut self.registers[0].pairs, texel, lanes);
    }
}

impl Engine<'_> {
    /// Runs the synthesizer on the inputs of a tile.
    pub(super) fn tile(&self, scratch: &mut TileScratch) {
        for (index, layer) in self.layers.iter().enumerate() {
            let [input, output] = [index, index + 1].map(|at| at % REGISTERS);
            let skip = self.asset.layers[index].skip;
            let source = skip.map(|skip| (index + 1 - usize::from(skip.span)) % REGISTERS);
            // The output's register is taken out while the others are read.
            let mut written = std::mem::take(&mut scratch.registers[output]);
            match layer {
                PlannedLayer::Integer(layer) => {
                    self.integer(index, layer, scratch, input, source, &mut written);
                }
                PlannedLayer::Half(layer) => {
                    self.half(index, layer, scratch, input, source, &mut written);
                }
            }
            scratch.registers[output] = written;
        }
    }

    /// Embeds one texel alone.
    pub(super) fn put_texel(&self, scratch: &mut TileScratch, at: usize, texel: (u32, u32, u8)) {
        let count = self.asset.shape.input_count() as usize;
        match &self.inputs {
            Inputs::Bytes(embed) => {
                let mut lanes = [0; ntmu_isa::limits::MAX_LANES as usize];
                embed.texel(self.asset, self.kernels, texel, &mut lanes[..count]);
                scratch.put_bytes(at, &lanes[..count]);
            }
            Inputs::Words(embed) => {
                let mut lanes = [0; ntmu_isa::limits::MAX_LANES as usize];
                embed.texel(self.asset, self.kernels, texel, &mut lanes[..count]);
                scratch.put_words(at, &lanes[..count]);
            }
        }
    }
}
