//! Probes of fp16 layers: the shader's own binary32 and binary16 arithmetic, on their bits.

use super::{Case, Random, compare, rounding};
use ntmu_isa::half::activation::{SIXTH, hard_gelu, leaky, relu};
use ntmu_isa::half::{Half, to_integer};

fn half(bits: u32) -> Half {
    Half::from_bits(bits as u16)
}

fn word(number: f32) -> i32 {
    number.to_bits() as i32
}

fn half_word(number: Half) -> i32 {
    i32::from(number.bits())
}

/// All halves that a layer may hold.
fn finite() -> impl Iterator<Item = u32> {
    (0..=0xffff).filter(|&bits| half(bits).is_finite())
}

impl Random {
    /// A finite half of any magnitude, often a subnormal one or a power of two.
    fn half(&mut self) -> u32 {
        let sign = self.below(2) << 15;
        let exponent = match self.below(4) {
            0 => self.below(3),
            1 => 12 + self.below(6),
            _ => self.below(31),
        };
        let fraction = match self.below(4) {
            0 => 0,
            1 => 1 << self.below(10),
            2 => 0x3ff - self.below(2),
            _ => self.below(0x400),
        };
        (sign | exponent << 10 | fraction) as u32
    }

    /// A number such as a sum of an fp16 layer may be, or the product of its gate: zero, or of
    /// 2^-72 to 2^47.
    fn float(&mut self) -> u32 {
        let sign = self.below(2) << 31;
        if self.below(16) == 0 {
            return sign as u32;
        }
        let exponent = match self.below(3) {
            0 => 120 + self.below(16),
            _ => 127 - 72 + self.below(119),
        };
        let fraction = match self.below(4) {
            0 => 0,
            1 => 1 << self.below(23),
            2 => 0x7f_ffff - self.below(2),
            _ => self.below(0x80_0000),
        };
        (sign | exponent << 23 | fraction) as u32
    }
}

#[test]
fn all_halves_agree_as_binary32_and_back_and_through_their_activations() {
    let cases: Vec<Case> = (0..=0xffff_u32)
        .flat_map(|bits| (1..=7).map(move |shift| [bits, shift, 0, 0]))
        .collect();
    compare("probe_half", &cases, |&[bits, shift, _, _]| {
        let sum = half(bits).to_f32();
        [
            word(sum),
            half_word(Half::round(sum)),
            word(relu(sum)),
            word(leaky(sum, shift as u8)),
        ]
    });
}

fn expected_float(&[bits, shift, _, _]: &Case) -> [i32; 4] {
    let sum = f32::from_bits(bits);
    [
        half_word(Half::round(sum)),
        word(leaky(sum, shift as u8)),
        word(hard_gelu(sum, false)),
        word(hard_gelu(sum, true)),
    ]
}

#[test]
fn all_halves_agree_through_the_gates() {
    let cases: Vec<Case> = (0..=0xffff_u32)
        .map(|bits| [half(bits).to_f32().to_bits(), 1 + bits % 7, 0, 0])
        .collect();
    compare("probe_float", &cases, expected_float);
}

#[test]
fn sums_agree_through_rounding_and_the_gates_on_ties_on_edges_and_a_million_others() {
    let mut numbers = Vec::new();
    // Between every two neighbours: the tie and the numbers beside it.
    for bits in 0..0x7bff_u32 {
        let middle = (half(bits).to_f32() + half(bits + 1).to_f32()) / 2.0;
        numbers.extend([middle, middle.next_down(), middle.next_up()]);
    }
    let tiny = Half::from_bits(1).to_f32() / 2.0;
    numbers.extend([tiny, tiny.next_down(), tiny.next_up(), tiny / 2.0]);
    numbers.extend([65_504.0, 65_519.996, 65_520.0, 65_536.0, 1e9]);
    // Where the gate shuts and opens, and where its argument is cut.
    for edge in [1.5_f32, 3.0] {
        let mut near = [edge; 2];
        for _ in 0..1000 {
            numbers.extend(near);
            near = [near[0].next_down(), near[1].next_up()];
        }
    }
    let mut random = Random(6);
    numbers.extend((0..500_000).map(|_| f32::from_bits(random.float())));
    let cases: Vec<Case> = numbers
        .into_iter()
        .flat_map(|number| [number, -number])
        .map(|number| [number.to_bits(), 1 + number.to_bits() % 7, 0, 0])
        .collect();
    compare("probe_float", &cases, expected_float);
}

