//! Decoded: the decoded-texel cache, the other design: decode a block once, and filter from it.

use super::cache::Tags;
use super::choice::Replacement;
use super::memory::Arrival;
use super::unit::Unit;
use crate::place::Place;
use crate::request::Request;
use crate::trace::Addresses;

/// The blocks that are held decoded. Only their order matters: a pixel is answered behind the
/// decodes of all pixels before it.
#[derive(Clone, Debug)]
pub(super) struct DecodedTexels {
    tags: Tags,
    side: u32,
}

impl DecodedTexels {
    /// The cache of a unit that has one.
    pub(super) fn new(unit: &Unit) -> Option<DecodedTexels> {
        let sets = unit.decoded_cache_blocks / unit.decoded_cache_ways;
        (sets > 0).then(|| DecodedTexels {
            tags: Tags::new(sets, unit.decoded_cache_ways, Replacement::Lru),
            side: unit.decoded_block_side,
        })
    }

    /// Whether the texel is held. If not, its block is decoded, and held from here on. What lies
    /// between texels is decoded for itself and not held.
    pub(super) fn look_up(
        &mut self,
        material: u16,
        place: Place,
        addresses: &dyn Addresses,
        decode: &mut impl FnMut(Place),
    ) -> bool {
        let Some(texel) = place.texel() else {
            decode(place);
            return false;
        };
        let (column, row) = (texel.x() / self.side, texel.y() / self.side);
        let mip = texel.mip();
        // A side has at most 2^14 texels and a chain at most 15 mips.
        let block = u64::from(mip) << 28 | u64::from(row) << 14 | u64::from(column);
        // In front of the block, so that neighbours along both axes lie in different sets.
        let spread = u64::from(column ^ row.wrapping_mul(37)) & 0xfff;
        let line = (u64::from(material) << 32 | block) << 12 | spread;
        if self.tags.touch(line).is_some() {
            return true;
        }
        self.tags.install(line, Arrival::THERE);
        let (width, height) = addresses.mip_size(mip);
        for y in row * self.side..((row + 1) * self.side).min(height) {
            for x in column * self.side..((column + 1) * self.side).min(width) {
                decode(Place::of(Request::within(x, y, mip)));
            }
        }
        false
    }
}
