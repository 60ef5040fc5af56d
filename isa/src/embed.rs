//! Embedding: the integers that enter the synthesizer.
//!
//! Every input has the same scale, real = value / 2^(A−1) with A bits, so that one accumulator
//! serves them all. In this order: grid 0, grid 1, the waves, the level, and zeros up to the
//! width that the first layer wants. A grid gives its four corners one after the other, or one
//! interpolated latent a channel.

use crate::accumulate::signed_range;
use crate::latent::LatentFormat;
use crate::profile::Profile;
use crate::round::{Rounding, saturate};

/// Waves per octave: two axes, two phases a quarter period apart.
pub const WAVES_PER_OCTAVE: u16 = 4;

/// The most octaves: the fourth has one period per texel and carries nothing.
pub const MAX_OCTAVES: u8 = 3;

/// The form of the waves that tell a texel where it lies in its 8×8 tile of mip 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Wave {
    /// 4·|f − ½| − 1 of the period's fraction f: continuous. NTC (Vaidyanathan et al. 2023,
    /// section 4.2); the CNTC paper gives no detail.
    Triangle,
    /// 2·f − 1: falls at the period's end. NVIDIA's RTX SDK.
    Saw,
}

impl Wave {
    /// Every form, in the order of its code in a file.
    pub const ALL: [Wave; 2] = [Wave::Triangle, Wave::Saw];

    /// The name in tables, assembly and JSON.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Wave::Triangle => "triangle",
            Wave::Saw => "saw",
        }
    }

    /// The code in a file.
    #[must_use]
    pub const fn code(self) -> u8 {
        self as u8
    }

    /// The form with this code, if there is one.
    #[must_use]
    pub fn from_code(code: u8) -> Option<Wave> {
        Wave::ALL.get(usize::from(code)).copied()
    }

    /// The wave at `turns`/2^`bits` periods, as an input of `input_bits` bits, ties up.
    ///
    /// At texel centres `bits` is 4 and the wave a multiple of 1/8: exact in four bits and more,
    /// except that 1 saturates.
    #[must_use]
    pub const fn at(self, turns: u64, bits: u32, input_bits: u8) -> i32 {
        let one = 1_i64 << bits;
        let fraction = turns as i64 & (one - 1);
        // In units of 2^−(bits−1) for a saw, 2^−(bits−2) for a triangle.
        let (value, value_bits) = match self {
            Wave::Triangle => {
                let distance = (2 * fraction - one).abs();
                (distance - one / 2, bits - 1)
            }
            Wave::Saw => (2 * fraction - one, bits),
        };
        fixed_to_input(value, value_bits, input_bits, Rounding::HalfUp)
    }
}

/// The smallest and the largest value of an input with `input_bits` bits.
#[must_use]
pub const fn input_range(input_bits: u8) -> (i32, i32) {
    signed_range(input_bits)
}

/// A latent of one corner as an input of `input_bits` bits. Exact unless the latent has as many
/// bits or more, in which case the low ones are dropped with the profile's input rounding.
#[must_use]
pub const fn corner_input(
    value: i32,
    format: LatentFormat,
    input_bits: u8,
    rounding: Rounding,
) -> i32 {
    fixed_to_input(value as i64, format.bits() as u32, input_bits, rounding)
}

/// An interpolated latent as an input of `input_bits` bits.
///
/// `values` are those of the corners (0,0), (1,0), (0,1), (1,1); `fractions` have the profile's
/// subtexel bits. By the normative rule the sum is kept in full width and this is the only rounding
/// of the interpolation; a rule that rounds per axis does so on inputs.
#[must_use]
pub const fn lerp_input(
    values: [i32; 4],
    fractions: [u32; 2],
    format: LatentFormat,
    input_bits: u8,
    profile: &Profile,
) -> i32 {
    let (bits, rounding) = (profile.subtexel_bits as u32, profile.input);
    let is_single = profile.interpolate.is_single_rounded();
    let mut corners = [0; 4];
    let mut corner = 0;
    while corner < 4 {
        corners[corner] = if is_single {
            values[corner] as i64
        } else {
            corner_input(values[corner], format, input_bits, rounding) as i64
        };
        corner += 1;
    }
    let weighted = profile
        .interpolate
        .bilinear(corners, fractions, bits, rounding);
    if is_single {
        let fraction_bits = format.bits() as u32 + weighted.fraction_bits;
        fixed_to_input(weighted.sum, fraction_bits, input_bits, rounding)
    } else {
        let (low, high) = input_range(input_bits);
        saturate(weighted.sum, low, high)
    }
}

