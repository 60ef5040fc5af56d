//! Every set of kernels against definitions that share nothing with them.

use super::*;
use ntmu_isa::activation::{gate, leak};
use ntmu_isa::rescale::{Multiplier, Requantizer};
use ntmu_isa::round::Rounding;
use proptest::prelude::*;

/// Shapes that fill blocks and groups, fall short of them, and go beyond.
const SHAPES: [(usize, usize); 10] = [
    (1, 1),
    (3, 5),
    (4, 4),
    (8, 64),
    (13, 17),
    (16, 16),
    (33, 40),
    (64, 64),
    (130, 200),
    (128, 128),
];

fn shapes() -> &'static [(usize, usize)] {
    if cfg!(miri) { &SHAPES[1..2] } else { &SHAPES }
}

fn cases() -> ProptestConfig {
    let mut config = ProptestConfig::with_cases(if cfg!(miri) { 1 } else { 64 });
    config.failure_persistence = None;
    config
}

fn every_set() -> Vec<Kernels> {
    Path::available()
        .into_iter()
        .filter_map(Kernels::new)
        .collect()
}

/// SplitMix64, so that a shape and a seed make the same layer everywhere.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Any byte, an extreme one in one of four.
    fn byte(&mut self) -> i8 {
        match self.next() % 8 {
            0 => i8::MIN,
            1 => i8::MAX,
            _ => self.next() as i8,
        }
    }

    fn word(&mut self) -> i16 {
        match self.next() % 8 {
            0 => i16::MIN,
            1 => i16::MAX,
            _ => self.next() as i16,
        }
    }

    /// Powers of two meet ties; the others lie anywhere.
    fn multiplier(&mut self, low: u8, high: u8) -> Multiplier {
        let shift = low + (self.next() % u64::from(high - low + 1)) as u8;
        let mantissa = match self.next() % 4 {
            0 => 1 << 30,
            1 => i32::MAX,
            _ => (1 << 30) + (self.next() % (1 << 30)) as i32,
        };
        Multiplier::new(mantissa, shift).unwrap()
    }
}

struct Layer {
    rows: usize,
    inputs: usize,
    weights: Vec<i8>,
    bias: Vec<i32>,
    multipliers: Vec<Multiplier>,
    packed: Dense8,
}

impl Layer {
    fn new(rows: usize, inputs: usize, random: &mut Random) -> Layer {
        let weights: Vec<i8> = (0..rows * inputs).map(|_| random.byte()).collect();
        let bias: Vec<i32> = (0..rows).map(|_| random.next() as i32 >> 12).collect();
        Layer {
            packed: Dense8::new(&weights, inputs, &bias),
            multipliers: (0..rows).map(|_| random.multiplier(28, 46)).collect(),
            rows,
            inputs,
            weights,
            bias,
        }
    }

    fn sum(&self, row: usize, input: impl Fn(usize) -> i32) -> i32 {
        let weights = &self.weights[row * self.inputs..][..self.inputs];
        let products = weights
            .iter()
            .enumerate()
            .map(|(k, &w)| i32::from(w) * input(k));
        self.bias[row] + products.sum::<i32>()
    }

    fn largest(&self, row: usize) -> i64 {
        let weights = &self.weights[row * self.inputs..][..self.inputs];
        let reach: i64 = weights.iter().map(|&w| 128 * i64::from(w).abs()).sum();
        i64::from(self.bias[row]).abs() + reach
    }

    fn scales(&self, after: i32) -> Vec<Scale> {
        (0..self.rows)
            .map(|row| Scale::fold(self.multipliers[row], 0, after, self.largest(row)).unwrap())
            .collect()
    }
}

/// Lanes of a tile, and what they are as signed values.
fn random_quads(lanes: usize, random: &mut Random) -> (Vec<Quad>, Vec<Vec<i32>>) {
    let mut quads = vec![Quad([[0x5a; 4]; TILE]); lanes.div_ceil(4)];
    let mut values = vec![vec![0; TILE]; lanes];
    for (lane, values) in values.iter_mut().enumerate() {
        for (texel, value) in values.iter_mut().enumerate() {
            *value = i32::from(random.byte());
            quads[lane / 4].0[texel][lane % 4] = (*value + 128) as u8;
        }
    }
    (quads, values)
}

/// What a step does to a sum, or to a gate's argument, by the specification.
type Definition = Box<dyn Fn(i32) -> i32>;

