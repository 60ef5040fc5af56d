//! Sampling: a long stream estimated from segments of it.
//!
//! As in SMARTS (Wunderlich et al. 2003, *SMARTS: Accelerating Microarchitecture Simulation via
//! Rigorous Statistical Sampling*, ISCA), a segment is a run of its own: a warm-up that fills caches and
//! queues, and then what is measured. Caches are cold before the warm-up; whether it was long enough
//! is checked with a longer one on a few segments. How segments are drawn and what the interval means
//! is in [`super::estimate`].
//!
//! Cycles are those between the last pixel of the warm-up and the last of all. Everything else is the
//! difference of two runs, one of the warm-up with what is measured and one of the warm-up alone.

use super::bracket::{self, Brackets};
use super::counts::Counts;
use super::estimate::{self, Estimate, LEAST_PAIRS};
use super::source::{Replay, Source};
use super::summary::Summary;
use crate::access::AccessError;
use crate::model::stream::random_bits;
use crate::model::time::report::BLOCK_PIXELS;
use crate::model::time::{self, Unit};
use crate::model::{Demand, Material};
use serde::Serialize;
use std::ops::Range;
use std::str::FromStr;

/// Segments of a sample.
const SEGMENTS: u64 = 128;

/// Pixels of the longest stream that is run whole unasked.
pub const WHOLE_PIXELS: u64 = 1 << 21;

/// Pixels that a sample measures unasked, of a longer stream.
pub const MEASURED_PIXELS: u64 = 1 << 19;

/// Pixels in front of each segment unasked.
pub const WARM_UP_PIXELS: u64 = 1 << 13;

/// Segments on which a longer warm-up is tried, and how many times as long it is.
const CHECKED: usize = 8;
const LONGER: u64 = 4;

/// How much of a stream is run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sampling {
    /// All of it up to [`WHOLE_PIXELS`], else about [`MEASURED_PIXELS`].
    Auto,
    /// This share of it is measured, above 0 and at most 1.
    Share(f64),
    /// All of it.
    Off,
}

impl FromStr for Sampling {
    type Err = String;

    fn from_str(text: &str) -> Result<Sampling, String> {
        match text {
            "auto" => Ok(Sampling::Auto),
            "off" => Ok(Sampling::Off),
            share => match share.parse() {
                Ok(share) if share > 0.0 && share <= 1.0 => Ok(Sampling::Share(share)),
                Ok(_) | Err(_) => Err(format!(
                    "found `{text}`; allowed: auto, off, or a share above 0 and at most 1"
                )),
            },
        }
    }
}

/// A segment, in pieces of the stream.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Segment {
    /// What only warms up; empty where the stream begins.
    pub warm_up: Range<u64>,
    /// What is measured, right behind it.
    pub measured: Range<u64>,
}

impl Segment {
    fn with_warm_up(measured: Range<u64>, pieces: u64) -> Segment {
        Segment {
            warm_up: measured.start.saturating_sub(pieces)..measured.start,
            measured,
        }
    }
}

/// Which segments of a stream are run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Plan {
    /// In the order of the stream, one in each of as many strata of equal length.
    pub segments: Vec<Segment>,
    /// Pieces of the whole stream.
    pub pieces: u64,
    /// Pieces of a warm-up.
    pub warm_up_pieces: u64,
    /// Same seed, same segments.
    pub seed: u32,
}

impl Plan {
    /// The segments for a stream; `None` if all of it is to be run, because that was asked for, or it
    /// is short, or has too few pieces for a sample.
    #[must_use]
    pub fn new(
        source: &Source<'_>,
        sampling: Sampling,
        warm_up_pixels: u64,
        seed: u32,
    ) -> Option<Plan> {
        let (pieces, pixels) = (source.pieces(), source.most_pixels());
        let share = match sampling {
            Sampling::Off => return None,
            Sampling::Auto if pixels <= WHOLE_PIXELS => return None,
            Sampling::Auto => MEASURED_PIXELS as f64 / pixels as f64,
            Sampling::Share(share) => share,
        };
        let measured = (share * pieces as f64).ceil() as u64;
        let count = SEGMENTS.min(measured).min(pieces / 2);
        if measured >= pieces || count < 2 * LEAST_PAIRS as u64 {
            return None;
        }
        let warm_up_pieces = (warm_up_pixels * pieces).div_ceil(pixels.max(1));
        let length = measured.div_ceil(count);
        let stratum =
            |index: u64| (u128::from(index) * u128::from(pieces) / u128::from(count)) as u64;
        let segments = (0..count).map(|index| {
            let (low, high) = (stratum(index), stratum(index + 1));
            let length = length.min(high - low);
            let places = high - low - length + 1;
            let drawn = random_bits([index as u32, seed]);
            let start = low + ((u128::from(drawn) * u128::from(places)) >> 64) as u64;
            Segment::with_warm_up(start..start + length, warm_up_pieces)
        });
        Some(Plan {
            segments: segments.collect(),
            pieces,
            warm_up_pieces,
            seed,
        })
    }

