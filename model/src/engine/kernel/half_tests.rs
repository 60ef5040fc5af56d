//! fp16 layers against a rounding that knows integers only and an order that is spelled out.

use super::*;
use ntmu_isa::half::{Half, SumOrder, activation, to_integer};
use ntmu_isa::layer::integer_as_half;
use ntmu_isa::round::{Rounding, saturate};

/// The nearest fp16, by integers: the value as multiples of 2^−24, ties to even, at most 65504.
fn round_by_integers(x: f32) -> f32 {
    let bits = x.to_bits();
    let (sign, exponent) = (bits >> 31, (bits >> 23 & 255) as i32);
    let significand = u128::from(bits & 0x7f_ffff | if exponent > 0 { 1 << 23 } else { 0 });
    // |x| = significand · 2^(scale − 149); held in units of 2^−149, cut at 2^20.
    let scale = exponent.max(1) - 1;
    let sign = if sign == 1 { -1.0 } else { 1.0 };
    if scale > 149 - 23 + 20 {
        return sign * LARGEST_HALF;
    }
    // A tiny number is far below half of the smallest step.
    let wide = if scale < 60 {
        u128::from(significand > 0)
    } else {
        significand << (scale - 60)
    };
    // `wide` counts 2^−89; one step of fp16 is 2^(top − 10) with top at least −14.
    let top = (127 - wide.leading_zeros() as i32).max(89 - 14);
    let step = 1_u128 << (top - 10);
    let (below, rest) = (wide / step, wide % step);
    let up = 2 * rest > step || (2 * rest == step && below % 2 == 1);
    let steps = below + u128::from(up);
    let nearest = steps as f64 * power_of_two(top - 10 - 89);
    sign * nearest.min(65_504.0) as f32
}

/// Exactly, which `powi` does not promise.
fn power_of_two(exponent: i32) -> f64 {
    f64::from_bits(((1023 + exponent) as u64) << 52)
}

/// Every fp16 that is not a NaN or infinite, not negative, in ascending order.
fn halves() -> impl Iterator<Item = f32> {
    (0..0x7c00_u32).map(|code| {
        let (exponent, fraction) = (code >> 10, code & 1023);
        if exponent == 0 {
            fraction as f32 * power_of_two(-24) as f32
        } else {
            (1024 + fraction) as f32 * power_of_two(exponent as i32 - 25) as f32
        }
    })
}

fn assert_rounds(x: f32) {
    for x in [x, -x] {
        let (found, expected) = (round_to_half(x), round_by_integers(x));
        assert_eq!(
            found.to_bits(),
            expected.to_bits(),
            "{x:e} {:#x}",
            x.to_bits()
        );
    }
}

#[test]
fn rounding_is_the_nearest_half_at_around_and_between_all_halves() {
    let every = if cfg!(miri) { 511 } else { 1 };
    let all: Vec<f32> = halves().step_by(every).collect();
    for pair in all.windows(2) {
        let middle = (pair[0] + pair[1]) / 2.0;
        for x in [pair[0], middle] {
            for bits in x.to_bits().saturating_sub(2)..=x.to_bits() + 2 {
                assert_rounds(f32::from_bits(bits));
            }
        }
    }
    for x in [
        65_504.0,
        65_519.996,
        65_520.0,
        65_536.0,
        1e6,
        131_072.0,
        1e30,
        f32::MAX,
    ] {
        assert_rounds(x);
    }
    for bits in [
        0,
        1,
        0x7f_ffff,
        0x80_0000,
        0x3300_0000,
        0x3300_0001,
        0x32ff_ffff,
    ] {
        assert_rounds(f32::from_bits(bits));
    }
}

#[test]
fn a_half_rounds_to_itself() {
    let every = if cfg!(miri) { 97 } else { 1 };
    for half in halves().step_by(every) {
        assert_eq!(round_to_half(half).to_bits(), half.to_bits());
        assert_eq!(round_to_half(-half).to_bits(), (-half).to_bits());
    }
}

#[test]
fn rounding_is_the_nearest_half_on_a_dense_set() {
    let step = if cfg!(miri) { 9_999_991 } else { 997 };
    for bits in (0..0x7f80_0000_u32).step_by(step) {
        assert_rounds(f32::from_bits(bits));
    }
}