#[test]
fn binary32_sums_and_products_agree_on_ties_cancellations_zeros_and_two_million_others() {
    let mut random = Random(7);
    let mut pairs: Vec<(u32, u32)> = Vec::new();
    for (a, b) in [0, 1 << 31]
        .into_iter()
        .flat_map(|a| [0, 1 << 31].map(|b| (a, b)))
    {
        pairs.push((a, b));
        for number in [1.0, -1.0, SIXTH, 65_504.0].map(f32::to_bits) {
            pairs.extend([(a, number), (number, b)]);
        }
    }
    for _ in 0..300_000 {
        let a = random.float();
        pairs.push((a, random.float()));
        pairs.push((a, a ^ 1 << 31));
        if a << 1 == 0 {
            continue;
        }
        // What nearly cancels: some last places and one exponent apart.
        let near = (a ^ 1 << 31).wrapping_add(random.signed(4) as u32);
        pairs.push((a, near));
        pairs.push((a, near.wrapping_sub(1 << 23)));
        // Half a last place away, or near that: ties.
        let exponent = a >> 23 & 0xff;
        let fraction = random.below(4) as u32;
        let sign = (random.below(2) as u32) << 31;
        for distance in [23, 24, 25, 26, 27] {
            pairs.push((a, sign | (exponent - distance) << 23 | fraction));
            pairs.push((a, (sign | (exponent - distance) << 23) - fraction));
        }
    }
    let cases: Vec<Case> = pairs
        .into_iter()
        // No product of a layer is nearly subnormal.
        .filter(|&(a, b)| {
            let (a, b) = (f32::from_bits(a), f32::from_bits(b));
            a == 0.0 || b == 0.0 || (a * b).abs() > 2.0 * f32::MIN_POSITIVE
        })
        .flat_map(|(a, b)| [[a, b, 0, 0], [b, a, 0, 0]])
        .collect();
    compare("probe_float_pair", &cases, |&[a, b, _, _]| {
        let (a, b) = (f32::from_bits(a), f32::from_bits(b));
        [word(a + b), word(a * b), 0, 0]
    });
}

#[test]
fn products_and_fused_steps_agree_on_known_answers_edges_and_three_million_others() {
    let mut triples = vec![[0x5d00, 0x5802, 0x0001], [0x0fae, 0x1240, 0x9000]];
    let edges = [
        0, 1, 2, 0x3ff, 0x400, 0x401, 0x3bff, 0x3c00, 0x3c01, 0x7bfe, 0x7bff,
    ]
    .into_iter()
    .flat_map(|bits| [bits, bits | 0x8000]);
    for (a, b) in edges
        .clone()
        .flat_map(|a| edges.clone().map(move |b| (a, b)))
    {
        triples.extend(edges.clone().map(|c| [a, b, c]));
    }
    triples.extend(finite().flat_map(|c| [[0x3c00, 0x3c00, c], [c, 0x3c00, 0x8000], [c, c, c]]));
    let mut random = Random(8);
    for _ in 0..600_000 {
        let [a, b] = [random.half(), random.half()];
        triples.push([a, b, random.half()]);
        // What nearly cancels, and an addend far below the product or far above it.
        let product = Half::round(half(a).to_f32() * half(b).to_f32());
        let near = u32::from(product.bits()) ^ 0x8000;
        triples.push([a, b, near]);
        let beside = near.wrapping_add(random.signed(2) as u32) & 0xffff;
        triples.push([
            a,
            b,
            if half(beside).is_finite() {
                beside
            } else {
                near
            },
        ]);
        triples.push([a, b, (random.below(2) << 15 | random.below(3)) as u32]);
    }
    let cases: Vec<Case> = triples.into_iter().map(|[a, b, c]| [a, b, c, 0]).collect();
    compare("probe_fused", &cases, |&[a, b, c, _]| {
        let product = half(a).to_f32() * half(b).to_f32();
        let fused = half(a).fused(half(b), half(c));
        [word(product), half_word(fused), 0, 0]
    });
    let known = |a, b, c| half(a).fused(half(b), half(c)).bits();
    assert_eq!(known(0x5d00, 0x5802, 0x0001), 0x7903);
    assert_eq!(known(0x0fae, 0x1240, 0x9000), 0x8fff);
}

