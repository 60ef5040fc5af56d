//! The naive evaluation against the specification's own functions, and its independence of them.
//!
//! That the model equals it in every tap of random assets is the first claim of `stages.rs`.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use ntmu_conformance::naive::float::Number;
use ntmu_conformance::naive::number;
use ntmu_conformance::synthetic::Random;
use ntmu_isa::accumulate::{signed_range, wrap};
use ntmu_isa::embed::{corner_input, lerp_input};
use ntmu_isa::filter::FilterRule;
use ntmu_isa::half::{self, Half};
use ntmu_isa::latent::LatentFormat;
use ntmu_isa::layer::integer_as_half;
use ntmu_isa::profile::Profile;
use ntmu_isa::rescale::{Multiplier, Requantizer};
use ntmu_isa::round::Rounding;
use std::path::Path;

fn halves() -> impl Iterator<Item = Half> {
    (0..=u16::MAX)
        .map(Half::from_bits)
        .filter(|half| half.is_finite())
}

/// An f32 by its value, for the numbers of these tests.
fn single(number: f32) -> Number {
    let bits = number.to_bits();
    let (exponent, fraction) = ((bits >> 23 & 0xff) as i32, i128::from(bits & 0x7f_ffff));
    Number {
        is_negative: bits >> 31 == 1,
        magnitude: if exponent == 0 {
            fraction
        } else {
            fraction + (1 << 23)
        },
        exponent: exponent.max(1) - 150,
    }
}

#[test]
fn quotients_and_widths_are_the_specifications_for_all_small_numbers() {
    for value in -3000..=3000_i64 {
        for (mode, shift) in Rounding::ALL
            .into_iter()
            .flat_map(|mode| (0..12).map(move |shift| (mode, shift)))
        {
            let found = number::divide(i128::from(value), number::power(shift), mode);
            assert_eq!(found, i128::from(mode.shift(value, shift)));
        }
        for bits in 4..=16 {
            let value = value * 37;
            let (low, high) = signed_range(bits);
            let limited = value.clamp(i64::from(low), i64::from(high));
            assert_eq!(
                number::limited(i128::from(value), bits),
                i128::from(limited)
            );
            let wrapped = i128::from(wrap(value, bits));
            assert_eq!(number::wrapped(i128::from(value), bits), wrapped);
        }
    }
}

#[test]
fn two_hundred_thousand_rescalings_are_the_specifications() {
    let mut random = Random::new(1);
    for _ in 0..200_000 {
        let value = random.bits() as i32 >> random.within(0, 31);
        let mantissa = random.within(1 << 30, i32::MAX);
        let scale = Multiplier::new(mantissa, random.within(2, 62) as u8).unwrap();
        for requantizer in Requantizer::ALL {
            let found = number::rescale(requantizer, i128::from(value), scale);
            let expected = i128::from(requantizer.apply(value, scale));
            assert_eq!(found, expected, "{} {value} {scale:?}", requantizer.name());
        }
    }
}

#[test]
fn interpolations_by_every_rule_width_and_phase_are_the_specifications() {
    let mut random = Random::new(2);
    for interpolate in FilterRule::ALL {
        for (subtexel_bits, latent_bits) in (4..=12).flat_map(|b| (1..=8).map(move |l| (b, l))) {
            let format = LatentFormat::new(latent_bits).unwrap();
            for (x, y) in (0..16).flat_map(|x| (0..16).map(move |y| (x, y))) {
                let input_bits = random.within(4, 16) as u8;
                let profile = Profile {
                    interpolate,
                    subtexel_bits,
                    input: random.choose(&Rounding::ALL),
                    ..Profile::NORMATIVE
                };
                let values = [0; 4].map(|_| random.within(format.min_value(), format.max_value()));
                let fractions = [x, y].map(|phase: u32| phase << (subtexel_bits - 4));
                let expected = lerp_input(values, fractions, format, input_bits, &profile);
                let found = number::interpolate(
                    &profile,
                    values.map(i128::from),
                    [i128::from(x), i128::from(y)],
                    latent_bits,
                    input_bits,
                );
                assert_eq!(
                    found,
                    i128::from(expected),
                    "{} {values:?}",
                    interpolate.name()
                );
                let corner = corner_input(values[0], format, input_bits, profile.input);
                let one = number::power(u32::from(latent_bits));
                let found = number::input(i128::from(values[0]), one, input_bits, profile.input);
                assert_eq!(found, i128::from(corner));
            }
        }
    }
}