/// A number with `fraction_bits` fractional bits as an input of `input_bits` bits, which has one
/// fewer; saturated.
const fn fixed_to_input(value: i64, fraction_bits: u32, input_bits: u8, rounding: Rounding) -> i32 {
    let target = input_bits as u32 - 1;
    let scaled = if fraction_bits <= target {
        value << (target - fraction_bits)
    } else {
        rounding.shift(value, fraction_bits - target)
    };
    let (low, high) = input_range(input_bits);
    saturate(scaled, low, high)
}

/// The wave of a texel's centre along one axis: [`wave_at`] of it.
#[must_use]
pub const fn wave_input(
    wave: Wave,
    texel: u32,
    mip: u8,
    octave: u8,
    quarter: bool,
    input_bits: u8,
) -> i32 {
    let centre = 2 * texel as i64 + 1;
    wave_at(wave, centre, 1, mip, octave, quarter, input_bits)
}

/// The wave of any place along one axis.
///
/// `coordinate` counts 1/2^`bits` texels of the mip from the edge of texel 0, as in
/// [`AxisPosition::at`](crate::position::AxisPosition::at). Real meaning: at
/// `t = coordinate/2^bits · 2^mip / 8 · 2^octave (+ ¼ if quarter)` periods. In integers `t` counts
/// 1/2^(bits + 3) periods and is exact; what lies before texel 0 is one period or more away from
/// what lies behind it.
#[must_use]
pub const fn wave_at(
    wave: Wave,
    coordinate: i64,
    bits: u8,
    mip: u8,
    octave: u8,
    quarter: bool,
    input_bits: u8,
) -> i32 {
    let turn_bits = bits as u32 + 3;
    let shift = if quarter { 1 << (turn_bits - 2) } else { 0 };
    let turns = ((coordinate << mip) << octave) + shift;
    // Two's complement keeps the fraction of a negative number of turns.
    wave.at(turns as u64, turn_bits, input_bits)
}

/// The normalised mip m/M as an input: [`level_at`] of it.
#[must_use]
pub const fn level_input(mip: u8, mip_count: u8, input_bits: u8) -> i32 {
    level_at(mip as u32, 0, mip_count, input_bits)
}