/// Every step of a fused kernel and its definition.
fn steps(random: &mut Random) -> Vec<(Step, Definition)> {
    let product = random.multiplier(40, 52);
    let gated = Scale::fold(product, 0, 0, 32_768 * 1536).unwrap();
    let n = 1 + (random.next() % 7) as u8;
    let leaky = |half| Step::Leaky {
        shift: u32::from(n),
        half,
    };
    vec![
        (Step::Identity, Box::new(|x| x)),
        (Step::Relu, Box::new(|x: i32| x.max(0))),
        (
            leaky(1 << (n - 1)),
            Box::new(move |x| leak(x, n, Rounding::HalfUp)),
        ),
        (leaky(0), Box::new(move |x| leak(x, n, Rounding::Floor))),
        (
            Step::Gate {
                scale: gated,
                limit: 32_767,
            },
            Box::new(move |x| Requantizer::Single.apply(gate(x.clamp(-32_768, 32_767)), product)),
        ),
        (
            Step::Gate {
                scale: gated,
                limit: 768,
            },
            Box::new(move |x| Requantizer::Single.apply(gate(x.clamp(-32_768, 768)), product)),
        ),
    ]
}

/// Activation and rescaling of one sum, in the order of the step.
fn finished(step: &Step, of: &dyn Fn(i32) -> i32, sum: i32, multiplier: Multiplier) -> i32 {
    match step {
        Step::Gate { .. } => of(Requantizer::Single.apply(sum, multiplier)),
        Step::Identity | Step::Relu | Step::Leaky { .. } => {
            Requantizer::Single.apply(of(sum), multiplier)
        }
    }
}

fn check_dense8(rows: usize, inputs: usize, seed: u64) {
    let mut random = Random(seed);
    let layer = Layer::new(rows, inputs, &mut random);
    let (input, values) = random_quads(inputs, &mut random);
    let (source, source_values) = random_quads(rows, &mut random);
    let skip = random.multiplier(28, 34);
    let [zero_point, source_zero] = [random.byte(), random.byte()].map(i32::from);
    for (step, of) in steps(&mut random) {
        let is_gate = matches!(step, Step::Gate { .. });
        let step = match step {
            Step::Gate { scale, limit } => Step::Gate {
                scale: Scale {
                    addend: scale.addend + (i64::from(128 + zero_point) << scale.shift),
                    ..scale
                },
                limit,
            },
            Step::Identity | Step::Relu | Step::Leaky { .. } => step,
        };
        let scales = layer.scales(if is_gate { 0 } else { 128 + zero_point });
        for with_skip in [false, true] {
            let folded = Scale::fold_skip(skip, 128 + source_zero).unwrap();
            let finish = Finish::new(step, &scales, with_skip.then_some(folded), &[]);
            let expected = |row: usize, texel: usize| {
                let sum = layer.sum(row, |k| values[k][texel]);
                let real = source_values[row][texel] - source_zero;
                let mut value = finished(&step, &of, sum, layer.multipliers[row]) + zero_point;
                if with_skip {
                    value += Requantizer::Single.apply(real, skip);
                }
                value.clamp(-128, 127)
            };
            for kernels in every_set() {
                let mut output = vec![Quad::ZERO; rows.div_ceil(4)];
                kernels.dense8(&layer.packed, &finish, &input, Some(&source), &mut output);
                for row in 0..rows {
                    for texel in 0..TILE {
                        let found = i32::from(output[row / 4].0[texel][row % 4]) - 128;
                        let expected = expected(row, texel);
                        assert_eq!(found, expected, "{kernels:?} {step:?} row {row} {texel}");
                    }
                }
                for texel in [0, 17, TILE - 1] {
                    let quads: Vec<[u8; 4]> = input.iter().map(|quad| quad.0[texel]).collect();
                    let mut bytes: Vec<u8> = (0..rows)
                        .map(|row| source[row / 4].0[texel][row % 4])
                        .collect();
                    bytes.resize(rows.next_multiple_of(GROUP_ROWS), 0);
                    let mut sums = vec![[0; GROUP_ROWS]; rows.div_ceil(GROUP_ROWS)];
                    kernels.row_sums(&layer.packed, &quads, &mut sums);
                    kernels.row_finish(&finish, Some(&bytes), &mut sums);
                    for (row, &sum) in sums.as_flattened()[..rows].iter().enumerate() {
                        let found = sum.clamp(0, 255) - 128;
                        assert_eq!(
                            found,
                            expected(row, texel),
                            "{kernels:?} {step:?} row {row}"
                        );
                    }
                }
            }
        }
    }
}