#[test]
fn every_half_has_the_specifications_gelu_and_integers() {
    for half in halves() {
        let (number, host) = (Number::from_half(half), half.to_f32());
        for is_clamped in [false, true] {
            let expected = half::activation::hard_gelu(host, is_clamped);
            let found = number.hard_gelu(is_clamped);
            assert_eq!(found.single_bits(), expected.to_bits(), "{host}");
        }
        for (mode, (factor, exponent)) in Rounding::ALL
            .into_iter()
            .flat_map(|mode| [(1, -16), (1, 0), (1, 24), (127, 0), (65_535, 0)].map(|s| (mode, s)))
        {
            let expected = half::to_integer(host, factor, exponent, mode);
            let found = number.to_integer(i128::from(factor), exponent, mode);
            assert_eq!(found, i128::from(expected), "{host}");
        }
    }
}

#[test]
fn every_lane_of_every_width_is_the_same_half() {
    for bits in 4..=16_u8 {
        let (low, high) = signed_range(bits);
        for (value, zero_point) in (low..=high).flat_map(|v| [low, -1, 0, high].map(|z| (v, z))) {
            let real = Number {
                exponent: 1 - i32::from(bits),
                ..Number::integer(i128::from(value - zero_point))
            };
            let expected = integer_as_half(value as i16, bits, zero_point as i16);
            assert_eq!(real.to_half().0.half_bits(), expected.bits());
        }
    }
}

#[test]
fn a_million_sums_of_f32_and_fp16_are_rounded_as_the_host_and_the_specification_do() {
    let mut random = Random::new(3);
    let mut any = || loop {
        let half = Half::from_bits(random.bits() as u16);
        if half.is_finite() {
            return half;
        }
    };
    for _ in 0..500_000 {
        let (a, b, c, d) = (any(), any(), any(), any());
        let product = Number::from_half(a).times(Number::from_half(b));
        // A sum of products that is no half itself: as on the way through a layer.
        let held = c.to_f32() * d.to_f32() + d.to_f32();
        let sum = single(held).plus(product).to_single();
        let host = held + a.to_f32() * b.to_f32();
        assert_eq!(sum.single_bits(), host.to_bits(), "{a:?} {b:?} {c:?} {d:?}");
        assert_eq!(
            single(host).to_half().0.half_bits(),
            Half::round(host).bits()
        );
        let fused = product.plus(Number::from_half(c)).to_half().0;
        assert_eq!(fused.half_bits(), a.fused(b, c).bits());
    }
}

/// A module's lines, without its tests.
fn lines(path: &Path) -> Vec<String> {
    let text = std::fs::read_to_string(path).unwrap();
    let code = text.split("#[cfg(test)]").next().unwrap().to_owned();
    let code = code
        .lines()
        .filter(|line| !line.trim_start().starts_with("//"));
    code.map(str::to_owned).collect()
}

/// Data and enums may be read; what computes may not be called.
#[test]
fn neither_the_naive_evaluation_nor_the_oracle_calls_arithmetic_of_the_specification() {
    let calls = [
        ".apply(",
        ".shift(",
        ".dot(",
        ".to_f32(",
        ".fused(",
        "Half::round",
        "from_fixed",
        ".bilinear(",
        ".linear(",
        ".resolve(",
        ".value(",
        ".code(",
        "lerp_input",
        "corner_input",
        "wave_input",
        "level_input",
        "AxisPosition",
        "signed_range",
        "integer_as_half",
        "gate_argument(a as",
        "saturate(",
    ];
    let mut files = 0;
    for folder in ["naive", "oracle"] {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("src")
            .join(folder);
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                // Tests of a module may compare with what they like.
                continue;
            }
            files += 1;
            for line in lines(&path) {
                // A multiplier's own number.
                let line = line
                    .replace("multiplier.shift()", "")
                    .replace("scale.shift()", "");
                let found = calls.iter().find(|call| line.contains(**call));
                assert_eq!(found, None, "{}: {line}", path.display());
                // What is imported are types and constants of the data, whose names are capital.
                if let Some(name) = line.strip_prefix("use ntmu_isa::") {
                    let name = name.rsplit("::").next().unwrap();
                    let first = name.trim_start_matches('{').chars().next().unwrap();
                    assert!(first.is_uppercase(), "{}: {line}", path.display());
                }
                let is_naive = path.parent().unwrap().ends_with("naive");
                let is_float = ["f32", "f64"].iter().any(|float| line.contains(float));
                assert!(!(is_naive && is_float), "{}: {line}", path.display());
            }
        }
    }
    assert!(files >= 9, "{files}");
}
