//! A sample in reals, written from Direct3D 11.3, section 7.18.
//!
//! What is definition is kept: coordinates become fixed point with the profile's `subtexel_bits` and
//! levels of detail with its `lod_bits`, each by one rounding of the exact number, as those say
//! *which* texels a sample means. They are computed on rationals with a denominator of 2^64. What is
//! rounding, of weights and of sums, is left out; [`bound`] says how much of it there may be.

use super::number;
use ntmu_isa::filter::FilterRule;
use ntmu_isa::half::Half;
use ntmu_isa::profile::{PointSnap, Profile};
use ntmu_isa::round::Rounding;
use ntmu_isa::sampler::{Address, Filter, MipFilter, Sampler};
use ntmu_isa::shape::{OutputFormat, Shape};

/// 1 in the rationals of a coordinate.
const ONE: i128 = 1 << 64;

/// What says where a sample lies: u and v, the probes' number and line (in 1/2^24 textures), and the
/// level of detail before the bias.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RealRequest {
    /// u and v.
    pub place: [f32; 2],
    /// Probes, at least one.
    pub probes: u8,
    /// See [`ntmu_isa::sampler::Footprint::line`].
    pub line: [i32; 2],
    /// The level of detail before the bias.
    pub lod: f64,
}

/// A texel and its weight in the sample of one probe.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Read {
    /// The mip.
    pub mip: u8,
    /// The texel; none is the border.
    pub texel: Option<(u32, u32)>,
    /// The weight, exactly; those of a probe add up to 1.
    pub weight: f64,
}

/// A sampler of one shape, in reals.
#[derive(Clone, Copy, Debug)]
pub struct RealSampler<'a> {
    sampler: &'a Sampler,
    shape: &'a Shape,
    profile: &'a Profile,
}