/// The normalised level of detail as an input: the largest input times lod/(2^`lod_bits`·M) to the
/// nearest integer, ties up; 0 where the last mip M is 0.
///
/// `lod` counts 1/2^`lod_bits` mips, at most the last one; `lod_bits` is 0..=8.
#[must_use]
pub const fn level_at(lod: u32, lod_bits: u8, mip_count: u8, input_bits: u8) -> i32 {
    let last = (mip_count as i64 - 1) << lod_bits;
    let (_, high) = input_range(input_bits);
    if last <= 0 {
        0
    } else {
        ((2 * high as i64 * lod as i64 + last) / (2 * last)) as i32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::filter::FilterRule;

    #[test]
    fn interpolation_of_equal_corners_is_the_corner() {
        for bits in 1..=8 {
            let format = LatentFormat::new(bits).unwrap();
            for (value, input_bits) in (format.min_value()..=format.max_value())
                .flat_map(|value| [4, 7, 8, 12, 16].map(|input_bits| (value, input_bits)))
            {
                for (input, interpolate) in Rounding::ALL
                    .into_iter()
                    .flat_map(|input| FilterRule::ALL.map(|rule| (input, rule)))
                {
                    let profile = Profile {
                        input,
                        interpolate,
                        ..Profile::NORMATIVE
                    };
                    assert_eq!(
                        lerp_input([value; 4], [176, 48], format, input_bits, &profile),
                        corner_input(value, format, input_bits, input),
                        "{bits} bits, value {value}, {input_bits} bits of input"
                    );
                }
            }
        }
    }

    #[test]
    fn half_is_half_of_the_range_at_every_width() {
        for bits in 1..=8 {
            let format = LatentFormat::new(bits).unwrap();
            for input_bits in 4..=16 {
                let half = corner_input(format.max_value(), format, input_bits, Rounding::HalfUp);
                assert_eq!(half, 1 << (input_bits - 2));
            }
        }
    }

    #[test]
    fn waves_repeat_every_tile_and_stay_in_range() {
        for (wave, octave) in Wave::ALL
            .into_iter()
            .flat_map(|wave| (0..MAX_OCTAVES).map(move |octave| (wave, octave)))
        {
            for (texel, quarter) in (0..64).flat_map(|t| [false, true].map(|q| (t, q))) {
                let at = |texel| wave_input(wave, texel, 0, octave, quarter, 8);
                assert_eq!(at(texel), at(texel + 8));
                assert!((-128..=127).contains(&at(texel)));
            }
        }
        let at = |wave, mip, quarter| wave_input(wave, 0, mip, 0, quarter, 8);
        // Texel 0 of mip 0: t = 1/16, f = 1/16, 4·(7/16) − 1 = 3/4; a quarter on −1/4.
        assert_eq!(at(Wave::Triangle, 0, false), 96);
        assert_eq!(at(Wave::Triangle, 0, true), -32);
        assert_eq!(at(Wave::Triangle, 4, false), 127);
        // 2/16 − 1 = −7/8; a quarter on −3/8.
        assert_eq!(at(Wave::Saw, 0, false), -112);
        assert_eq!(at(Wave::Saw, 0, true), -48);
        assert_eq!(at(Wave::Saw, 4, false), -128);
    }

    #[test]
    fn waves_of_every_width_are_the_same_reals() {
        for (wave, texel) in Wave::ALL
            .into_iter()
            .flat_map(|w| (0..8).map(move |t| (w, t)))
        {
            let fine = wave_input(wave, texel, 0, 0, false, 16);
            for input_bits in 4..16 {
                let coarse = wave_input(wave, texel, 0, 0, false, input_bits);
                assert_eq!(coarse << (16 - input_bits), fine);
            }
        }
    }

    #[test]
    fn level_spans_zero_to_one() {
        assert_eq!([0, 4, 8].map(|m| level_input(m, 9, 8)), [0, 64, 127]);
        assert_eq!([0, 14].map(|m| level_input(m, 15, 16)), [0, 32_767]);
        assert_eq!(level_input(0, 1, 8), 0);
    }

    #[test]
    fn the_wave_of_a_centre_is_the_texels_at_every_number_of_bits() {
        for (wave, texel) in Wave::ALL
            .into_iter()
            .flat_map(|w| (0..40).map(move |t| (w, t)))
        {
            for (mip, octave) in (0..=14).flat_map(|m| (0..MAX_OCTAVES).map(move |o| (m, o))) {
                for (bits, quarter) in (1..=12).flat_map(|b| [false, true].map(|q| (b, q))) {
                    let centre = i64::from(2 * texel + 1) << (bits - 1);
                    assert_eq!(
                        wave_at(wave, centre, bits, mip, octave, quarter, 8),
                        wave_input(wave, texel, mip, octave, quarter, 8)
                    );
                }
            }
        }
    }

    /// The wave by its definition: as a fraction of 2^`log2`, with division and remainder.
    fn wave_by_definition(wave: Wave, turns: i128, log2: u32, input_bits: u8) -> i128 {
        let one = 1_i128 << log2;
        let fraction = turns.rem_euclid(one);
        let real = match wave {
            Wave::Triangle => 4 * (fraction - one / 2).abs() - one,
            Wave::Saw => 2 * fraction - one,
        };
        let scale = 1_i128 << (input_bits - 1);
        let nearest = (2 * real * scale + one).div_euclid(2 * one);
        nearest.clamp(-scale, scale - 1)
    }

    #[test]
    fn waves_of_every_place_obey_the_definition_and_wrap_below_zero() {
        for (bits, mip) in [(1, 0), (2, 3), (4, 0), (6, 0), (8, 1), (12, 0), (12, 14)] {
            for coordinate in (-20..20).chain((-20_i64..20).map(|texel| texel * 211 + 5)) {
                for (octave, quarter) in
                    (0..MAX_OCTAVES).flat_map(|o| [false, true].map(|q| (o, q)))
                {
                    let log2 = u32::from(bits) + 3;
                    let turns = (i128::from(coordinate) << (mip + octave))
                        + if quarter { 1 << (log2 - 2) } else { 0 };
                    for (wave, input_bits) in Wave::ALL
                        .into_iter()
                        .flat_map(|w| [4, 8, 12, 16].map(|b| (w, b)))
                    {
                        let found =
                            wave_at(wave, coordinate, bits, mip, octave, quarter, input_bits);
                        let expected = wave_by_definition(wave, turns, log2, input_bits);
                        assert_eq!(i128::from(found), expected);
                    }
                }
            }
        }
    }

    #[test]
    fn every_level_of_detail_is_its_nearest_input() {
        for mip_count in 1..=15_u8 {
            let last = u32::from(mip_count) - 1;
            for lod_bits in 0..=8_u8 {
                for lod in 0..=last << lod_bits {
                    for input_bits in [4, 8, 11, 16] {
                        let found = level_at(lod, lod_bits, mip_count, input_bits);
                        if last == 0 {
                            assert_eq!(found, 0);
                            continue;
                        }
                        // Twice the distance, times the denominator: −1 < 2·distance ≤ 1.
                        let (high, full) = ((1_i64 << (input_bits - 1)) - 1, last << lod_bits);
                        let full = i64::from(full);
                        let distance = 2 * (i64::from(found) * full - high * i64::from(lod));
                        assert!(-full < distance && distance <= full);
                        if lod.is_multiple_of(1 << lod_bits) {
                            let mip = (lod >> lod_bits) as u8;
                            assert_eq!(found, level_input(mip, mip_count, input_bits));
                        }
                    }
                }
            }
        }
    }
}