#[test]
fn every_set_computes_fp16_layers_in_the_specified_order() {
    let all: Vec<f32> = halves().collect();
    let mut state = 1_u64;
    // Any fp16 of magnitude up to 2^4, so that sums neither vanish nor all saturate.
    let mut any = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        let half = all[(state >> 33) as usize % 0x4c00];
        if state >> 32 & 1 == 1 { -half } else { half }
    };
    let shapes: &[(usize, usize)] = if cfg!(miri) {
        &[(5, 3)]
    } else {
        &[(1, 1), (5, 3), (8, 64), (64, 64), (67, 131)]
    };
    for &(rows, inputs) in shapes {
        let weights: Vec<f32> = (0..rows * inputs).map(|_| any()).collect();
        let bias: Vec<f32> = (0..rows).map(|_| any()).collect();
        let input: Vec<Halves> = (0..inputs)
            .map(|_| Halves(std::array::from_fn(|_| any())))
            .collect();
        let source: Vec<Halves> = (0..rows)
            .map(|_| Halves(std::array::from_fn(|_| any())))
            .collect();
        let half = |x: f32| Half::round(x);
        for (order, specified) in [
            (HalfOrder::Sequential, SumOrder::Sequential),
            (HalfOrder::Tree4, SumOrder::Tree4),
            (HalfOrder::Tree8, SumOrder::Tree8),
        ] {
            let layer = DenseHalf::new(&weights, inputs, &bias, order);
            let sum = |row: usize, texel: usize| {
                let weights = &weights[row * inputs..][..inputs];
                let weights: Vec<Half> = weights.iter().map(|&w| half(w)).collect();
                let input: Vec<Half> = input.iter().map(|lane| half(lane.0[texel])).collect();
                specified.dot(half(bias[row]), &weights, &input)
            };
            let mut expected = vec![Halves::ZERO; rows];
            for (row, sums) in expected.iter_mut().enumerate() {
                sums.0 = std::array::from_fn(|texel| sum(row, texel));
            }
            for kernels in Path::available().into_iter().filter_map(Kernels::new) {
                let mut sums = vec![Halves::ZERO; rows];
                kernels.half_sums(&layer, &input, &mut sums);
                assert_bits(&sums, &expected, &format!("{kernels:?} {order:?}"));
                for (step, of) in steps() {
                    for source in [None, Some(source.as_slice())] {
                        for is_rounded in [false, true] {
                            let mut found = sums.clone();
                            kernels.half_finish(step, source, is_rounded, &mut found);
                            let finished = |row: usize, texel: usize| {
                                let x = of(sums[row].0[texel]);
                                let x = source.map_or(x, |source| x + source[row].0[texel]);
                                if is_rounded { half(x).to_f32() } else { x }
                            };
                            let mut expected = vec![Halves::ZERO; rows];
                            for (row, lanes) in expected.iter_mut().enumerate() {
                                lanes.0 = std::array::from_fn(|texel| finished(row, texel));
                            }
                            assert_bits(&found, &expected, &format!("{kernels:?} {step:?}"));
                        }
                    }
                }
            }
        }
    }
}

fn assert_bits(found: &[Halves], expected: &[Halves], what: &str) {
    for (row, (found, expected)) in found.iter().zip(expected).enumerate() {
        let bits = |halves: &Halves| halves.0.map(f32::to_bits);
        assert_eq!(bits(found), bits(expected), "{what} row {row}");
    }
}

type Definition = fn(f32) -> f32;

/// Every step and its specification.
fn steps() -> [(HalfStep, Definition); 5] {
    [
        (HalfStep::Identity, |x| x),
        (HalfStep::Relu, activation::relu),
        (HalfStep::Leaky { slope: 0.125 }, |x| {
            activation::leaky(x, 3)
        }),
        (
            HalfStep::Gate {
                limit: f32::INFINITY,
            },
            |x| activation::hard_gelu(x, false),
        ),
        (HalfStep::Gate { limit: 3.0 }, |x| {
            activation::hard_gelu(x, true)
        }),
    ]
}