impl<'a> RealSampler<'a> {
    /// `sampler` before texture sets of `shape`, which it fits.
    #[must_use]
    pub fn new(sampler: &'a Sampler, shape: &'a Shape, profile: &'a Profile) -> RealSampler<'a> {
        RealSampler {
            sampler,
            shape,
            profile,
        }
    }

    /// Every texel that has a weight, probe by probe; one that is read twice is listed twice.
    #[must_use]
    pub fn reads(&self, request: &RealRequest) -> Vec<Read> {
        let mut reads = Vec::new();
        for probe in 0..request.probes {
            for (mip, share) in self.mips(request.lod) {
                let (width, height) = self.shape.mip_size(mip);
                let columns = self.texels(request, probe, 0, width);
                let rows = self.texels(request, probe, 1, height);
                for &(row, v) in &rows {
                    for &(column, u) in &columns {
                        reads.push(Read {
                            mip,
                            texel: column.zip(row),
                            weight: u * v * share,
                        });
                    }
                }
            }
        }
        reads.retain(|read| read.weight > 0.0);
        reads
    }

    /// The channels of a sample: integers in units of their codes, halves as their reals. `decode`
    /// gives the codes of a texel from its mip, column and row.
    #[must_use]
    pub fn sample(
        &self,
        request: &RealRequest,
        mut decode: impl FnMut(u8, u32, u32) -> Vec<i32>,
    ) -> Vec<f64> {
        let mut sums = vec![0.0; self.shape.outputs.len()];
        for read in self.reads(request) {
            let codes = match read.texel {
                Some((x, y)) => decode(read.mip, x, y),
                None => self.sampler.border.clone(),
            };
            for ((sum, code), format) in sums.iter_mut().zip(codes).zip(&self.shape.outputs) {
                *sum += read.weight * real(*format, code);
            }
        }
        let probes = f64::from(request.probes);
        sums.into_iter().map(|sum| sum / probes).collect()
    }

    /// 7.18.10 and 7.18.11: the mips and their weights.
    fn mips(&self, lod: f64) -> Vec<(u8, f64)> {
        let last = i64::from(self.shape.mip_count) - 1;
        let clamped = |mip: i64| mip.clamp(0, last) as u8;
        let biased = nonzero(lod) + f64::from(self.sampler.bias) / 256.0;
        let min_lod = f64::from(self.sampler.min_lod) / 256.0;
        let max_lod = f64::from(self.sampler.max_lod) / 256.0;
        let steps = 2_f64.powi(self.profile.lod_bits.into());
        let fixed = round_real(
            min_lod.max(max_lod.min(biased)) * steps,
            self.profile.coordinate,
        ) / steps;
        match self.sampler.mip_filter {
            MipFilter::Base => vec![(0, 1.0)],
            MipFilter::Point => vec![(clamped((fixed + 0.5).floor() as i64), 1.0)],
            MipFilter::Linear => {
                let floor = fixed.floor();
                let far = fixed - floor;
                let mip = floor as i64;
                vec![(clamped(mip), 1.0 - far), (clamped(mip + 1), far)]
            }
        }
    }

    /// 7.18.6 to 7.18.9: the texels of one axis and their weights; none is the border.
    fn texels(
        &self,
        request: &RealRequest,
        probe: u8,
        axis: usize,
        size: u32,
    ) -> Vec<(Option<u32>, f64)> {
        let mode = self.sampler.address[axis];
        // In 1/(2^64 · 2·probes): the probe is at (2·probe + 1 − probes)/(2·probes) of the line.
        let parts = 2 * i128::from(request.probes);
        let whole = ONE * parts;
        let odd = 2 * i128::from(probe) + 1 - i128::from(request.probes);
        let moved = coordinate(request.place[axis], mode) * parts
            + i128::from(request.line[axis]) * odd * (ONE >> 24);
        let scaled = reduce(moved, mode, whole) * i128::from(size);
        let one = 1_i128 << self.profile.subtexel_bits;
        let fixed = |texels: i128| round(texels, whole / one, self.profile.coordinate);
        let at = |texel: i128| {
            let moved = texel + i128::from(self.sampler.offset[axis]);
            address(moved, i128::from(size), mode).map(|texel| texel as u32)
        };
        match self.sampler.filter {
            Filter::Point => {
                let texel = match self.profile.point_snap {
                    PointSnap::Fixed => fixed(scaled).div_euclid(one),
                    PointSnap::Floor => scaled.div_euclid(whole),
                };
                vec![(at(texel), 1.0)]
            }
            Filter::Linear => {
                let place = fixed(scaled - whole / 2);
                let left = place.div_euclid(one);
                let weight = place.rem_euclid(one) as f64 / one as f64;
                vec![(at(left), 1.0 - weight), (at(left + 1), weight)]
            }
        }
    }
}

/// The real of a code: halves by what they mean, integers as they are.
#[must_use]
pub fn real(format: OutputFormat, code: i32) -> f64 {
    match format {
        OutputFormat::Unorm8 | OutputFormat::Unorm16 | OutputFormat::Snorm8 => f64::from(code),
        OutputFormat::Float16 => number::half(Half::from_bits(code as u16)),
    }
}

/// How far a code may lie from [`RealSampler::sample`], where the codes that are filtered span `range`
/// (both in the units of [`real`]), for a result near `result`.
///
/// A rounding moves a number by ½ or, by floor, less than 1 of a unit: of a code, or of the half's own
/// spacing at the end and 2^−24 before. A filter cannot enlarge what an earlier step did, since
/// its weights are at least 0 and add up to 1.
///
/// | rule | roundings | weights |
/// |---|---|---|
/// | exact | 1 | exact |
/// | factored | 1 | each of four is off by at most ½ of 2^−b, in pairs of opposite sign |
/// | separable | u, v, mips, probes | exact |
/// | all-ones | u, v, mips to the nearest, probes | off by less than 2^−b, 2^−b and 2^−l |
#[must_use]
pub fn bound(profile: &Profile, format: OutputFormat, range: f64, result: f64) -> f64 {
    let one_rounding = |rounding: Rounding| match rounding {
        Rounding::HalfUp | Rounding::HalfEven | Rounding::HalfAway => 0.5,
        Rounding::Floor => 1.0,
    };
    let step = one_rounding(profile.filter_rounding);
    let (last, unit) = match format {
        OutputFormat::Unorm8 | OutputFormat::Unorm16 | OutputFormat::Snorm8 => (step, 1.0),
        OutputFormat::Float16 => (0.5 * spacing(result), 2_f64.powi(-24)),
    };
    // Of halves the average of probes is rounded to 2^−24 by nobody: it goes straight to a half.
    let between = |steps: f64| steps * unit;
    let weight = 2_f64.powi(-i32::from(profile.subtexel_bits));
    let level = 2_f64.powi(-i32::from(profile.lod_bits));
    match profile.filter {
        FilterRule::Exact => last,
        FilterRule::Factored => last + range * weight,
        FilterRule::Separable => last + between(3.0 * step),
        FilterRule::AllOnes => last + between(3.0 * 0.5) + range * (2.0 * weight + level),
    }
}

/// The distance of halves at a real: 2^−24 for small ones, then 2^−10 of the power of two below.
fn spacing(real: f64) -> f64 {
    let magnitude = real.abs().max(2_f64.powi(-14));
    2_f64.powi(magnitude.log2().floor() as i32 - 10)
}

/// The number of probes and the level of detail of gradients, as intervals: gradients are rounded to
/// 2^−16 texels, so that a length is off by at most √2·2^−17, and the level is rounded down to 2^−16.
///
/// `size` is that of mip 0 in texels. Gradients are finite and at most 2^24 texels long, and the longer
/// one is longer than 2^−15 texels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RealFootprint {
    major: f64,
    minor: f64,
    max_anisotropy: f64,
}

/// How far a length may be off, √2·2^−17 (or twice that by floor), in texels.
const LENGTH_ERROR: f64 = std::f64::consts::SQRT_2 / 65_536.0;

