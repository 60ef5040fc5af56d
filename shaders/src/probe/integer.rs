//! Probes of integer layers: rounding, requantisers, accumulators, activations.

use super::{Case, Random, compare, rounding};
use ntmu_isa::accumulate::{Accumulator, Overflow, signed_range};
use ntmu_isa::activation::{GATE_RANGE, gate, gate_argument, leak, table_index};
use ntmu_isa::rescale::{Multiplier, Requantizer};
use ntmu_isa::round::saturate;

fn requantizer(code: u32) -> Requantizer {
    Requantizer::from_code(code as u8).unwrap()
}

fn multiplier(mantissa: u32, shift: u32) -> Multiplier {
    Multiplier::new(mantissa as i32, shift as u8).unwrap()
}

#[test]
fn round_agrees_on_small_values_on_ties_and_on_two_million_others() {
    let mut values: Vec<(i64, u32)> = Vec::new();
    for shift in 0..=10 {
        values.extend((-3000..=3000).map(|value| (value, shift)));
    }
    for shift in 1..=62_u32 {
        let half = 1_i64 << (shift - 1);
        let largest = 1_i64 << (62 - shift);
        for odd in [0, 1, 2, 3, largest - 2, largest - 1] {
            let tie = half + (odd << shift);
            for value in [tie - 1, tie, tie + 1, -tie - 1, -tie, -tie + 1] {
                if value.abs() <= 1 << 62 {
                    values.push((value, shift));
                }
            }
        }
    }
    let mut random = Random(1);
    for _ in 0..500_000 {
        values.push((random.signed(62), random.below(63) as u32));
    }
    let cases: Vec<Case> = values
        .iter()
        .flat_map(|&(value, shift)| {
            (0..4).map(move |mode| [value as u32, (value >> 32) as u32, shift, mode])
        })
        .collect();
    compare("probe_round", &cases, |&[low, high, shift, mode]| {
        let value = (i64::from(high as i32) << 32) | i64::from(low);
        let long = rounding(mode).shift(value, shift);
        let short = rounding(mode).shift(i64::from(low as i32), shift & 31);
        let saturated = saturate(value, i32::MIN, i32::MAX);
        [long as i32, (long >> 32) as i32, short as i32, saturated]
    });
}

#[test]
fn rescale_agrees_at_every_shift_on_edges_ties_and_three_million_others() {
    let edges = [
        i32::MIN,
        i32::MIN + 1,
        -0x0100_0001,
        -65_537,
        -65_536,
        -3,
        -2,
        -1,
        0,
        1,
        2,
        3,
        65_535,
        65_536,
        0x0100_0001,
        i32::MAX - 1,
        i32::MAX,
    ];
    let mantissas = [
        1 << 30,
        (1 << 30) + 1,
        3 << 29,
        0x5fff_ffff,
        0x7fff_7fff,
        0x7fff_8000,
        i32::MAX - 1,
        i32::MAX,
    ];
    let mut scaled: Vec<(i32, i32, u32)> = Vec::new();
    for shift in 2..=62 {
        for mantissa in mantissas {
            scaled.extend(edges.map(|value| (value, mantissa, shift)));
        }
        // Ties: an odd multiple of half the unit. With the mantissa 2^30 the quotient is
        // value / 2^(shift − 30).
        for odd in -65..=65_i64 {
            if let Some(below) = shift.checked_sub(31) {
                let tie = odd << below;
                for value in [tie - 1, tie, tie + 1] {
                    scaled.extend(i32::try_from(value).map(|value| (value, 1 << 30, shift)));
                }
            }
        }
    }
    let mut random = Random(2);
    for _ in 0..600_000 {
        let mantissa = (1 << 30) + random.below(1 << 30) as i32;
        let shift = 2 + random.below(61) as u32;
        let value = random.signed(31) as i32;
        scaled.push((value, mantissa, shift));
        // As layers have them: answers of a few bits.
        let value = random.signed(24) as i32;
        scaled.push((value, mantissa, 38 + random.below(16) as u32));
    }
    for requantizer in Requantizer::ALL {
        let code = u32::from(requantizer.code());
        let cases: Vec<Case> = scaled
            .iter()
            .map(|&(value, mantissa, shift)| [value as u32, mantissa as u32, shift, code])
            .collect();
        compare("probe_rescale", &cases, |&[value, mantissa, shift, _]| {
            let scale = Multiplier::new(mantissa as i32, shift as u8).unwrap();
            [requantizer.apply(value as i32, scale), 0, 0, 0]
        });
    }
}

/// Mantissas and shifts that meet ties, and the largest and the smallest scales.
const SCALES: [(u32, u32); 10] = [
    (1 << 30, 2),
    (i32::MAX as u32, 2),
    (i32::MAX as u32, 62),
    (1 << 30, 30),
    (1 << 30, 31),
    (1 << 30, 33),
    (3 << 29, 35),
    (5 << 28, 40),
    (0x5999_9999, 38),
    (0x7fff_8000, 46),
];

#[test]
fn every_requantizer_agrees_on_all_accumulators_of_sixteen_bits() {
    let mut cases = Vec::new();
    for (mantissa, shift) in SCALES {
        for requantizer in Requantizer::ALL {
            let code = u32::from(requantizer.code());
            let values = i16::MIN..=i16::MAX;
            cases.extend(values.map(|value| [i32::from(value) as u32, mantissa, shift, code]));
        }
    }
    compare(
        "probe_rescale",
        &cases,
        |&[value, mantissa, shift, code]| {
            let scale = multiplier(mantissa, shift);
            [requantizer(code).apply(value as i32, scale), 0, 0, 0]
        },
    );
}