    /// The share of the stream that is measured, 0 to 1.
    #[must_use]
    pub fn share(&self) -> f64 {
        let measured = self
            .segments
            .iter()
            .map(|segment| pieces(&segment.measured));
        measured.sum::<u64>() as f64 / self.pieces as f64
    }
}

fn pieces(range: &Range<u64>) -> u64 {
    range.end - range.start
}

/// What an estimate rests on, and how far it may be off.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Sample {
    /// How it was made.
    pub method: &'static str,
    /// Segments, one drawn in each of as many strata.
    pub segments: usize,
    /// Same seed, same segments.
    pub seed: u32,
    /// The share of the stream that was measured, 0 to 1.
    pub measured_share: f64,
    /// Pixels that were measured.
    pub measured_pixels: u64,
    /// Pixels of the warm-ups.
    pub warm_up_pixels: u64,
    /// The share of intervals that hold the truth, 0 to 1.
    pub confidence: f64,
    /// Cycles per block.
    pub cycles_per_block: Estimate,
    /// Bytes of latents from memory, per block. At most that: a line that only a part before the
    /// warm-up asked for comes again in each segment.
    pub latent_bytes_per_block: Estimate,
    /// Decodes per pixel.
    pub decodes_per_pixel: Estimate,
    /// Pixels of the whole stream.
    pub stream_pixels: f64,
    /// Cycles of the whole stream.
    pub stream_cycles: f64,
    /// What a longer warm-up changes.
    pub warm_up_check: Option<WarmUpCheck>,
}

/// A few segments with a longer warm-up: the bias that no interval shows.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct WarmUpCheck {
    /// Segments that were tried.
    pub segments: usize,
    /// How many times as long the warm-up was.
    pub times_as_long: u64,
    /// Cycles with it over cycles without it, minus 1, in percent.
    pub cycles_change_percent: f64,
    /// The same for the bytes of latents from memory.
    pub latent_bytes_change_percent: f64,
}

/// An estimate of a run.
#[derive(Debug)]
pub struct Estimated {
    /// What the segments did, added up.
    pub counts: Counts,
    /// What the estimate rests on.
    pub sample: Sample,
    /// The brackets, from the same segments.
    pub brackets: Option<Brackets>,
}

