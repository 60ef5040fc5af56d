//! Probes: single functions of the shaders against the specification's, on the device.

use crate::gpu::Gpu;
use crate::source::{Sizes, WORKGROUP};
use ntmu_isa::activation::{GATE_RANGE, gate, leak};
use ntmu_isa::embed::{MAX_OCTAVES, corner_input, lerp_input, level_input, wave_input};
use ntmu_isa::latent::LatentFormat;
use ntmu_isa::position::{AddressMode, AxisPosition, CornerSnap, corner_weights};
use ntmu_isa::rescale::{Multiplier, Requantizer};
use ntmu_isa::round::{Rounding, saturate};

type Case = [u32; 4];
type Answer = [i32; 4];

/// The decode with the probes' entry points.
pub(crate) fn source() -> String {
    let mut text = Sizes::largest().source(false);
    text.push_str(include_str!("../wgsl/probe.wgsl"));
    text
}

/// A device; `None`, and a line that says so, where there is none and none is demanded.
fn gpu() -> Option<Gpu> {
    match Gpu::open() {
        Ok(gpu) => Some(gpu),
        Err(error) if error.is_no_adapter() => {
            let demanded = ["NTMU_REQUIRE_ALL", "NTMU_REQUIRE_ADAPTER"]
                .iter()
                .find(|name| std::env::var_os(name).is_some_and(|v| v == "1"));
            assert!(demanded.is_none(), "{demanded:?} is 1 and {error}");
            eprintln!("SKIPPED: {error}");
            None
        }
        Err(error) => panic!("{error}"),
    }
}

/// Runs cases through an entry point and compares all answers with `expected`.
fn compare(entry: &str, cases: &[Case], expected: impl Fn(&Case) -> Answer) {
    let Some(gpu) = gpu() else { return };
    let pipeline = gpu.pipeline(source(), entry).unwrap();
    let storage = wgpu::BufferUsages::STORAGE;
    assert!(!cases.is_empty());
    // As many as one dimension of a dispatch and the smallest binding bear.
    for cases in cases.chunks(1 << 20) {
        let uploaded = gpu.upload("cases", cases, storage).unwrap();
        let results = gpu.results(4 * cases.len() as u64).unwrap();
        let bindings = [(10, &uploaded), (11, &results)];
        let groups = (cases.len() as u32).div_ceil(WORKGROUP);
        let words = gpu
            .run(&pipeline, &[bindings.to_vec()], groups, &results)
            .unwrap();
        assert_eq!(words.len(), 4 * cases.len());
        for (case, answer) in cases.iter().zip(words.chunks_exact(4)) {
            assert_eq!(answer, expected(case), "{entry} of {case:x?}");
        }
    }
}

/// A small generator of even quality; the same cases everywhere.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        // splitmix64 (Steele, Lea, Flood 2014).
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// 0..count.
    fn below(&mut self, count: u64) -> u64 {
        self.next() % count
    }

    /// Of every magnitude alike.
    fn signed(&mut self, bits: u32) -> i64 {
        let width = self.below(u64::from(bits) + 1) as u32;
        let magnitude = (u128::from(self.next()) & ((1 << width) - 1)) as i64;
        if self.next() & 1 == 1 {
            -magnitude
        } else {
            magnitude
        }
    }
}

fn rounding(code: u32) -> Rounding {
    Rounding::from_code(code as u8).unwrap()
}

