//! Sampler: a texture set seen through normalised coordinates, a level of detail and a filter.
//!
//! What a request means is in [`ntmu_isa::sampler`]; here the decodes are made, each texel and each
//! place once per sample, and their codes blended. Whatever decodes can stand behind it: see
//! [`Decode`].

pub(crate) mod reads;
mod sampled;

pub use crate::footprint::Probes;
pub use reads::Reads;
pub use sampled::Sampled;

use crate::exec::Decoder;
use crate::footprint::Footprint;
use crate::place::Place;
use crate::request::Request;
use ntmu_isa::profile::Profile;
use ntmu_isa::sampler::{SampleRequest, Sampler, SamplerError};
use ntmu_isa::shape::Shape;

/// What decodes texels and places of one asset.
///
/// The results have the order of what was asked; each has one code a channel, in the format that the
/// shape says.
pub trait Decode {
    /// The asset's shape.
    fn shape(&self) -> &Shape;

    /// The asset's profile.
    fn profile(&self) -> &Profile;

    /// The codes of texels.
    fn texels(&self, requests: &[Request]) -> Vec<Vec<i32>>;

    /// The codes of places.
    fn places(&self, places: &[Place]) -> Vec<Vec<i32>>;
}

impl Decode for Decoder<'_> {
    fn shape(&self) -> &Shape {
        &self.asset().shape
    }

    fn profile(&self) -> &Profile {
        &self.asset().profile
    }

    fn texels(&self, requests: &[Request]) -> Vec<Vec<i32>> {
        let decode = |&request| self.texel(request, &mut ());
        requests.iter().map(decode).collect()
    }

    fn places(&self, places: &[Place]) -> Vec<Vec<i32>> {
        let decode = |place| self.place(place, &mut ());
        places.iter().map(decode).collect()
    }
}

/// A texture set behind a sampler that fits it.
pub struct Texture<'s, S: Decode> {
    source: &'s S,
    sampler: Sampler,
}

/// What a sample gave, and what it took.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sample {
    /// One code a channel.
    pub codes: Vec<i32>,
    /// Where it read, and with which weights.
    pub probes: Probes,
    /// Texels or places with a weight, each as often as a probe reads it; the border is none.
    pub reads: u32,
    /// Runs of the synthesizer: the different ones among them.
    pub decodes: u32,
}

/// What a gather gave, and what it took.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Gather {
    /// One channel's codes at the lower left, lower right, upper right and upper left texel.
    pub codes: [i32; 4],
    /// The mip.
    pub mip: u8,
    /// The texels' columns and rows; none is the border.
    pub texels: [Option<(u32, u32)>; 4],
    /// Texels that are not the border.
    pub reads: u32,
    /// Runs of the synthesizer: the different ones among them.
    pub decodes: u32,
}

impl<'s, S: Decode> Texture<'s, S> {
    /// The texture set of `source` behind `sampler`.
    ///
    /// # Errors
    /// When the sampler does not fit the shape; see [`Sampler::check`].
    pub fn new(source: &'s S, sampler: Sampler) -> Result<Texture<'s, S>, SamplerError> {
        sampler.check(source.shape())?;
        Ok(Texture { source, sampler })
    }

    /// The sampler.
    #[must_use]
    pub fn sampler(&self) -> &Sampler {
        &self.sampler
    }

    /// Where a sample reads, and with which weights; nothing is decoded.
    #[must_use]
    pub fn probes(&self, request: &SampleRequest) -> Probes {
        self.footprint(request).probes
    }

    /// The texels and places that a sample decodes, each once, in the order of their first read:
    /// what a trace of the unit is made from.
    #[must_use]
    pub fn reads(&self, request: &SampleRequest) -> Reads {
        self.footprint(request).reads
    }

    /// One sample.
    #[must_use]
    pub fn sample(&self, request: &SampleRequest) -> Sample {
        let footprint = self.footprint(request);
        let decoded = footprint.reads.decode(self.source);
        self.blended(footprint, &decoded)
    }

    /// Samples, with one call to the source for all of them. Equal reads are joined within a sample,
    /// not among samples: the unit has no memory of codes.
    #[must_use]
    pub fn samples(&self, requests: &[SampleRequest]) -> Vec<Sample> {
        let footprints: Vec<Footprint> = requests.iter().map(|r| self.footprint(r)).collect();
        let all = Reads::concatenated(footprints.iter().map(|f| &f.reads));
        let mut decoded = all.decode(self.source).into_iter();
        footprints
            .into_iter()
            .map(|footprint| {
                let own = footprint.reads.decodes() as usize;
                let own: Vec<Vec<i32>> = decoded.by_ref().take(own).collect();
                self.blended(footprint, &own)
            })
            .collect()
    }

    fn footprint(&self, request: &SampleRequest) -> Footprint {
        Footprint::of(
            request,
            &self.sampler,
            self.source.shape(),
            self.source.profile(),
        )
    }

    fn blended(&self, footprint: Footprint, decoded: &[Vec<i32>]) -> Sample {
        let (shape, profile) = (self.source.shape(), self.source.profile());
        Sample {
            codes: footprint.blend(decoded, &self.sampler.border, shape, profile),
            reads: footprint.reads.count(),
            decodes: footprint.reads.decodes(),
            probes: footprint.probes,
        }
    }

    /// The four texels that a linear filter would read in the nearest mip, one channel of each, in
    /// Direct3D's order; offset, address modes and border are the sampler's. `None` where there is no
    /// such channel. Texels are decoded at their centres, whatever the sampler's order.
    #[must_use]
    pub fn gather(&self, channel: usize, request: &SampleRequest) -> Option<Gather> {
        let (shape, profile) = (self.source.shape(), self.source.profile());
        if channel >= shape.outputs.len() {
            return None;
        }
        let (mip, texels) = request.gathered(&self.sampler, shape, profile);
        let mut reads = Reads::default();
        let slots = texels.map(|texel| texel.map(|(x, y)| reads.texel(Request::within(x, y, mip))));
        let decoded = reads.decode(self.source);
        Some(Gather {
            codes: slots.map(|slot| match slot {
                Some(index) => decoded[index][channel],
                None => self.border(channel),
            }),
            mip,
            texels,
            reads: reads.count(),
            decodes: reads.decodes(),
        })
    }

    /// The border's code; there is one for every channel where a texel can be the border.
    fn border(&self, channel: usize) -> i32 {
        self.sampler.border.get(channel).copied().unwrap_or(0)
    }
}

#[cfg(test)]
mod tests;
