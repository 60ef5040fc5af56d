//! Sampler: a texture set seen through normalised coordinates, a level of detail and a filter.
//!
//! What a request means is in [`ntmu_isa::sampler`]; here the decodes are made, each texel and each
//! place once per sample, and their codes blended. Whatever decodes can stand behind it: see
//! [`Decode`].

mod reads;
mod sampled;

pub use reads::Reads;
pub use sampled::Sampled;

use crate::exec::Decoder;
use crate::place::Place;
use crate::request::Request;
use ntmu_isa::profile::Profile;
use ntmu_isa::sampler::blend::{Corners, blend};
use ntmu_isa::sampler::plan::{Probe, Spot, Square};
use ntmu_isa::sampler::{Order, SampleRequest, Sampler, SamplerError};
use ntmu_isa::shape::Shape;
use reads::{Corner, corners, place_of};

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

/// The probes of a sample: where it read, and with which weights.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Probes {
    /// Texels, decoded and then filtered.
    Squares(Vec<Probe<Square>>),
    /// Places, where latents were filtered and then decoded.
    Spots(Vec<Probe<Spot>>),
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
        let (shape, profile) = (self.source.shape(), self.source.profile());
        match self.sampler.order {
            Order::DecodeThenFilter => {
                Probes::Squares(request.squares(&self.sampler, shape, profile))
            }
            Order::FilterThenDecode => Probes::Spots(request.spots(&self.sampler, shape, profile)),
        }
    }

    /// The texels and places that a sample decodes, each once, in the order of their first read:
    /// what a trace of the unit is made from.
    #[must_use]
    pub fn reads(&self, request: &SampleRequest) -> Reads {
        let mut reads = Reads::default();
        self.read(&self.probes(request), &mut reads);
        reads
    }

    /// One sample.
    #[must_use]
    pub fn sample(&self, request: &SampleRequest) -> Sample {
        let pending = self.pending(request);
        let decoded = pending.reads.decode(self.source);
        self.blended(pending, &decoded)
    }

    /// Samples, with one call to the source for all of them. Equal reads are joined within a sample,
    /// not among samples: the unit has no memory of codes.
    #[must_use]
    pub fn samples(&self, requests: &[SampleRequest]) -> Vec<Sample> {
        let pending: Vec<Pending> = requests.iter().map(|r| self.pending(r)).collect();
        let all = Reads::concatenated(pending.iter().map(|p| &p.reads));
        let mut decoded = all.decode(self.source).into_iter();
        pending
            .into_iter()
            .map(|pending| {
                let own = pending.reads.decodes() as usize;
                let own: Vec<Vec<i32>> = decoded.by_ref().take(own).collect();
                self.blended(pending, &own)
            })
            .collect()
    }

    fn pending(&self, request: &SampleRequest) -> Pending {
        let probes = self.probes(request);
        let mut reads = Reads::default();
        let slots = self.read(&probes, &mut reads);
        Pending {
            probes,
            reads,
            slots,
        }
    }

    fn blended(&self, pending: Pending, decoded: &[Vec<i32>]) -> Sample {
        let formats = self.source.shape().outputs.iter().enumerate();
        let codes = formats
            .map(|(channel, &format)| {
                let corners = |corners: Slots| Corners {
                    codes: corners.slots.map(|slot| match slot {
                        Slot::Decoded(index) => decoded[index][channel],
                        Slot::Border => self.border(channel),
                        Slot::Unread => 0,
                    }),
                    fractions: corners.fractions,
                };
                let slots = pending.slots.iter();
                let probes: Vec<Probe<Corners>> = slots.map(|probe| probe.map(corners)).collect();
                blend(&probes, format, self.source.profile())
            })
            .collect();
        Sample {
            codes,
            reads: pending.reads.count(),
            decodes: pending.reads.decodes(),
            probes: pending.probes,
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

    /// Enters what the probes read, and says where it will be found.
    fn read(&self, probes: &Probes, reads: &mut Reads) -> Vec<Probe<Slots>> {
        let profile = self.source.profile();
        match probes {
            Probes::Squares(probes) => probes
                .iter()
                .map(|probe| probe.map(|square| Slots::of_square(&square, reads)))
                .collect(),
            Probes::Spots(probes) => probes
                .iter()
                .map(|probe| probe.map(|spot| Slots::of_spot(&spot, profile, reads)))
                .collect(),
        }
    }
}

/// A sample whose codes are not there yet.
struct Pending {
    probes: Probes,
    reads: Reads,
    slots: Vec<Probe<Slots>>,
}

/// Where a code comes from.
#[derive(Clone, Copy)]
enum Slot {
    /// What was decoded, by its number.
    Decoded(usize),
    /// The border.
    Border,
    /// Nothing: it has no weight.
    Unread,
}

/// Where the codes of four corners come from.
#[derive(Clone, Copy)]
struct Slots {
    slots: [Slot; 4],
    fractions: [u32; 2],
}

impl Slots {
    fn of_square(square: &Square, reads: &mut Reads) -> Slots {
        let slots = corners(square).map(|corner| match corner {
            Corner::Texel(texel) => Slot::Decoded(reads.texel(texel)),
            Corner::Border => Slot::Border,
            Corner::Unread => Slot::Unread,
        });
        Slots {
            slots,
            fractions: square.fractions,
        }
    }

    fn of_spot(spot: &Spot, profile: &Profile, reads: &mut Reads) -> Slots {
        Slots {
            slots: [Slot::Decoded(reads.place(place_of(spot, profile))); 4],
            fractions: [0; 2],
        }
    }
}

#[cfg(test)]
mod tests;