fn format(bits: u32) -> LatentFormat {
    LatentFormat::new(bits as u8).unwrap()
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

#[test]
fn positions_agree_at_every_mip_scale_snap_and_address_mode() {
    let mut cases = Vec::new();
    for mip in 0..=14_u32 {
        let texels = 16_384_u32 >> mip;
        for scale in 1..=3_u32 {
            for snap in CornerSnap::ALL {
                for mode in AddressMode::ALL {
                    let packed = scale | u32::from(snap.code()) << 8 | u32::from(mode.code()) << 16;
                    // Every texel near both ends, and a sample between.
                    let chosen = (0..texels)
                        .filter(|texel| *texel < 40 || texels - texel < 40 || texel % 61 == 0);
                    for texel in chosen {
                        for size in [16_384_u32.div_ceil(1 << scale), 1, 2, 3, 37] {
                            cases.push([texel, mip, packed, size]);
                        }
                    }
                }
            }
        }
    }
    compare("probe_position", &cases, |&[texel, mip, packed, size]| {
        let snap = CornerSnap::from_code((packed >> 8) as u8).unwrap();
        let mode = AddressMode::from_code((packed >> 16) as u8).unwrap();
        let axis = AxisPosition::of(texel, mip as u8, packed as u8, snap);
        let [first, second] = axis.corners(size, mode);
        let phase = i32::from(axis.phase);
        [axis.first, phase, first as i32, second as i32]
    });
}

#[test]
fn interpolation_weights_agree_at_all_phases() {
    let cases: Vec<Case> = (0..256).map(|i| [i % 16, i / 16, 0, 0]).collect();
    compare("probe_interpolate", &cases, |&[x, y, _, _]| {
        let axis = |phase: u32| AxisPosition {
            first: 0,
            stride: 1,
            phase: phase as u8,
        };
        corner_weights(axis(x), axis(y))
    });
}

#[test]
fn unpack_agrees_on_every_code_at_every_bit() {
    let mut cases = Vec::new();
    for bits in 1..=8_u32 {
        for (code, offset) in (0..1_u64 << bits).flat_map(|c| (0..32).map(move |o| (c, o))) {
            // Between zeros and between ones.
            let field = code << offset;
            let around = !(((1_u64 << bits) - 1) << offset);
            for words in [field, field | around] {
                cases.push([words as u32, (words >> 32) as u32, offset, bits]);
            }
        }
    }
    compare("probe_unpack", &cases, |&[low, high, offset, bits]| {
        let words = u64::from(low) | u64::from(high) << 32;
        let code = (words >> offset & ((1 << bits) - 1)) as u8;
        [i32::from(code), format(bits).value(code), 0, 0]
    });
}

#[test]
fn inputs_agree_on_every_sum_of_every_width_and_mode() {
    let mut cases = Vec::new();
    for bits in 1..=8_u32 {
        let limit = 256 * format(bits).max_value();
        for mode in 0..4 {
            cases.extend((-limit..=limit).map(|sum| [sum as u32, bits, mode, 0]));
        }
    }
    compare("probe_input", &cases, |&[value, bits, mode, _]| {
        let (value, format, mode) = (value as i32, format(bits), rounding(mode));
        let corner = corner_input(value, format, mode);
        [corner, lerp_input(value, format, mode), 0, 0]
    });
}

#[test]
fn waves_and_levels_agree_at_every_mip() {
    let mut cases = Vec::new();
    for mip in 0..=14_u32 {
        let texels = 16_384_u32 >> mip;
        for octave in 0..u32::from(MAX_OCTAVES) {
            let chosen = (0..texels).filter(|texel| *texel < 64 || texels - texel < 64);
            for texel in chosen {
                cases.push([texel, mip, octave, mip + 1 + texel % (15 - mip)]);
            }
        }
    }
    compare("probe_embed", &cases, |&[texel, mip, octave, mip_count]| {
        let (mip, octave) = (mip as u8, octave as u8);
        [
            wave_input(texel, mip, octave, false),
            wave_input(texel, mip, octave, true),
            level_input(mip, mip_count as u8),
            0,
        ]
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
fn layer_sums_agree_where_they_would_overflow_and_dot_products_on_every_pair_of_bytes() {
    let edges = [
        i32::MIN,
        i32::MIN + 1,
        i32::MIN + 300,
        -300,
        -129,
        -128,
        -1,
        0,
        1,
        127,
        128,
        300,
        i32::MAX - 300,
        i32::MAX - 1,
        i32::MAX,
    ];
    let mut cases = Vec::new();
    for rescaled in edges {
        for skip in edges {
            for zero_point in [-128, -1, 0, 1, 127_i32] {
                cases.push([rescaled as u32, skip as u32, zero_point as u32, 0]);
            }
        }
    }
    for a in 0..=255_u8 {
        for b in 0..=255_u8 {
            // Each product in another byte of the word, beside ones that must not leak into it.
            let place = u32::from(a.wrapping_add(b) % 4);
            let word = u32::from(a) << (8 * place);
            cases.push([word, !word, 0, u32::from(b) << (8 * place)]);
            let all = u32::from_le_bytes([a; 4]);
            cases.push([all, all, 0, u32::from_le_bytes([b; 4])]);
        }
    }
    let mut random = Random(3);
    for _ in 0..100_000 {
        let [x, y] = [random.next(), random.next()];
        cases.push([
            x as u32,
            (x >> 32) as u32,
            (y >> 32) as u8 as i8 as u32,
            y as u32,
        ]);
    }
    compare("probe_layer", &cases, |&[x, y, z, w]| {
        let sum = i64::from(x as i32) + i64::from(y as i32) + i64::from(z as i32);
        let dot = |a: u32| -> i32 {
            let pairs = a.to_le_bytes().into_iter().zip(w.to_le_bytes());
            pairs
                .map(|(p, q)| i32::from(p as i8) * i32::from(q as i8))
                .sum()
        };
        [saturate(sum, -128, 127), dot(x) + dot(y), 0, 0]
    });
}