fn check_emit8(rows: usize, inputs: usize, seed: u64) {
    let mut random = Random(seed);
    let layer = Layer::new(rows, inputs, &mut random);
    let (input, values) = random_quads(inputs, &mut random);
    let ranges: Vec<(i32, i32)> = (0..rows)
        .map(|_| match random.next() % 3 {
            0 => (0, 255),
            1 => (0, 65_535),
            _ => (-127, 127),
        })
        .collect();
    let finish = Finish::new(Step::Identity, &layer.scales(0), None, &ranges);
    for kernels in every_set() {
        let mut raw = vec![Sums::ZERO; rows];
        kernels.raw8(&layer.packed, &input, &mut raw);
        let mut emitted = vec![Sums::ZERO; rows];
        kernels.emit8(&layer.packed, &finish, &input, &mut emitted);
        for (row, (raw, emitted)) in raw.iter().zip(&emitted).enumerate() {
            let (low, high) = ranges[row];
            for (texel, (&raw, &emitted)) in raw.0.iter().zip(&emitted.0).enumerate() {
                let sum = layer.sum(row, |k| values[k][texel]);
                assert_eq!(raw, sum, "{kernels:?} row {row} {texel}");
                let code = Requantizer::Single.apply(sum, layer.multipliers[row]);
                assert_eq!(emitted, code.clamp(low, high), "{kernels:?}");
            }
        }
    }
}

fn check_dense16(rows: usize, inputs: usize, seed: u64) {
    let mut random = Random(seed);
    let weights: Vec<i16> = (0..rows * inputs).map(|_| random.word()).collect();
    let bias: Vec<i32> = (0..rows).map(|_| random.next() as i32).collect();
    let layer = Dense16::new(&weights, inputs, &bias);
    let mut input = vec![Pair([[0x5a5a; 2]; TILE]); layer.pairs()];
    let mut values = vec![vec![0_i32; TILE]; inputs];
    for (lane, values) in values.iter_mut().enumerate() {
        for (texel, value) in values.iter_mut().enumerate() {
            let word = random.word();
            *value = i32::from(word);
            input[lane / 2].0[texel][lane % 2] = word;
        }
    }
    let sum = |row: usize, texel: usize| {
        let products = (0..inputs).map(|k| i32::from(weights[row * inputs + k]) * values[k][texel]);
        products.fold(bias[row], i32::wrapping_add)
    };
    let multipliers: Vec<Multiplier> = (0..rows).map(|_| random.multiplier(34, 50)).collect();
    let largest = (1 << 31) - 1;
    let scales: Vec<Scale> = multipliers
        .iter()
        .map(|&m| Scale::fold(m, 0, 5, largest).unwrap())
        .collect();
    let ranges: Vec<(i32, i32)> = (0..rows)
        .map(|_| {
            let bits = 4 + random.next() % 13;
            (-(1 << (bits - 1)), (1 << (bits - 1)) - 1)
        })
        .collect();
    let finish = Finish::new(Step::Relu, &scales, None, &ranges);
    for kernels in every_set() {
        let mut raw = vec![Sums::ZERO; rows];
        kernels.raw16(&layer, &input, &mut raw);
        let mut output = vec![Pair::ZERO; rows.div_ceil(2)];
        kernels.dense16(&layer, &finish, &input, &mut output);
        for row in 0..rows {
            for texel in 0..TILE {
                let sum = sum(row, texel);
                assert_eq!(raw[row].0[texel], sum, "{kernels:?} row {row} {texel}");
                let value = Requantizer::Single.apply(sum.max(0), multipliers[row]) + 5;
                let expected = value.clamp(ranges[row].0, ranges[row].1);
                let found = i32::from(output[row / 2].0[texel][row % 2]);
                assert_eq!(found, expected, "{kernels:?} row {row} {texel}");
            }
        }
    }
}

#[test]
fn every_set_computes_8_bit_layers_of_the_listed_shapes() {
    for (seed, &(rows, inputs)) in shapes().iter().enumerate() {
        check_dense8(rows, inputs, seed as u64);
        check_emit8(rows, inputs, seed as u64);
    }
}

#[test]
fn every_set_computes_16_bit_layers_of_the_listed_shapes() {
    for (seed, &(rows, inputs)) in shapes().iter().enumerate() {
        check_dense16(rows, inputs, seed as u64);
    }
}

