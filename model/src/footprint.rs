//! Footprint: what one sample decodes, each texel and place once, and how the codes are joined.
//!
//! Where a sample reads, with which weights, and what the weights do to codes is in
//! [`ntmu_isa::sampler`]; here equal reads are joined, and every weight finds its code again. The
//! [`sampler`](crate::sampler) and the unit's own filter share it.

use crate::sampler::Reads;
use crate::sampler::reads::{Corner, corners, place_of};
use ntmu_isa::profile::Profile;
use ntmu_isa::sampler::blend::{Corners, blend};
use ntmu_isa::sampler::plan::{Probe, Spot, Square};
use ntmu_isa::sampler::{Order, SampleRequest, Sampler};
use ntmu_isa::shape::Shape;

/// The probes of a sample: where it read, and with which weights.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Probes {
    /// Texels, decoded and then filtered.
    Squares(Vec<Probe<Square>>),
    /// Places, where latents were filtered and then decoded.
    Spots(Vec<Probe<Spot>>),
}

/// What one sample decodes, and where each of its weights finds its code.
pub(crate) struct Footprint {
    pub(crate) probes: Probes,
    pub(crate) reads: Reads,
    slots: Vec<Probe<Slots>>,
}

impl Footprint {
    /// The footprint of a request; nothing is decoded. The sampler fits the shape.
    pub(crate) fn of(
        request: &SampleRequest,
        sampler: &Sampler,
        shape: &Shape,
        profile: &Profile,
    ) -> Footprint {
        let probes = match sampler.order {
            Order::DecodeThenFilter => Probes::Squares(request.squares(sampler, shape, profile)),
            Order::FilterThenDecode => Probes::Spots(request.spots(sampler, shape, profile)),
        };
        let mut reads = Reads::default();
        let slots = match &probes {
            Probes::Squares(probes) => probes
                .iter()
                .map(|probe| probe.map(|square| Slots::of_square(&square, &mut reads)))
                .collect(),
            Probes::Spots(probes) => probes
                .iter()
                .map(|probe| probe.map(|spot| Slots::of_spot(&spot, profile, &mut reads)))
                .collect(),
        };
        Footprint {
            probes,
            reads,
            slots,
        }
    }

    /// One code a channel, from those of the reads in their order. There is a border code for every
    /// channel where a texel can be the border.
    pub(crate) fn blend(
        &self,
        decoded: &[Vec<i32>],
        border: &[i32],
        shape: &Shape,
        profile: &Profile,
    ) -> Vec<i32> {
        let formats = shape.outputs.iter().enumerate();
        formats
            .map(|(channel, &format)| {
                let joined = |corners: Slots| Corners {
                    codes: corners.slots.map(|slot| match slot {
                        Slot::Decoded(index) => decoded[index][channel],
                        Slot::Border => border.get(channel).copied().unwrap_or(0),
                        Slot::Unread => 0,
                    }),
                    fractions: corners.fractions,
                };
                let slots = self.slots.iter();
                let probes: Vec<Probe<Corners>> = slots.map(|probe| probe.map(joined)).collect();
                blend(&probes, format, profile)
            })
            .collect()
    }
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
        let slot = Slot::Decoded(reads.place(place_of(spot, profile)));
        Slots {
            slots: [slot; 4],
            fractions: [0; 2],
        }
    }
}