#[test]
fn arguments_of_gates_and_indices_of_tables_agree_on_all_accumulators_of_sixteen_bits() {
    let mut cases = Vec::new();
    for (mantissa, shift) in SCALES {
        for requantizer in Requantizer::ALL {
            let code = u32::from(requantizer.code());
            let edges = [i32::MIN, -(1 << 24), 1 << 24, i32::MAX];
            let values = (-32_768..=32_767).chain(edges);
            cases.extend(values.map(|value| [value as u32, mantissa, shift, code]));
        }
    }
    compare("probe_scaled", &cases, |&[value, mantissa, shift, code]| {
        let (value, scale) = (value as i32, multiplier(mantissa, shift));
        let argument = |is_clamped| gate_argument(value, scale, requantizer(code), is_clamped);
        let index = table_index(value, scale, requantizer(code));
        [argument(false), argument(true), index as i32, 0]
    });
}

#[test]
fn leaks_and_gates_agree_on_all_of_the_gates_range() {
    let (low, high) = GATE_RANGE;
    let mut cases = Vec::new();
    for value in low..=high {
        cases.push([
            value as u32,
            1 + value as u32 % 7,
            (value >> 3) as u32 % 4,
            0,
        ]);
    }
    let edges = [-(1 << 30), 1 - (1 << 30), i32::MIN, i32::MAX];
    for value in (-1030..=1030).chain(edges) {
        for (shift, mode) in (1..=7).flat_map(|shift| (0..4).map(move |mode| (shift, mode))) {
            cases.push([value as u32, shift, mode, 0]);
        }
    }
    compare("probe_activation", &cases, |&[value, shift, mode, _]| {
        let value = value as i32;
        let gated = gate(value.clamp(low, high));
        [leak(value, shift as u8, rounding(mode)), gated, 0, 0]
    });
}

#[test]
fn sums_of_accumulators_agree_at_every_width_around_the_ends() {
    let mut cases = Vec::new();
    for bits in 16..=32_u32 {
        let (low, high) = signed_range(bits as u8);
        // A product has at most 24 bits; a sum is within the accumulator's range.
        let products = [
            -(1 << 22),
            1 - (1 << 22),
            -32_769,
            -32_768,
            -300,
            -2,
            -1,
            0,
            1,
            2,
            300,
            32_767,
            32_768,
            (1 << 22) - 1,
            1 << 22,
        ];
        for near in 0..400 {
            for sum in [low + near, high - near, near, -near] {
                cases.extend(products.map(|product| [sum as u32, product as u32, bits, 0]));
            }
        }
        let mut random = Random(u64::from(bits));
        for _ in 0..20_000 {
            let sum = (random.signed(32) as i32).clamp(low, high);
            cases.push([sum as u32, random.signed(22) as u32, bits, 0]);
        }
    }
    compare("probe_accumulate", &cases, |&[sum, product, bits, _]| {
        let [wrapped, saturated] = Overflow::ALL.map(|overflow| {
            let bits = bits as u8;
            Accumulator { bits, overflow }.add(sum as i32, product as i32)
        });
        [wrapped, saturated, 0, 0]
    });
}

#[test]
fn activations_agree_where_their_sum_would_overflow() {
    let edges = [
        i32::MIN,
        i32::MIN + 1,
        i32::MIN + 300,
        -70_000,
        -32_769,
        -32_768,
        -300,
        -129,
        -128,
        -8,
        -1,
        0,
        1,
        7,
        127,
        128,
        300,
        32_767,
        32_768,
        70_000,
        i32::MAX - 300,
        i32::MAX - 1,
        i32::MAX,
    ];
    let mut cases = Vec::new();
    for bits in 4..=16_u32 {
        let (low, high) = signed_range(bits as u8);
        for (rescaled, skip) in edges.into_iter().flat_map(|r| edges.map(|s| (r, s))) {
            for zero_point in [low, -1, 0, 1, high] {
                cases.push([rescaled as u32, skip as u32, zero_point as u32, bits]);
            }
        }
    }
    compare("probe_activation_sum", &cases, |&[x, y, z, bits]| {
        let sum = i64::from(x as i32) + i64::from(y as i32) + i64::from(z as i32);
        let (low, high) = signed_range(bits as u8);
        [saturate(sum, low, high), 0, 0, 0]
    });
}

#[test]
fn dot_products_agree_on_every_pair_of_bytes() {
    let mut cases = Vec::new();
    for a in 0..=255_u8 {
        for b in 0..=255_u8 {
            // Each product in another byte of the word, beside ones that must not leak into it.
            let place = u32::from(a.wrapping_add(b) % 4);
            let word = u32::from(a) << (8 * place);
            cases.push([word, !word, u32::from(b) << (8 * place), 0]);
            let all = u32::from_le_bytes([a; 4]);
            cases.push([all, all, u32::from_le_bytes([b; 4]), 0]);
        }
    }
    let mut random = Random(3);
    for _ in 0..100_000 {
        let [x, y] = [random.next(), random.next()];
        cases.push([x as u32, (x >> 32) as u32, y as u32, 0]);
    }
    compare("probe_dot", &cases, |&[x, y, z, _]| {
        let dot = |a: u32| -> i32 {
            let pairs = a.to_le_bytes().into_iter().zip(z.to_le_bytes());
            pairs
                .map(|(p, q)| i32::from(p as i8) * i32::from(q as i8))
                .sum()
        };
        [dot(x) + dot(y), 0, 0, 0]
    });
}