#[test]
fn every_set_turns_sums_into_the_specified_integers() {
    let mut sums: Vec<f32> = (-70_000..70_000).map(|n| n as f32 / 8.0).collect();
    let tiny = [
        0.0,
        f32::MIN_POSITIVE,
        1e-40,
        0.5_f32.next_down(),
        0.5_f32.next_up(),
    ];
    let huge = [1e9, 2.5e9, 8e12, f32::MAX];
    sums.extend(tiny.into_iter().chain(huge).flat_map(|x| [x, -x]));
    sums.resize(sums.len().next_multiple_of(TILE), 0.0);
    let step = if cfg!(miri) { 211 } else { 1 };
    let tiles: Vec<Halves> = sums
        .as_chunks()
        .0
        .iter()
        .step_by(step)
        .map(|&t| Halves(t))
        .collect();
    for (exponent, factor) in [
        (-16, 1_u16),
        (-1, 1),
        (0, 1),
        (0, 255),
        (0, 65_535),
        (7, 1),
        (24, 1),
    ] {
        let rule = HalfToInteger {
            factor: power_of_two(exponent) * f64::from(factor),
            offset: -7,
            low: -32_768,
            high: 65_535,
        };
        for kernels in Path::available().into_iter().filter_map(Kernels::new) {
            for tile in &tiles {
                let mut found = Sums::ZERO;
                kernels.half_integers(rule, tile, &mut found);
                let expected = tile.0.map(|sum| {
                    let value = to_integer(sum, factor, exponent, Rounding::HalfEven);
                    saturate(value - 7, -32_768, 65_535)
                });
                assert_eq!(found.0, expected, "{kernels:?} {rule:?}");
            }
        }
    }
}

#[test]
fn every_set_reads_every_integer_as_the_specified_half() {
    let step = if cfg!(miri) { 509 } else { 1 };
    let words: Vec<[i16; TILE]> = (i16::MIN..=i16::MAX)
        .collect::<Vec<i16>>()
        .as_chunks()
        .0
        .iter()
        .copied()
        .step_by(step)
        .collect();
    for (bits, zero) in [(16, 0), (16, -32_768), (16, 32_767), (9, 100), (12, -5)] {
        for kernels in Path::available().into_iter().filter_map(Kernels::new) {
            for values in &words {
                let pairs = [Pair(values.map(|value| [value, 0]))];
                let mut found = [Halves::ZERO];
                let factor = 1.0 / (1_u32 << (bits - 1)) as f32;
                kernels.half_inputs(Integers::Pairs(&pairs), i32::from(zero), factor, &mut found);
                let expected = values.map(|value| integer_as_half(value, bits, zero).to_f32());
                assert_eq!(found[0].0.map(f32::to_bits), expected.map(f32::to_bits));
            }
        }
    }
    let bytes: [[u8; 4]; TILE] = std::array::from_fn(|at| [0, 1, 2, 3].map(|k| (4 * at + k) as u8));
    for kernels in Path::available().into_iter().filter_map(Kernels::new) {
        let mut found = [Halves::ZERO; 4];
        kernels.half_inputs(Integers::Quads(&[Quad(bytes)]), -3, 0.125, &mut found);
        for (lane, halves) in found.iter().enumerate() {
            let expected =
                bytes.map(|texel| integer_as_half(i16::from(texel[lane]) - 128, 4, -3).to_f32());
            assert_eq!(halves.0, expected, "{kernels:?}");
        }
    }
}

#[test]
fn every_set_rounds_every_neighbourhood_of_a_half_like_the_integers() {
    let every = if cfg!(miri) { 2039 } else { 1 };
    let all: Vec<f32> = halves()
        .step_by(every)
        .chain([65_520.0, 1e9, f32::MAX])
        .collect();
    let mut near: Vec<f32> = all
        .windows(2)
        .flat_map(|pair| {
            let middle = (pair[0] / 2.0 + pair[1] / 2.0).to_bits();
            [
                pair[0].to_bits(),
                middle - middle.min(1),
                middle,
                middle + 1,
            ]
            .map(f32::from_bits)
        })
        .flat_map(|x| [x, -x])
        .collect();
    near.resize(near.len().next_multiple_of(TILE), 0.0);
    for kernels in Path::available().into_iter().filter_map(Kernels::new) {
        for tile in near.as_chunks::<TILE>().0 {
            let mut found = [Halves(*tile)];
            kernels.half_finish(HalfStep::Identity, None, true, &mut found);
            let expected = tile.map(|x| round_by_integers(x).to_bits());
            assert_eq!(found[0].0.map(f32::to_bits), expected, "{kernels:?}");
        }
    }
}
