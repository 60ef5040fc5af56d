//! Embedding: the 8-bit integers that enter the synthesizer.
//!
//! Every input has the same scale, real = value / 128, so that one accumulator serves them all. In
//! this order: the four corners of grid 0, concatenated; grid 1, interpolated; the waves; the
//! level.

use crate::latent::LatentFormat;
use crate::position::PHASE_BITS;
use crate::round::{Rounding, saturate};

/// Fractional bits of an input: real = value / 2^7.
pub const INPUT_FRACTION_BITS: u8 = 7;

/// The smallest and the largest value of an input or an activation.
pub const ACTIVATION_RANGE: (i32, i32) = (-128, 127);

/// Waves per octave: two axes, two phases a quarter period apart.
pub const WAVES_PER_OCTAVE: u16 = 4;

/// The most octaves: the fourth has one period per texel and carries nothing.
pub const MAX_OCTAVES: u8 = 3;

/// A latent of one corner as an input. Exact for up to seven bits; an eight-bit latent is halved
/// with the profile's input rounding. One half becomes 64.
#[must_use]
pub const fn corner_input(value: i32, format: LatentFormat, rounding: Rounding) -> i32 {
    fixed_to_input(value, format.bits() as u32, rounding)
}

/// An interpolated latent as an input.
///
/// `sum` is Σ weight·value over the four corners with weights in 1/256 (see
/// [`crate::position::corner_weights`]), in full width: at most 256·128 in magnitude. This is the
/// only rounding of the interpolation, which keeps it monotone along both axes.
#[must_use]
pub const fn lerp_input(sum: i32, format: LatentFormat, rounding: Rounding) -> i32 {
    fixed_to_input(sum, format.bits() as u32 + 2 * PHASE_BITS as u32, rounding)
}

/// A number with `fraction_bits` fractional bits, re-expressed with [`INPUT_FRACTION_BITS`].
const fn fixed_to_input(value: i32, fraction_bits: u32, rounding: Rounding) -> i32 {
    let target = INPUT_FRACTION_BITS as u32;
    let scaled = if fraction_bits <= target {
        (value as i64) << (target - fraction_bits)
    } else {
        rounding.shift(value as i64, fraction_bits - target)
    };
    saturate(scaled, ACTIVATION_RANGE.0, ACTIVATION_RANGE.1)
}

/// A triangle wave of the texel's place in its 8×8 tile of mip 0, as an input.
///
/// Real meaning: with `t = (texel + ½)·2^mip / 8 · 2^octave (+ ¼ if quarter)` and `f` its
/// fraction, the wave is `4·|f − ½| − 1`: 1 at `f = 0`, −1 at `f = ½`. Times 128 it is always an
/// integer, 1 saturating to 127. This is the tiled encoding of NTC (Vaidyanathan et al. 2023,
/// section 4.2), which the CNTC paper does not detail.
#[must_use]
pub const fn wave_input(texel: u32, mip: u8, octave: u8, quarter: bool) -> i32 {
    let half_texels = (2 * texel + 1) << mip;
    let sixteenths = ((half_texels << octave) + if quarter { 4 } else { 0 }) & 15;
    let distance = (sixteenths as i32 - 8).abs();
    saturate(
        distance as i64 * 32 - 128,
        ACTIVATION_RANGE.0,
        ACTIVATION_RANGE.1,
    )
}

/// The normalised mip m/M as an input: 127·m/M to the nearest integer, ties up; 0 where M is 0.
#[must_use]
pub const fn level_input(mip: u8, mip_count: u8) -> i32 {
    let last = mip_count as i32 - 1;
    if last <= 0 {
        0
    } else {
        (254 * mip as i32 + last) / (2 * last)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn interpolation_of_equal_corners_is_the_corner() {
        for bits in 1..=8 {
            let format = LatentFormat::new(bits).unwrap();
            for value in format.min_value()..=format.max_value() {
                for mode in Rounding::ALL {
                    assert_eq!(
                        lerp_input(256 * value, format, mode),
                        corner_input(value, format, mode),
                        "{bits} bits, value {value}"
                    );
                }
            }
        }
    }

    #[test]
    fn half_is_sixty_four_at_every_width() {
        for bits in 1..=8 {
            let format = LatentFormat::new(bits).unwrap();
            assert_eq!(
                corner_input(format.max_value(), format, Rounding::HalfUp),
                64
            );
        }
    }

    #[test]
    fn waves_repeat_every_tile_and_stay_in_range() {
        for octave in 0..MAX_OCTAVES {
            for texel in 0..64 {
                for quarter in [false, true] {
                    let wave = wave_input(texel, 0, octave, quarter);
                    assert_eq!(wave, wave_input(texel + 8, 0, octave, quarter));
                    assert!((-128..=127).contains(&wave));
                }
            }
        }
        // Texel 0 of mip 0: t = 1/16, f = 1/16, 4·(7/16) − 1 = 3/4.
        assert_eq!(wave_input(0, 0, 0, false), 96);
        // A quarter on: f = 5/16, 4·(3/16) − 1 = −1/4.
        assert_eq!(wave_input(0, 0, 0, true), -32);
        assert_eq!(wave_input(0, 4, 0, false), 127);
    }

    #[test]
    fn level_spans_zero_to_one() {
        assert_eq!([0, 4, 8].map(|m| level_input(m, 9)), [0, 64, 127]);
        assert_eq!(level_input(0, 1), 0);
    }
}
