//! Level of detail: which mips a sample takes, and how much of each.
//!
//! In the order of Direct3D 11.3, sections 7.18.10 and 7.18.11: bias, then `min(max_lod)`, then
//! `max(min_lod)` (so the smallest wins over the largest), then the chain, then the filter between
//! mips. Direct3D does the first three in f32; here they are exact, and the one rounding is that to
//! the profile's `lod_bits`. What a level outside any chain was, a bias of at most 16 cannot undo.

use super::number::{FIXED_BITS, Fixed, Number};
use super::{MipFilter, STATE_LOD_BITS, Sampler};
use crate::profile::Profile;

/// Fractional bits of a footprint's level of detail.
pub const FOOTPRINT_LOD_BITS: u32 = 16;

/// Levels of detail are limited to ± this before the bias.
const RANGE: i128 = 1024 << FIXED_BITS;

/// A mip, and how much of the next is mixed in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Level {
    /// The mip.
    pub mip: u8,
    /// The weight of the next mip, in 1/2^`lod_bits`. Where it is 0, and only there, the next mip
    /// takes no part: Direct3D calls it a violation to treat small weights as 0.
    pub fraction: u32,
}

/// The level with these f32 bits; NaN is 0.
#[must_use]
pub const fn from_bits(bits: u32) -> Fixed {
    Number::from_bits(bits).times(1).clamp(-RANGE, RANGE)
}

/// The level of a footprint, in 1/2^16.
#[must_use]
pub const fn from_footprint(lod: i32) -> Fixed {
    Fixed::exact((lod as i128) << (FIXED_BITS - FOOTPRINT_LOD_BITS)).clamp(-RANGE, RANGE)
}

impl Level {
    /// The mips of level `lod` in a chain of `mip_count`, before the sampler's bias.
    #[must_use]
    pub const fn of(lod: Fixed, sampler: &Sampler, mip_count: u8, profile: &Profile) -> Level {
        let bits = profile.lod_bits as u32;
        let fixed = fixed(lod, sampler, mip_count, profile);
        match sampler.mip_filter {
            MipFilter::Base => Level {
                mip: 0,
                fraction: 0,
            },
            MipFilter::Point => Level {
                mip: nearest(fixed, bits),
                fraction: 0,
            },
            MipFilter::Linear => Level {
                mip: (fixed >> bits) as u8,
                fraction: fixed & ((1 << bits) - 1),
            },
        }
    }

    /// The one mip of level `lod` for a gather, which filters nothing: the nearest, or mip 0 where
    /// the sampler takes no other.
    #[must_use]
    pub const fn gathered(lod: Fixed, sampler: &Sampler, mip_count: u8, profile: &Profile) -> u8 {
        match sampler.mip_filter {
            MipFilter::Base => 0,
            MipFilter::Point | MipFilter::Linear => {
                let fixed = fixed(lod, sampler, mip_count, profile);
                nearest(fixed, profile.lod_bits as u32)
            }
        }
    }
}

/// After bias, limits and chain, in 1/2^`lod_bits`.
const fn fixed(lod: Fixed, sampler: &Sampler, mip_count: u8, profile: &Profile) -> u32 {
    let state_shift = FIXED_BITS - STATE_LOD_BITS;
    let bias = (sampler.bias as i128) << state_shift;
    let low = (sampler.min_lod as i128) << state_shift;
    let high = (sampler.max_lod as i128) << state_shift;
    let high = if high < low { low } else { high };
    let shift = FIXED_BITS - profile.lod_bits as u32;
    let rounded = lod
        .plus(bias)
        .clamp(low, high)
        .round(1 << shift, profile.coordinate);
    let last = (mip_count as i128 - 1) << profile.lod_bits;
    // Neither below 0 nor above 15·2^8.
    (if rounded < 0 {
        0
    } else if rounded > last {
        last
    } else {
        rounded
    }) as u32
}

const fn nearest(fixed: u32, bits: u32) -> u8 {
    ((fixed + (1 << bits >> 1)) >> bits) as u8
}
