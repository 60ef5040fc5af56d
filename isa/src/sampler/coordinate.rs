//! Coordinate: where on a mip a normalised coordinate lies, and between which texels.
//!
//! In the order of Direct3D 11.3, sections 7.18.6 to 7.18.8: the range is reduced by the address
//! mode, the coordinate is multiplied by the mip's size (less half a texel where texels are
//! filtered), and becomes fixed point with the profile's `subtexel_bits` by its `coordinate`
//! rounding. Everything before that one rounding is exact: an f32 is a whole number of 2^−149 and a
//! size is an integer.
//!
//! Direct3D allows the conversion an error of 0.6 of the last place (3.2.4.1); one rounding to nearest
//! of the exact number has 0.5 at most. A chain of f32 operations has up to three roundings more, each
//! far below a last place inside the texture, and so can take the other side near a tie:
//!
//! - the fraction of a negative number that wraps, u − ⌊u⌋, needs more than 24 bits; nearer to 0 than
//!   2^−25 it even becomes 1, here it stays below;
//! - the product with a size that is no power of two needs more than 24 bits;
//! - so does the difference of a small number and half a texel.
//!
//! Then the two differ by one last place. By floor they can differ at every whole number: the chain
//! reaches it from below, and a unit that flushes subnormal numbers does from above.

use super::address::Address;
use super::number::{FIXED_BITS, Fixed, Number};
use crate::profile::{PointSnap, Profile};

/// The range that coordinates are limited to where they do not repeat (Direct3D 11.3, 7.18.6): far
/// enough outside that no offset of −8..=7 texels leads back in.
const RANGE: i128 = 10;

/// From here every f32 is an even number of textures, and no line leads back into the range.
const LARGE: i128 = 1 << 24;

/// Fractional bits of a footprint's line, in textures.
pub const LINE_BITS: u32 = 24;

/// Where on its footprint's line a probe lies, along one axis: at `line · (2·index + 1 − count) /
/// (2·count)` from the middle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Step {
    /// The whole line, in 1/2^24 of the texture's extent.
    pub line: i32,
    /// The probe, 0..`count`.
    pub index: u8,
    /// Probes on the line, 1..=16.
    pub count: u8,
}

impl Step {
    /// The only probe of a footprint that is none.
    pub const CENTRE: Step = Step {
        line: 0,
        index: 0,
        count: 1,
    };

    const fn half_steps(self) -> i128 {
        2 * self.index as i128 + 1 - self.count as i128
    }
}

/// A coordinate in texels of a mip, exactly: in units of 1 / (2·`count`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Scaled {
    units: Fixed,
    count: i128,
}

/// Two neighbouring texels of one axis, before the address mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pair {
    /// The left, or upper, one; the other is the next. May lie outside the mip.
    pub first: i64,
    /// The weight of the other, in 1/2^`subtexel_bits`; that of the first is what is left to 1.
    pub fraction: u32,
}

impl Scaled {
    /// The f32 with bits `u`, moved by `step`, on an axis of `size` texels (at most 2^14).
    ///
    /// NaN is 0. Where texels repeat, an infinity lies where 0 does, as ∞ − ⌊∞⌋ is NaN; elsewhere it
    /// is the end of the range. A step moves the normalised coordinate, so that every probe is reduced
    /// by itself (the note of 7.18.6).
    #[must_use]
    pub const fn of(u: u32, address: Address, step: Step, size: u32) -> Scaled {
        let count = step.count as i128;
        let whole = (size as i128 * 2 * count) << FIXED_BITS;
        let number = Number::from_bits(u);
        let unmoved = if number.exponent > 0 {
            Fixed::exact(number.significand.signum() as i128 * LARGE * whole)
        } else {
            number.times(size * 2 * step.count as u32)
        };
        let line = step.line as i128 * step.half_steps() * size as i128;
        let moved = unmoved.plus(line << (FIXED_BITS - LINE_BITS));
        let units = match address {
            Address::Wrap => moved.above_floor(whole),
            Address::Mirror => moved.beyond_zero(2 * whole),
            Address::MirrorOnce | Address::Clamp | Address::Border => {
                moved.clamp(-RANGE * whole, RANGE * whole)
            }
        };
        Scaled { units, count }
    }

    /// Less half a texel, rounded: the two texels of a linear filter.
    #[must_use]
    pub const fn pair(self, profile: &Profile) -> Pair {
        let bits = profile.subtexel_bits as u32;
        let half_texel = self.count << FIXED_BITS;
        let fixed = self.rounded(-half_texel, profile);
        Pair {
            first: fixed >> bits,
            fraction: (fixed & ((1 << bits) - 1)) as u32,
        }
    }

    /// The one texel of a point sample.
    #[must_use]
    pub const fn texel(self, profile: &Profile) -> i64 {
        match profile.point_snap {
            PointSnap::Fixed => self.rounded(0, profile) >> profile.subtexel_bits,
            PointSnap::Floor => {
                let one_texel = (2 * self.count) << FIXED_BITS;
                self.units.value.div_euclid(one_texel) as i64
            }
        }
    }

    /// To 1/2^`subtexel_bits` texels, after adding `offset` of its own units.
    const fn rounded(self, offset: i128, profile: &Profile) -> i64 {
        let denominator = (2 * self.count) << (FIXED_BITS - profile.subtexel_bits as u32);
        self.units
            .plus(offset)
            .round(denominator, profile.coordinate) as i64
    }
}
