//! The functional pipeline: a microprogram run on values.
//!
//! `Machine::step` in `machine` is the unit at one glance: every instruction, in the order of the
//! texel's journey, each handed to the stage of the same name. Twins share these stems with the shaders.

mod dense;
mod embed;
mod fetch;
mod filter;
mod half;
mod image;
mod interpolate;
mod layer;
mod machine;
mod output;
mod position;
mod probe;
mod taps;
mod tracer;

pub use filter::SampleError;
pub use position::Corners;
pub use probe::Probe;
pub use taps::{GridTap, LayerTap, Taps};
pub use tracer::Tracer;

use crate::place::Place;
use crate::request::Request;
use crate::trace::{Fetch, Trace};
use dense::Weights;
use fetch::Memory;
use filter::Filter;
use machine::Machine;
use ntmu_isa::instruction::Instruction;
use ntmu_isa::position::PHASE_BITS;
use ntmu_isa::sampler::{SampleRequest, Sampler};
use ntmu_isa::{Asset, Program};

/// A unit that holds one asset and runs one program.
pub struct Decoder<'a> {
    asset: &'a Asset,
    program: &'a Program,
    memory: Memory<'a>,
    weights: Vec<Weights>,
}

impl<'a> Decoder<'a> {
    /// Loads an asset and a program that was compiled for it or linked against it.
    #[must_use]
    pub fn new(asset: &'a Asset, program: &'a Program) -> Decoder<'a> {
        let accumulator = asset.profile.accumulator;
        let layers = asset.layers.iter().enumerate();
        let weights = layers
            .map(|(index, layer)| Weights::new(layer, asset.input_format(index), accumulator))
            .collect();
        Decoder {
            asset,
            program,
            memory: Memory::new(asset, program),
            weights,
        }
    }

    /// The asset.
    #[must_use]
    pub fn asset(&self) -> &'a Asset {
        self.asset
    }

    /// The channel codes of one texel; `probe` sees every intermediate value. A program that filters
    /// decodes it as a footprint of its own.
    ///
    /// The decode of its centre, with phases of [`PHASE_BITS`]. The request must come from the
    /// asset's own shape.
    pub fn texel(&self, request: Request, probe: &mut impl Probe) -> Vec<i32> {
        Machine::new(self).texel(request, probe).to_vec()
    }

    /// The channel codes of any place; `probe` sees every intermediate value.
    ///
    /// Phases have the profile's subtexel bits. So the codes of a texel's centre are those of
    /// [`Decoder::texel`] up to mip scale + 3 of the grid with the smaller scale; beyond, where four
    /// bits drop part of the fraction, this decode is the finer one. The place must come from the
    /// asset's own shape.
    pub fn place(&self, place: &Place, probe: &mut impl Probe) -> Vec<i32> {
        let phase_bits = self.asset.profile.subtexel_bits;
        Machine::new(self).run(place, phase_bits, probe).to_vec()
    }

    /// One sample: the codes of the footprint's decodes, filtered by the sampler's state, which must
    /// equal those of [`Texture::sample`](crate::sampler::Texture::sample). `probe` sees every decode.
    ///
    /// # Errors
    /// When the program does not filter, or the sampler does not fit the asset.
    pub fn sample(
        &self,
        sampler: &Sampler,
        request: &SampleRequest,
        probe: &mut impl Probe,
    ) -> Result<Vec<i32>, SampleError> {
        let body = self.program.footprint_loop().ok_or(SampleError::Program)?;
        sampler
            .check(&self.asset.shape)
            .map_err(SampleError::Sampler)?;
        let filter = Filter::new(self.asset, sampler, request);
        let codes = Machine::new(self).sample(filter, body, probe).to_vec();
        Ok(codes)
    }

    /// Everything that one texel makes visible on its way.
    #[must_use]
    pub fn taps(&self, request: Request) -> Taps {
        let mut taps = Taps::new(request);
        self.texel(request, &mut taps);
        taps
    }

    /// The addresses that a run of texels touches, in their order.
    #[must_use]
    pub fn trace(&self, requests: impl IntoIterator<Item = Request>) -> Trace {
        self.trace_places(requests.into_iter().map(Place::of))
    }

    /// The addresses that a run of places touches, in their order; each counts as one texel.
    ///
    /// Only the program's `position` and `fetch` are run: nothing else touches memory. The phase
    /// does not move a corner.
    #[must_use]
    pub fn trace_places(&self, places: impl IntoIterator<Item = Place>) -> Trace {
        let mut machine = Machine::new(self);
        let mut trace = Trace::new();
        for place in places {
            for instruction in self.program.steps() {
                if let Instruction::Position { .. } | Instruction::Fetch { .. } = instruction {
                    machine.step(instruction, &place, PHASE_BITS, &mut trace);
                }
            }
            trace.end_texel();
        }
        trace
    }
}

impl Probe for Trace {
    fn fetch(&mut self, fetch: &Fetch) {
        Trace::fetch(self, *fetch);
    }
}
