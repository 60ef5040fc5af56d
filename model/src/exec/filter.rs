//! Filter: the footprint of a sample, one decode after the other, and their codes blended.

use crate::footprint::Footprint;
use crate::place::Place;
use ntmu_isa::Asset;
use ntmu_isa::position::PHASE_BITS;
use ntmu_isa::sampler::{SampleRequest, Sampler, SamplerError};
use std::fmt;

/// Why a unit cannot sample.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SampleError {
    /// The sampler does not fit the asset.
    Sampler(SamplerError),
    /// The program decodes texels and does not filter.
    Program,
}

impl fmt::Display for SampleError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            SampleError::Sampler(error) => error.fmt(f),
            SampleError::Program => {
                write!(
                    f,
                    "found a program without `footprint`; allowed: one that filters"
                )
            }
        }
    }
}

impl std::error::Error for SampleError {}

/// What the filter holds while a sample is under way.
pub(super) struct Filter<'r> {
    asset: &'r Asset,
    sampler: &'r Sampler,
    request: &'r SampleRequest,
    footprint: Option<Footprint>,
    /// Per decode of the footprint so far, its codes.
    buffer: Vec<Vec<i32>>,
}

impl<'r> Filter<'r> {
    pub(super) fn new(
        asset: &'r Asset,
        sampler: &'r Sampler,
        request: &'r SampleRequest,
    ) -> Filter<'r> {
        Filter {
            asset,
            sampler,
            request,
            footprint: None,
            buffer: Vec::new(),
        }
    }

    pub(super) fn plan(&mut self) {
        let (shape, profile) = (&self.asset.shape, &self.asset.profile);
        self.footprint = Some(Footprint::of(self.request, self.sampler, shape, profile));
    }

    /// The next decode, with the bits of its phases: texels have [`PHASE_BITS`], places the profile's
    /// subtexel bits.
    pub(super) fn next(&self) -> Option<(Place, u8)> {
        let reads = &self.footprint.as_ref()?.reads;
        let at = self.buffer.len();
        let texel = reads.texels().get(at).map(|&texel| Place::of(texel));
        let place = reads.places().get(at).copied();
        texel
            .map(|texel| (texel, PHASE_BITS))
            .or(place.map(|place| (place, self.asset.profile.subtexel_bits)))
    }

    pub(super) fn collect(&mut self, codes: &[i32]) {
        self.buffer.push(codes.to_vec());
    }

    /// The sample's codes, if there is a footprint.
    pub(super) fn blend(&self) -> Option<Vec<i32>> {
        let (shape, profile) = (&self.asset.shape, &self.asset.profile);
        let footprint = self.footprint.as_ref()?;
        Some(footprint.blend(&self.buffer, &self.sampler.border, shape, profile))
    }
}
