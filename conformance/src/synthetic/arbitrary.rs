//! Specs that cover every choice, from a seed.

use super::random::Random;
use super::spec::{Spec, SpecActivation, SpecKind, SpecScale, corners};
use ntmu_isa::accumulate::{Accumulator, Overflow};
use ntmu_isa::embed::Wave;
use ntmu_isa::filter::FilterRule;
use ntmu_isa::half::SumOrder;
use ntmu_isa::position::{AddressMode, CornerSnap};
use ntmu_isa::profile::{PointSnap, Profile};
use ntmu_isa::pyramid::Pyramid;
use ntmu_isa::rescale::Requantizer;
use ntmu_isa::round::Rounding;
use ntmu_isa::shape::{GridShape, OutputFormat, Sampling, Shape};

/// Sizes at and around the edges that a grid of 1/8, 1/4 or 1/2 has, and some that are no power of
/// two.
const SIZES: [u32; 18] = [
    1, 2, 3, 4, 5, 7, 8, 9, 12, 15, 16, 17, 24, 31, 33, 40, 64, 100,
];

/// A spec from a seed. Small enough to decode whole; over some hundred seeds every value of every
/// enumeration, every width of a latent, weight, lane and accumulator, integer, fp16 and mixed
/// synthesizers, and every edge size occur.
///
/// About half of the seeds have accumulators of 32 bits and unlimited biases and skip terms.
#[must_use]
pub fn arbitrary_spec(seed: u64) -> Spec {
    let mut random = Random::new(seed);
    let r = &mut random;
    let layers = r.within(0, 3);
    Spec {
        shape: shape(r, seed),
        profile: profile(r),
        kinds: kinds(r),
        hidden: (0..layers).map(|_| r.within(1, 17) as u16).collect(),
        blocks: r.within(0, 3) as u8,
        block_span: r.within(1, 3) as u8,
        has_plain_block_ends: false,
        activation: match r.within(0, 5) {
            0 => SpecActivation::Identity,
            1 => SpecActivation::Relu,
            2 => SpecActivation::Leaky(r.within(1, 7) as u8),
            3 => SpecActivation::HardGelu,
            4 => SpecActivation::ClampedGelu,
            _ => SpecActivation::Table,
        },
        scale: r.choose(&[
            SpecScale::Arbitrary,
            SpecScale::PowerOfTwo,
            SpecScale::BelowTies,
        ]),
        reach: match r.within(0, 3) {
            0 => r.within(-12, 15) as i8,
            _ => r.within(-1, 2) as i8,
        },
    }
}

fn shape(r: &mut Random, seed: u64) -> Shape {
    let (width, height) = (r.choose(&SIZES), r.choose(&SIZES));
    let longest = i32::from(Shape::max_mip_count(width, height));
    let mip_count = if r.within(0, 3) == 0 {
        r.within(1, longest)
    } else {
        longest
    };
    let mut grid = |most: i32| {
        let (channels, bits) = (r.within(1, most), r.within(1, 8));
        GridShape {
            sampling: r.choose(&Sampling::ALL),
            ..corners(channels as u16, bits as u8, r.within(1, 3) as u8)
        }
    };
    let grids = [grid(6), grid(8)];
    let channels = r.within(1, 9);
    let pyramid = pyramid(seed);
    Shape {
        width,
        height,
        mip_count: mip_count as u8,
        octaves: r.within(0, 3) as u8,
        wave: r.choose(&Wave::ALL),
        padding: if r.within(0, 2) == 0 {
            r.within(1, 15) as u8
        } else {
            0
        },
        input_bits: usual_or(r, 8, 4, 16),
        snap: r.choose(&CornerSnap::ALL),
        address_mode: r.choose(&AddressMode::ALL),
        pyramid,
        grids,
        outputs: (0..channels)
            .map(|_| r.choose(&OutputFormat::ALL))
            .collect(),
    }
}

/// Every second time a single level, else any pyramid whose second level the longest chain reaches.
/// From numbers of its own, so that what else a seed stands for does not depend on it.
fn pyramid(seed: u64) -> Pyramid {
    let mut random = Random::new(seed ^ 0x7079_7261);
    let first = random.within(1, 6);
    let each = random.within(1, first);
    let several = Pyramid::new(first as u8, each as u8).unwrap_or(Pyramid::SINGLE);
    random.choose(&[Pyramid::SINGLE, several])
}

fn profile(r: &mut Random) -> Profile {
    let is_narrow = r.within(0, 1) == 1;
    let mut width = |low, high| {
        if is_narrow {
            usual_or(r, 32, low, high)
        } else {
            32
        }
    };
    let (bits, bias_bits, residual_bits) = (width(16, 32), width(8, 32), width(8, 32));
    Profile {
        subtexel_bits: usual_or(r, 8, 4, 12),
        lod_bits: usual_or(r, 8, 4, 8),
        coordinate: r.choose(&Rounding::ALL),
        point_snap: r.choose(&PointSnap::ALL),
        filter: r.choose(&FilterRule::ALL),
        filter_rounding: r.choose(&Rounding::ALL),
        interpolate: r.choose(&FilterRule::ALL),
        input: r.choose(&Rounding::ALL),
        accumulator: Accumulator {
            bits,
            overflow: r.choose(&Overflow::ALL),
        },
        bias_bits,
        leak: r.choose(&Rounding::ALL),
        requantize: r.choose(&Requantizer::ALL),
        skip: r.choose(&Requantizer::ALL),
        residual_bits,
        output: r.choose(&Requantizer::ALL),
        sum: r.choose(&SumOrder::ALL),
        convert: r.choose(&Rounding::ALL),
    }
}

/// Every second time what is usual, else anything in the range.
fn usual_or(r: &mut Random, usual: u8, low: u8, high: u8) -> u8 {
    if r.within(0, 1) == 0 {
        usual
    } else {
        r.within(i32::from(low), i32::from(high)) as u8
    }
}

/// Integers of one kind, of several, fp16 alone, and anything in turns.
fn kinds(r: &mut Random) -> Vec<SpecKind> {
    let integer = |r: &mut Random| SpecKind::Integer {
        weight_bits: r.within(2, 8) as u8,
        output_bits: usual_or(r, 8, 4, 16),
    };
    let half = |r: &mut Random| SpecKind::Half {
        quantize: (r.within(0, 2) == 0).then(|| r.within(4, 16) as u8),
    };
    let count = r.within(2, 4);
    match r.within(0, 3) {
        0 => vec![integer(r)],
        1 => (0..count).map(|_| integer(r)).collect(),
        2 => vec![half(r)],
        _ => (0..count)
            .map(|_| {
                if r.within(0, 1) == 0 {
                    integer(r)
                } else {
                    half(r)
                }
            })
            .collect(),
    }
}