#[test]
fn extremes_everywhere_are_exact() {
    for (weight, value) in [(-128_i8, -128_i32), (-128, 127), (127, -128), (127, 127)] {
        let inputs = if cfg!(miri) { 8 } else { 1024 };
        let layer = Dense8::new(
            &vec![weight; 5 * inputs],
            inputs,
            &[0, 1, -1, 1 << 29, -(1 << 29)],
        );
        let input = vec![Quad([[(value + 128) as u8; 4]; TILE]); inputs / 4];
        let products = inputs as i32 * i32::from(weight) * value;
        for kernels in every_set() {
            let mut sums = vec![Sums::ZERO; 5];
            kernels.raw8(&layer, &input, &mut sums);
            for (sums, bias) in sums.iter().zip([0, 1, -1, 1 << 29, -(1 << 29)]) {
                assert_eq!(sums.0, [bias + products; TILE], "{kernels:?}");
            }
        }
    }
}

#[test]
fn interpolation_equals_its_definition() {
    let mut random = Random(7);
    for length in [1, 3, 8, 16, 31, 64] {
        let cells: [Vec<u8>; 4] =
            std::array::from_fn(|_| (0..length).map(|_| random.next() as u8).collect());
        for (x, y) in [(0, 0), (15, 15), (1, 8), (7, 3)] {
            let weights = [(16 - x) * (16 - y), x * (16 - y), (16 - x) * y, x * y];
            let (addend, shift) = (256 + (128 << 9) - 256 * 127, 9);
            for kernels in every_set() {
                let mut output = vec![0; length];
                let views = [&cells[0], &cells[1], &cells[2], &cells[3]].map(Vec::as_slice);
                kernels.interpolate(views, weights, addend, shift, &mut output);
                for at in 0..length {
                    let sum: i32 = (0..4)
                        .map(|c| i32::from(weights[c]) * i32::from(cells[c][at]))
                        .sum();
                    assert_eq!(output[at], ((sum + addend) >> shift) as u8, "{kernels:?}");
                }
            }
        }
    }
}

#[test]
fn every_set_brings_texels_of_any_width_into_lanes() {
    let mut random = Random(11);
    for count in [1, 3, 4, 5, 61, 63, 64, 65, 127, 130] {
        for texels in [1, 15, 16, 17, 63, TILE] {
            let inputs: Vec<i8> = (0..texels * count).map(|_| random.byte()).collect();
            for kernels in every_set() {
                let mut quads = vec![Quad::ZERO; count.div_ceil(4)];
                kernels.bring(&inputs, count, &mut quads);
                for (at, &input) in inputs.iter().enumerate() {
                    let (texel, lane) = (at / count, at % count);
                    let found = Integers::Quads(&quads).value(lane, texel);
                    assert_eq!(
                        found,
                        i32::from(input),
                        "{kernels:?} {count} {texel} {lane}"
                    );
                }
            }
        }
    }
}

#[test]
fn a_fold_is_refused_where_it_would_not_be_exact() {
    let scale = Multiplier::power_of_two(0);
    assert!(Scale::fold(scale, 0, 0, 1 << 20).is_some());
    assert!(Scale::fold(scale, 0, 0, 1 << 30).is_none());
    let tiny = Multiplier::new(i32::MAX, 62).unwrap();
    assert!(Scale::fold(tiny, 0, 0, 1 << 30).is_some());
    assert!(Scale::fold(tiny, 0, 128, 1 << 30).is_none());
}

proptest! {
    #![proptest_config(cases())]

    #[test]
    #[cfg_attr(miri, ignore = "the listed shapes take minutes there already")]
    fn every_set_computes_8_bit_layers(rows in 1_usize..130, inputs in 1_usize..200, seed: u64) {
        check_dense8(rows, inputs, seed);
        check_emit8(rows, inputs, seed);
    }

    #[test]
    #[cfg_attr(miri, ignore = "the listed shapes take minutes there already")]
    fn every_set_computes_16_bit_layers(rows in 1_usize..130, inputs in 1_usize..200, seed: u64) {
        check_dense16(rows, inputs, seed);
    }

    #[test]
    fn a_fold_equals_the_requantiser(
        mantissa in (1_i32 << 30)..=i32::MAX, shift in 2_u8..=62, before in -128..=127_i32,
        after in -255..=255_i32, largest in 1_i64..1 << 31, unit in -1.0..=1.0_f64,
    ) {
        let multiplier = Multiplier::new(mantissa, shift).unwrap();
        if let Some(scale) = Scale::fold(multiplier, before, after, largest) {
            let value = (unit * largest as f64) as i32;
            let plain = i64::from(value) - i64::from(before);
            prop_assume!(i32::try_from(plain).is_ok());
            let expected = Requantizer::Single.apply(plain as i32, multiplier) + after;
            prop_assert_eq!(scale.apply(value), expected);
        }
    }
}