impl RealFootprint {
    /// Of (du/dx, dv/dx) and (du/dy, dv/dy).
    #[must_use]
    pub fn of(x: [f32; 2], y: [f32; 2], size: [u32; 2], max_anisotropy: u8) -> RealFootprint {
        let length = |gradient: [f32; 2]| {
            let texels = [0, 1].map(|axis| f64::from(gradient[axis]) * f64::from(size[axis]));
            texels[0].hypot(texels[1])
        };
        let (x, y) = (length(x), length(y));
        RealFootprint {
            major: x.max(y),
            minor: x.min(y),
            max_anisotropy: max_anisotropy.into(),
        }
    }

    /// The smallest and the largest number of probes: ⌈major / minor⌉, limited.
    #[must_use]
    pub fn probes(&self) -> (f64, f64) {
        let probes = |major: f64, minor: f64| {
            let ratio = if minor > 0.0 {
                major / minor
            } else {
                f64::INFINITY
            };
            ratio.ceil().clamp(1.0, self.max_anisotropy)
        };
        let few = probes(self.major - LENGTH_ERROR, self.minor + LENGTH_ERROR);
        let many = probes(self.major + LENGTH_ERROR, self.minor - LENGTH_ERROR);
        (few, many)
    }

    /// The smallest and the largest level of detail, log2(major / probes), for that many probes.
    #[must_use]
    pub fn lod(&self, probes: u8) -> (f64, f64) {
        let lod = |major: f64| (major / f64::from(probes)).log2();
        // 2^−40 is what the bit-by-bit logarithm may lose, and f64 here.
        let low = lod(self.major - LENGTH_ERROR) - 2_f64.powi(-16) - 2_f64.powi(-40);
        (low, lod(self.major + LENGTH_ERROR) + 2_f64.powi(-40))
    }
}

/// A number that f64 and 2^−64 can hold beside others: what is nearer to 0 than 2^−40 lies on no tie
/// and is taken as ±2^−40.
fn nonzero(number: f64) -> f64 {
    if number.is_nan() {
        0.0
    } else if number != 0.0 && number.abs() < 2_f64.powi(-40) {
        2_f64.powi(-40).copysign(number)
    } else {
        number
    }
}

/// An f32 in 1/2^64, with NaN as 0 and repeats taken off where they do not fit.
fn coordinate(u: f32, mode: Address) -> i128 {
    let u = nonzero(f64::from(u));
    let limited = match mode {
        // From 2^24 every f32 is an even number of textures, a line has at most 128, and an infinity
        // lies where 0 does.
        Address::Wrap | Address::Mirror if u.abs() >= 16_777_216.0 => 1024_f64.copysign(u),
        Address::Wrap | Address::Mirror => u,
        // Farther out than any line leads back.
        Address::MirrorOnce | Address::Clamp | Address::Border => u.clamp(-1e6, 1e6),
    };
    (limited * ONE as f64) as i128
}

/// 7.18.6, on a number in 1/`whole`.
fn reduce(u: i128, mode: Address, whole: i128) -> i128 {
    match mode {
        Address::Wrap => u - u.div_euclid(whole) * whole,
        // signedFrac(U/2)·2: the remainder keeps the sign.
        Address::Mirror => u - u / (2 * whole) * (2 * whole),
        Address::MirrorOnce | Address::Clamp | Address::Border => {
            u.max(-10 * whole).min(10 * whole)
        }
    }
}

/// 7.18.9, by walking: a step of a whole texture or a reflection at a time.
fn address(texel: i128, size: i128, mode: Address) -> Option<i128> {
    let mut texel = texel;
    while texel < 0 || texel >= size {
        texel = match mode {
            Address::Wrap if texel < 0 => texel + size,
            Address::Wrap => texel - size,
            Address::Mirror | Address::MirrorOnce if texel < 0 => -1 - texel,
            Address::Mirror => 2 * size - 1 - texel,
            Address::Clamp if texel < 0 => 0,
            Address::Clamp | Address::MirrorOnce => size - 1,
            Address::Border => return None,
        };
    }
    Some(texel)
}

/// `numerator / denominator` to an integer, by comparing what is left on both sides.
fn round(numerator: i128, denominator: i128, rounding: Rounding) -> i128 {
    let below = numerator.div_euclid(denominator);
    let left = numerator - below * denominator;
    let right = denominator - left;
    let up = match rounding {
        Rounding::Floor => false,
        Rounding::HalfUp => left >= right,
        Rounding::HalfEven => left > right || (left == right && below % 2 != 0),
        Rounding::HalfAway => left > right || (left == right && numerator > 0),
    };
    if up { below + 1 } else { below }
}

fn round_real(number: f64, rounding: Rounding) -> f64 {
    match rounding {
        Rounding::Floor => number.floor(),
        Rounding::HalfUp => (number + 0.5).floor(),
        Rounding::HalfEven => number.round_ties_even(),
        Rounding::HalfAway => number.round(),
    }
}

#[cfg(test)]
mod tests;
