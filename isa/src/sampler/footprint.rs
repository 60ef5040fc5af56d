//! Footprint: how many probes along which line, and at which level, from gradients.
//!
//! A footprint is exact, whoever makes it. How gradients become one is a rule of this project's own,
//! because Direct3D 11.3 (7.18.11) states an ideal in reals and allows approximations. The rule is
//! that of `EXT_texture_filter_anisotropic` on integers: it needs no square root and no division to
//! choose the number of probes, and the logarithm is taken of a squared length.
//!
//! 1. Gradients in texels of mip 0, rounded to 1/2^16 by the profile's `coordinate` rounding, limited
//!    to ±2^24 texels. NaN is 0.
//! 2. Squared lengths of d/dx and d/dy, exactly. The longer is the major axis, d/dy where both are
//!    equal (as Direct3D has it).
//! 3. Probes: the smallest n with n²·minor² ≥ major², at most the sampler's `max_anisotropy`.
//! 4. Level: log2(major length / n), rounded down to 1/2^16; [`LOWEST`] where the gradients are zero.
//! 5. Line: the major gradient itself in 1/2^24 of the texture, rounded alike, limited to ±128
//!    textures.
//!
//! Parallel gradients of equal length thus make a round footprint, where Direct3D's ideal, by area,
//! makes a line. The bound of the level: real − 2^−16 − 2^−40 < level ≤ real, for the gradients of
//! step 1.

use super::lod::FOOTPRINT_LOD_BITS;
use super::number::{FIXED_BITS, Number};
use crate::profile::Profile;

/// Equally spaced probes on a line through the sample's place, all of the same weight and level.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Footprint {
    /// The number of probes; limited to 1..=`max_anisotropy` of the sampler.
    pub probes: u8,
    /// The whole line along u and v, in 1/2^24 of the texture's extent. Probe i of n lies at
    /// (2i + 1 − n)/(2n) of it from the middle.
    pub line: [i32; 2],
    /// The level of detail before the sampler's bias, in 1/2^16.
    pub lod: i32,
}

/// The level of gradients that are zero: no bias leads from there to a mip above 0.
pub const LOWEST: i32 = -64 << FOOTPRINT_LOD_BITS;

/// Fractional bits of a gradient in texels.
pub const GRADIENT_BITS: u32 = 16;

/// The largest gradient in texels, 2^24, in 1/2^16.
const LARGEST: i128 = 1 << (24 + GRADIENT_BITS);

impl Footprint {
    /// The footprint of the gradients (du/dx, dv/dx) and (du/dy, dv/dy), as f32 bits, on a mip 0 of
    /// `size` texels. `max_anisotropy` is 1..=16; with 1 the level is log2 of the longer gradient,
    /// Direct3D's isotropic rule.
    #[must_use]
    pub fn of(
        x: [u32; 2],
        y: [u32; 2],
        size: [u32; 2],
        max_anisotropy: u8,
        profile: &Profile,
    ) -> Footprint {
        let square = |gradient: [u32; 2]| -> u128 {
            (0..2)
                .map(|axis| texels(gradient[axis], size[axis], profile))
                .map(|length| (length * length) as u128)
                .sum()
        };
        let (square_x, square_y) = (square(x), square(y));
        let (major, minor, gradient) = if square_x > square_y {
            (square_x, square_y, x)
        } else {
            (square_y, square_x, y)
        };
        let probes = (1..max_anisotropy)
            .find(|&n| u128::from(n).pow(2) * minor >= major)
            .unwrap_or(max_anisotropy);
        Footprint {
            probes,
            line: gradient.map(|bits| line(bits, profile)),
            lod: level(major, probes),
        }
    }
}

/// A normalised gradient in 1/2^16 texels of an axis of `size`.
fn texels(gradient: u32, size: u32, profile: &Profile) -> i128 {
    Number::from_bits(gradient)
        .times(size)
        .round(1 << (FIXED_BITS - GRADIENT_BITS), profile.coordinate)
        .clamp(-LARGEST, LARGEST)
}

/// A normalised gradient in 1/2^24 textures.
fn line(gradient: u32, profile: &Profile) -> i32 {
    let shift = FIXED_BITS - super::coordinate::LINE_BITS;
    Number::from_bits(gradient)
        .times(1)
        .round(1 << shift, profile.coordinate)
        .clamp(i32::MIN.into(), i32::MAX.into()) as i32
}

/// ½·log2(`major` / 2^32 / `probes`²) in 1/2^16, rounded down.
fn level(major: u128, probes: u8) -> i32 {
    if major == 0 {
        return LOWEST;
    }
    let zeros = major.leading_zeros();
    let quotient = (major << zeros) / u128::from(probes).pow(2);
    // Half a logarithm in 1/2^16 is the logarithm in 1/2^15.
    let bits = FOOTPRINT_LOD_BITS - 1;
    log2(quotient, bits) - ((zeros + 2 * GRADIENT_BITS) << bits) as i32
}

/// log2 of a number of at least 2^64, in 1/2^`bits`, rounded down; bit by bit.
///
/// The mantissa is squared once a bit: where the square reaches 2 the bit is one, and it is halved.
/// It is kept in 64 bits, cut off, so the result can be one too small where the exact logarithm lies
/// less than 2^(`bits` − 62) last places above a multiple.
#[must_use]
pub const fn log2(number: u128, bits: u32) -> i32 {
    let zeros = number.leading_zeros();
    let mut mantissa = (number << zeros >> 64) as u64;
    let mut log = 127 - zeros as i32;
    let mut bit = 0;
    while bit < bits {
        let square = mantissa as u128 * mantissa as u128;
        let is_two = square >> 127 == 1;
        mantissa = (square >> if is_two { 64 } else { 63 }) as u64;
        log = 2 * log + is_two as i32;
        bit += 1;
    }
    log
}
