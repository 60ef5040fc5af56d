//! Blend: how the codes of a footprint become one code.
//!
//! By the exact rule all weights (of corners, mips and probes) are multiplied out, and the sum is
//! rounded once, by the profile's `filter_rounding`. So the result is monotone in every fraction,
//! keeps a constant, and lies within the codes that it is made of (Direct3D 11.3, 7.18.16.3). The
//! factored rule is the same with its own corner weights. The other two round after each axis, then
//! between the mips, then the average of the probes.
//!
//! Integer formats are filtered as their codes, signed ones with their sign. A `float16` channel is
//! filtered as the reals of its halves, which are multiples of 2^−24: exactly, and then to the nearest
//! half, ties to even, whatever `filter_rounding` says, because the encoding has no other rounding
//! in this specification. Rules that round between steps do so to multiples of 2^−24. A sum of −0s
//! only is −0; any other zero is +0.

use super::number::divide;
use super::plan::Probe;
use crate::filter::FilterRule;
use crate::half::Half;
use crate::profile::Profile;
use crate::shape::OutputFormat;

/// The codes of one channel at the four corners of a square. A corner without weight may hold
/// anything that the format can.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Corners {
    /// At (0,0), (1,0), (0,1), (1,1).
    pub codes: [i32; 4],
    /// The weights of the second column and row, in 1/2^`subtexel_bits`.
    pub fractions: [u32; 2],
}

impl Corners {
    /// One code with all the weight.
    #[must_use]
    pub const fn one(code: i32) -> Corners {
        Corners {
            codes: [code; 4],
            fractions: [0; 2],
        }
    }
}

/// Guard bits of a quotient by at most 16 before it becomes a half: what does not lie on a tie is at
/// least 1/16 of a unit from it, so what follows these bits decides nothing.
const GUARD_BITS: u32 = 8;

/// The code of the half −0.
const MINUS_ZERO: i32 = 0x8000;

/// One channel of a sample from its probes: 1..=16; nothing gives zero.
#[must_use]
pub fn blend(probes: &[Probe<Corners>], format: OutputFormat, profile: &Profile) -> i32 {
    let (bits, lod_bits) = (
        u32::from(profile.subtexel_bits),
        u32::from(profile.lod_bits),
    );
    let rounding = profile.filter_rounding;
    let rule = profile.filter;
    // In units of 2^−fraction_bits of the codes, times the number of probes.
    let (sum, fraction_bits) = match rule {
        FilterRule::Exact | FilterRule::Factored => {
            let one = 1_i128 << lod_bits;
            let weighted = |corners: &Corners| -> i128 {
                rule.weights(corners.fractions, bits)
                    .into_iter()
                    .zip(corners.codes)
                    .map(|(weight, code)| i128::from(weight) * i128::from(value(code, format)))
                    .sum()
            };
            let sum = probes
                .iter()
                .map(|probe| {
                    let fraction = i128::from(probe.fraction);
                    let far = probe.far.as_ref().map_or(0, weighted);
                    weighted(&probe.near) * (one - fraction) + far * fraction
                })
                .sum();
            let corner_bits = match rule {
                FilterRule::Factored => bits,
                FilterRule::Exact | FilterRule::Separable | FilterRule::AllOnes => 2 * bits,
            };
            (sum, corner_bits + lod_bits)
        }
        FilterRule::Separable | FilterRule::AllOnes => {
            let rounded = |corners: &Corners| {
                let values = corners.codes.map(|code| value(code, format));
                rule.bilinear(values, corners.fractions, bits, rounding).sum
            };
            let sum = probes
                .iter()
                .map(|probe| {
                    let near = rounded(&probe.near);
                    let joined = probe.far.as_ref().map_or(near, |far| {
                        let ends = [near, rounded(far)];
                        rule.linear(ends, probe.fraction, lod_bits, rounding).sum
                    });
                    i128::from(joined)
                })
                .sum();
            (sum, 0)
        }
    };
    let count = probes.len().max(1) as i128;
    match format {
        OutputFormat::Unorm8 | OutputFormat::Unorm16 | OutputFormat::Snorm8 => {
            divide(sum, count << fraction_bits, rounding) as i32
        }
        OutputFormat::Float16 => half(sum, count, fraction_bits, probes),
    }
}

/// What is summed: a code itself, or a half as a multiple of 2^−24.
const fn value(code: i32, format: OutputFormat) -> i64 {
    match format {
        OutputFormat::Unorm8 | OutputFormat::Unorm16 | OutputFormat::Snorm8 => code as i64,
        OutputFormat::Float16 => Half::from_bits(code as u16).multiple(),
    }
}

/// The half nearest to `sum / count / 2^fraction_bits · 2^−24`.
fn half(sum: i128, count: i128, fraction_bits: u32, probes: &[Probe<Corners>]) -> i32 {
    if sum == 0 {
        let is_negative = probes
            .iter()
            .all(|probe| probe.weighted_codes().all(|code| code == MINUS_ZERO));
        return if is_negative { MINUS_ZERO } else { 0 };
    }
    let quotient = (sum << GUARD_BITS).div_euclid(count);
    let half = Half::from_fixed(quotient, 24 + fraction_bits + GUARD_BITS);
    i32::from(half.bits())
}

impl Probe<Corners> {
    /// The codes that have any weight.
    fn weighted_codes(&self) -> impl Iterator<Item = i32> {
        [Some(self.near), self.far]
            .into_iter()
            .flatten()
            .flat_map(|corners| {
                let [x, y] = corners.fractions;
                (0..4)
                    .filter(move |c| (c & 1 == 0 || x > 0) && (c >> 1 == 0 || y > 0))
                    .map(move |c: usize| corners.codes[c])
            })
    }
}
