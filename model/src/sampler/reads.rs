//! Reads: what one sample decodes, each texel and place once.

use super::Decode;
use crate::place::Place;
use crate::request::Request;
use ntmu_isa::profile::Profile;
use ntmu_isa::sampler::plan::{Spot, Square};

/// What one corner of a square takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Corner {
    /// A decode.
    Texel(Request),
    /// The sampler's border codes: no decode.
    Border,
    /// Nothing: it has no weight.
    Unread,
}

/// What the corners (0,0), (1,0), (0,1) and (1,1) of a square take.
pub(crate) fn corners(square: &Square) -> [Corner; 4] {
    [0, 1, 2, 3].map(|corner| match square.corner(corner) {
        _ if !square.counts(corner) => Corner::Unread,
        Some((x, y)) => Corner::Texel(Request::within(x, y, square.mip)),
        None => Corner::Border,
    })
}

/// The decode of a spot.
pub(crate) fn place_of(spot: &Spot, profile: &Profile) -> Place {
    let (bits, lod_bits) = (profile.subtexel_bits, profile.lod_bits);
    Place::within(spot.coordinates, bits, spot.mip, spot.lod, lod_bits)
}

/// The texels or the places of one sample, in the order of their first read. A sample has one of the
/// two kinds only.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Reads {
    texels: Vec<Request>,
    places: Vec<Place>,
    count: u32,
}

impl Reads {
    /// The different texels.
    #[must_use]
    pub fn texels(&self) -> &[Request] {
        &self.texels
    }

    /// The different places.
    #[must_use]
    pub fn places(&self) -> &[Place] {
        &self.places
    }

    /// Reads before equal ones were joined.
    #[must_use]
    pub fn count(&self) -> u32 {
        self.count
    }

    /// Reads after equal ones were joined: runs of the synthesizer.
    #[must_use]
    pub fn decodes(&self) -> u32 {
        (self.texels.len() + self.places.len()) as u32
    }

    /// Enters a texel; gives its number among the texels.
    pub(crate) fn texel(&mut self, texel: Request) -> usize {
        self.count += 1;
        number(&mut self.texels, texel)
    }

    /// Enters a place; gives its number among the places.
    pub(crate) fn place(&mut self, place: Place) -> usize {
        self.count += 1;
        number(&mut self.places, place)
    }

    /// Several samples' reads one after the other, not joined.
    pub(super) fn concatenated<'r>(samples: impl Iterator<Item = &'r Reads>) -> Reads {
        samples.fold(Reads::default(), |mut all, reads| {
            all.texels.extend_from_slice(&reads.texels);
            all.places.extend_from_slice(&reads.places);
            all.count += reads.count;
            all
        })
    }

    /// The codes, in the order of their numbers.
    pub(super) fn decode(&self, source: &impl Decode) -> Vec<Vec<i32>> {
        if self.places.is_empty() {
            source.texels(&self.texels)
        } else {
            source.places(&self.places)
        }
    }
}

/// At most 128 entries: sixteen probes of four texels in two mips.
pub(super) fn number<T: PartialEq>(entries: &mut Vec<T>, entry: T) -> usize {
    entries.iter().position(|e| *e == entry).unwrap_or_else(|| {
        entries.push(entry);
        entries.len() - 1
    })
}