#[test]
fn integers_of_all_halves_and_of_a_million_sums_agree_in_every_mode() {
    let mut scaled: Vec<(u32, u32, i32)> = Vec::new();
    for bits in finite() {
        let number = half(bits).to_f32().to_bits();
        for (factor, exponent) in [
            (1, 0),
            (127, 0),
            (255, 0),
            (65_535, 0),
            (1, 7),
            (1, -16),
            (1, 24),
        ] {
            scaled.push((number, factor, exponent));
        }
    }
    let mut random = Random(9);
    for _ in 0..250_000 {
        let factor = [1, 127, 255, 65_535][random.below(4) as usize];
        scaled.push((random.float(), factor, random.below(41) as i32 - 16));
    }
    let cases: Vec<Case> = scaled
        .into_iter()
        .flat_map(|(number, factor, exponent)| {
            (0..4).map(move |mode| [number, factor, exponent as u32, mode])
        })
        .collect();
    compare(
        "probe_to_integer",
        &cases,
        |&[number, factor, exponent, mode]| {
            let number = f32::from_bits(number);
            let exact = to_integer(number, factor as u16, exponent as i32, rounding(mode));
            // The shader keeps 32 bits; whatever it saturates to afterwards has 17 at most.
            let saturated = exact.clamp(i64::from(i32::MIN), i64::from(i32::MAX));
            [saturated as i32, 0, 0, 0]
        },
    );
}

#[test]
fn halves_of_fixed_point_numbers_agree_on_ties_on_every_lane_and_a_million_others() {
    let mut fixed: Vec<(i64, u32)> = Vec::new();
    // Lanes as fp16 layers read them, less a zero point.
    for bits in [4, 8, 11, 12, 16] {
        let ends = 1 << bits;
        fixed.extend((-ends..=ends).map(|value| (value, bits - 1)));
    }
    // Twelve bits and one more make ties; then what lies just beside them.
    let mut random = Random(10);
    for _ in 0..200_000 {
        let tie = (random.below(1 << 11) * 2 + 1) as i64;
        let up = random.below(50) as u32;
        for value in [(tie << up) - 1, tie << up, (tie << up) + 1] {
            fixed.push((value, 2 + random.below(61) as u32));
        }
        // An accumulator times a mantissa.
        let mantissa = (1 << 30) + random.below(1 << 30) as i64;
        fixed.push((random.signed(31) * mantissa, 2 + random.below(61) as u32));
    }
    for (value, fraction_bits) in [(i64::from(i32::MIN), 0), (i64::from(i32::MAX), 31)] {
        fixed.push((value * i64::from(i32::MAX), fraction_bits + 2));
    }
    let cases: Vec<Case> = fixed
        .into_iter()
        .flat_map(|(value, bits)| [(value, bits), (-value, bits)])
        .map(|(value, bits)| [value as u32, (value >> 32) as u32, bits, 0])
        .collect();
    compare("probe_from_fixed", &cases, |&[low, high, bits, _]| {
        let value = i128::from(i64::from(high as i32) << 32 | i64::from(low));
        [half_word(Half::from_fixed(value, bits)), 0, 0, 0]
    });
}