/// Why there is no estimate.
#[derive(Debug, thiserror::Error)]
pub enum SamplingError {
    /// The trace file cannot be read any more.
    #[error(transparent)]
    File(#[from] AccessError),
    /// The segments saw nothing.
    #[error("sample: found no pixel in {segments} segments; allowed: a larger share, or off")]
    Nothing {
        /// Segments.
        segments: usize,
    },
}

/// Estimates the run of a source from the segments of a plan; with its brackets if they are wanted.
/// `tell` is called with the segments done since it was called last.
///
/// # Errors
/// When the file cannot be read any more, or the segments ask for nothing.
pub fn estimate(
    unit: &Unit,
    materials: &[Material<'_>],
    source: &Source<'_>,
    plan: &Plan,
    with_brackets: bool,
    tell: &(dyn Fn(u64) + Sync),
) -> Result<Estimated, SamplingError> {
    let others = bracket::units(unit);
    let mut units = vec![unit];
    if with_brackets {
        units.extend(&others);
    }
    let parts = run(&units, materials, source, &plan.segments, tell)?;
    let sums: Vec<Counts> = (0..units.len())
        .map(|unit| sum(parts.iter().map(|part| &part.counts[unit])))
        .collect();
    let pairs = |y: fn(&Counts) -> u64, x: fn(&Counts) -> u64, scale: f64| {
        let pair = |part: &Part| {
            let counts = &part.counts[0];
            (x(counts) as f64 / scale, y(counts) as f64)
        };
        let pairs: Vec<(f64, f64)> = parts.iter().map(pair).collect();
        estimate::ratio(&pairs, plan.share()).ok_or(SamplingError::Nothing {
            segments: plan.segments.len(),
        })
    };
    let block = BLOCK_PIXELS as f64;
    let cycles_per_block = pairs(|c| c.cycles, |c| c.timed_pixels, block)?;
    let stream_pixels = sums[0].pixels as f64 / plan.share();
    let sample = Sample {
        method: "stratified random segments, each behind a warm-up from cold caches (after SMARTS, \
                 Wunderlich et al. 2003); ratio estimate, strata collapsed in pairs (Cochran 1977), \
                 Student's t",
        segments: plan.segments.len(),
        seed: plan.seed,
        measured_share: plan.share(),
        measured_pixels: sums[0].pixels,
        warm_up_pixels: parts.iter().map(|part| part.warm_up_pixels).sum(),
        confidence: estimate::CONFIDENCE,
        cycles_per_block,
        latent_bytes_per_block: pairs(|c| c.latent_bytes, |c| c.pixels, block)?,
        decodes_per_pixel: pairs(|c| c.decodes, |c| c.pixels, 1.0)?,
        stream_pixels,
        stream_cycles: stream_pixels / block * cycles_per_block.mean,
        warm_up_check: check(unit, materials, source, plan, &parts, tell)?,
    };
    let brackets = with_brackets.then(|| Brackets {
        no_cache: Summary::of_parts(&sums[1], &others[0]),
        infinite_cache: Summary::of_parts(&sums[2], &others[1]),
    });
    Ok(Estimated {
        counts: sums[0],
        sample,
        brackets,
    })
}

/// Steps in which [`estimate()`] tells of its progress.
#[must_use]
pub fn steps(plan: &Plan) -> u64 {
    (plan.segments.len() + checked(plan).len()) as u64
}

/// A segment after its runs.
struct Part {
    /// What was measured on each unit.
    counts: Vec<Counts>,
    warm_up_pixels: u64,
}

fn sum<'c>(parts: impl Iterator<Item = &'c Counts>) -> Counts {
    let mut sum = Counts::default();
    for part in parts {
        sum += part;
    }
    sum
}

fn run(
    units: &[&Unit],
    materials: &[Material<'_>],
    source: &Source<'_>,
    segments: &[Segment],
    tell: &(dyn Fn(u64) + Sync),
) -> Result<Vec<Part>, AccessError> {
    let warm_ups: Vec<Range<u64>> = segments.iter().map(|s| s.warm_up.clone()).collect();
    // How many demands a warm-up has is known when they are made: a scene's sky has none.
    let warm_up_pixels = source.parts(&warm_ups, |_, demands| demands.len())?;
    let ranges: Vec<Range<u64>> = segments
        .iter()
        .map(|segment| segment.warm_up.start..segment.measured.end)
        .collect();
    source.parts(&ranges, |index, demands| {
        let warm_up = warm_up_pixels[index];
        let counts = units
            .iter()
            .map(|unit| measure(unit, materials, demands, warm_up));
        let part = Part {
            counts: counts.collect(),
            warm_up_pixels: warm_up as u64,
        };
        tell(1);
        part
    })
}

/// What a unit does for the demands behind the first `warm_up`.
fn measure(unit: &Unit, materials: &[Material<'_>], demands: &[Demand], warm_up: usize) -> Counts {
    if warm_up == demands.len() {
        return Counts::default();
    }
    let behind = warm_up as u64;
    let Ok(all) = time::simulate_behind(unit, materials, &mut Replay::new(demands), behind);
    let counts = Counts::of(&all, unit);
    if warm_up == 0 {
        return counts;
    }
    let before = &mut Replay::new(&demands[..warm_up]);
    let Ok(before) = time::simulate(unit, materials, before, &mut ());
    counts
        .beyond(&Counts::of(&before, unit))
        .behind_warm_up(&all)
}

/// The segments on which a longer warm-up is tried: some with a whole warm-up, evenly spread.
fn checked(plan: &Plan) -> Vec<usize> {
    let longer = plan.warm_up_pieces * LONGER;
    let whole: Vec<usize> = (0..plan.segments.len())
        .filter(|&index| plan.segments[index].measured.start >= longer)
        .collect();
    let count = CHECKED.min(whole.len());
    if plan.warm_up_pieces == 0 {
        return Vec::new();
    }
    (0..count)
        .map(|n| whole[(2 * n + 1) * whole.len() / (2 * count)])
        .collect()
}

fn check(
    unit: &Unit,
    materials: &[Material<'_>],
    source: &Source<'_>,
    plan: &Plan,
    parts: &[Part],
    tell: &(dyn Fn(u64) + Sync),
) -> Result<Option<WarmUpCheck>, AccessError> {
    let chosen = checked(plan);
    let longer: Vec<Segment> = chosen
        .iter()
        .map(|&index| plan.segments[index].measured.clone())
        .map(|measured| Segment::with_warm_up(measured, plan.warm_up_pieces * LONGER))
        .collect();
    let after = run(&[unit], materials, source, &longer, tell)?;
    let before = sum(chosen.iter().map(|&index| &parts[index].counts[0]));
    let after = sum(after.iter().map(|part| &part.counts[0]));
    if before.timed_pixels == 0 || after.timed_pixels == 0 {
        return Ok(None);
    }
    let change = |of: fn(&Counts) -> f64| match (of(&before), of(&after)) {
        (before, after) if before > 0.0 => 100.0 * (after / before - 1.0),
        (_, _) => 0.0,
    };
    Ok(Some(WarmUpCheck {
        segments: chosen.len(),
        times_as_long: LONGER,
        cycles_change_percent: change(|c| c.cycles as f64 / c.timed_pixels as f64),
        latent_bytes_change_percent: change(|c| c.latent_bytes as f64 / c.pixels as f64),
    }))
}
