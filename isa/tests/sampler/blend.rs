use ntmu_isa::filter::FilterRule;
use ntmu_isa::half::Half;
use ntmu_isa::profile::Profile;
use ntmu_isa::round::Rounding;
use ntmu_isa::sampler::blend::{Corners, blend};
use ntmu_isa::sampler::plan::Probe;
use ntmu_isa::shape::OutputFormat;
use proptest::prelude::*;

const FORMATS: [OutputFormat; 4] = OutputFormat::ALL;

fn profile(filter: FilterRule, filter_rounding: Rounding, bits: u8, lod_bits: u8) -> Profile {
    Profile {
        subtexel_bits: bits,
        lod_bits,
        filter,
        filter_rounding,
        ..Profile::NORMATIVE
    }
}

/// A code of a format from any number; halves are finite.
fn code(format: OutputFormat, seed: u16) -> i32 {
    let (low, high) = format.range();
    match format {
        OutputFormat::Unorm8 | OutputFormat::Unorm16 | OutputFormat::Snorm8 => {
            low + i32::from(seed) % (high - low + 1)
        }
        OutputFormat::Float16 => {
            let half = Half::from_bits(seed);
            i32::from(if half.is_finite() {
                seed
            } else {
                seed & 0x83ff
            })
        }
    }
}

/// Codes in the order of their reals.
fn real(format: OutputFormat, code: i32) -> f32 {
    match format {
        OutputFormat::Unorm8 | OutputFormat::Unorm16 | OutputFormat::Snorm8 => code as f32,
        OutputFormat::Float16 => Half::from_bits(code as u16).to_f32(),
    }
}

fn any_probe(bits: u8, lod_bits: u8) -> impl Strategy<Value = ([u16; 8], [u32; 4], u32)> {
    let one = 1_u32 << bits;
    let fraction = 0..1_u32 << lod_bits;
    (
        any::<[u16; 8]>(),
        [0..one, 0..one, 0..one, 0..one],
        fraction,
    )
}

fn probe(format: OutputFormat, (seeds, f, fraction): &([u16; 8], [u32; 4], u32)) -> Probe<Corners> {
    let codes = seeds.map(|seed| code(format, seed));
    let corners = |from: usize, fractions| Corners {
        codes: [0, 1, 2, 3].map(|i| codes[from + i]),
        fractions,
    };
    Probe {
        near: corners(0, [f[0], f[1]]),
        far: (*fraction > 0).then(|| corners(4, [f[2], f[3]])),
        fraction: *fraction,
    }
}

/// The codes that have any weight.
fn weighted_codes(probe: &Probe<Corners>) -> Vec<i32> {
    let mut codes = Vec::new();
    for corners in [Some(probe.near), probe.far].into_iter().flatten() {
        let [x, y] = corners.fractions.map(|fraction| fraction > 0);
        for (code, counts) in corners.codes.into_iter().zip([true, x, y, x && y]) {
            if counts {
                codes.push(code);
            }
        }
    }
    codes
}

proptest! {
    #[test]
    fn a_sample_lies_within_the_codes_that_it_is_made_of(
        parts in prop::collection::vec(any_probe(6, 5), 1..=16),
        format in 0_usize..4,
        rounding in 0_usize..4,
        rule in 0_usize..4,
    ) {
        let (format, rounding, rule) = (FORMATS[format], Rounding::ALL[rounding], FilterRule::ALL[rule]);
        let probes: Vec<_> = parts.iter().map(|part| probe(format, part)).collect();
        let result = blend(&probes, format, &profile(rule, rounding, 6, 5));
        let reals: Vec<f32> = probes.iter().flat_map(weighted_codes).map(|c| real(format, c)).collect();
        let low = reals.iter().copied().fold(f32::INFINITY, f32::min);
        let high = reals.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        prop_assert!((low..=high).contains(&real(format, result)), "{result} in {low}..={high}");
    }

    #[test]
    fn a_constant_stays(
        parts in prop::collection::vec(any_probe(8, 8), 1..=16),
        seed in any::<u16>(),
        format in 0_usize..4,
        rounding in 0_usize..4,
        rule in 0_usize..4,
    ) {
        let (format, rounding, rule) = (FORMATS[format], Rounding::ALL[rounding], FilterRule::ALL[rule]);
        let probes: Vec<_> = parts.iter().map(|(_, f, l)| probe(format, &([seed; 8], *f, *l))).collect();
        prop_assert_eq!(blend(&probes, format, &profile(rule, rounding, 8, 8)), code(format, seed));
    }

    #[test]
    fn the_exact_rule_is_the_nearest_code_to_the_real(
        parts in prop::collection::vec(any_probe(4, 4), 1..=16),
        format in 0_usize..3,
    ) {
        let format = FORMATS[format];
        let probes: Vec<_> = parts.iter().map(|part| probe(format, part)).collect();
        // Codes of 16 bits times 12 bits of weights: f64 holds every sum exactly.
        let mut sum = 0.0;
        for p in &probes {
            let square = |c: &Corners| -> f64 {
                let [x, y] = c.fractions.map(|f| f64::from(f) / 16.0);
                let t = c.codes.map(f64::from);
                (t[0] * (1.0 - x) + t[1] * x) * (1.0 - y) + (t[2] * (1.0 - x) + t[3] * x) * y
            };
            let l = f64::from(p.fraction) / 16.0;
            sum += square(&p.near) * (1.0 - l) + p.far.as_ref().map_or(0.0, square) * l;
        }
        let real = sum / probes.len() as f64;
        let result = blend(&probes, format, &profile(FilterRule::Exact, Rounding::HalfUp, 4, 4));
        prop_assert!((f64::from(result) - real).abs() <= 0.5 + 1e-9, "{} for {}", result, real);
    }

    #[test]
    fn halves_go_to_the_nearest_half(
        parts in prop::collection::vec(any_probe(4, 4), 1..=16),
        exponents in 0_u16..28,
    ) {
        // Exponents of at most three neighbours: the sum has below 53 bits and f64 holds it exactly.
        let format = OutputFormat::Float16;
        let near = |seed: &u16| seed & 0x83ff | (exponents + (seed >> 10) % 3) << 10;
        let probes: Vec<_> = parts
            .iter()
            .map(|(seeds, f, l)| {
                let mut p = probe(format, &([0; 8], *f, *l));
                for (i, seed) in seeds.iter().enumerate() {
                    let code = i32::from(near(seed));
                    match (i / 4, p.far.as_mut()) {
                        (0, _) => p.near.codes[i] = code,
                        (_, Some(far)) => far.codes[i - 4] = code,
                        (_, None) => {}
                    }
                }
                p
            })
            .collect();
        let mut sum = 0.0_f64;
        for p in &probes {
            let square = |c: &Corners| -> f64 {
                let [x, y] = c.fractions.map(|f| f64::from(f) / 16.0);
                let t = c.codes.map(|code| f64::from(real(format, code)));
                (t[0] * (1.0 - x) + t[1] * x) * (1.0 - y) + (t[2] * (1.0 - x) + t[3] * x) * y
            };
            let l = f64::from(p.fraction) / 16.0;
            sum += square(&p.near) * (1.0 - l) + p.far.as_ref().map_or(0.0, square) * l;
        }
        let bits = blend(&probes, format, &profile(FilterRule::Exact, Rounding::Floor, 4, 4));
        let found = f64::from(real(format, bits));
        // Compared times the number of probes, where all of it is exact.
        let count = probes.len() as f64;
        let distance = |half: f64| (half * count - sum).abs();
        let magnitude = bits & 0x7fff;
        let sign = bits & 0x8000;
        for neighbour in [magnitude - 1, magnitude + 1] {
            if (0..0x7c00).contains(&neighbour) {
                let other = f64::from(real(format, sign | neighbour));
                prop_assert!(distance(found) <= distance(other));
                if distance(found) == distance(other) {
                    prop_assert_eq!(bits & 1, 0, "a tie goes to the even half");
                }
            }
        }
    }
}

#[test]
fn the_exact_rule_is_monotone_in_every_fraction() {
    let corner_sets = [
        [0, 255, 200, 0],
        [9, 17, 255, 3],
        [255, 0, 40, 250],
        [30, 60, 90, 0],
    ];
    for rounding in Rounding::ALL {
        let profile = profile(FilterRule::Exact, rounding, 6, 6);
        for (codes, y) in corner_sets
            .into_iter()
            .flat_map(|c| (0..64).map(move |y| (c, y)))
        {
            let level = |fraction, fractions| {
                let far = Corners {
                    codes: [codes[3], codes[0], codes[1], codes[2]],
                    fractions: [9, 40],
                };
                let probe = Probe {
                    near: Corners { codes, fractions },
                    far: (fraction > 0).then_some(far),
                    fraction,
                };
                blend(&[probe], OutputFormat::Unorm8, &profile)
            };
            assert!(is_monotone((0..64).map(|x| level(0, [x, y]))), "u at {y}");
            assert!(is_monotone((0..64).map(|x| level(0, [y, x]))), "v at {y}");
            assert!(
                is_monotone((0..64).map(|l| level(l, [y, 13]))),
                "level at {y}"
            );
        }
    }
}

fn is_monotone(codes: impl Iterator<Item = i32>) -> bool {
    let codes: Vec<i32> = codes.collect();
    let steps = || codes.windows(2).map(|w| w[1] - w[0]);
    !(steps().any(|s| s > 0) && steps().any(|s| s < 0))
}

#[test]
fn every_other_rule_has_a_row_that_rises_and_falls() {
    let turns = |rule: FilterRule, codes: [i32; 4]| {
        let profile = profile(rule, Rounding::HalfUp, 8, 8);
        (0..256).any(|y| {
            !is_monotone((0..256).map(|x| {
                let near = Corners {
                    codes,
                    fractions: [x, y],
                };
                blend(&[Probe::one(near)], OutputFormat::Unorm8, &profile)
            }))
        })
    };
    let sets = [
        [9, 17, 255, 3],
        [0, 255, 255, 1],
        [255, 0, 40, 250],
        [0, 255, 200, 0],
    ];
    for (rule, expected) in [
        (FilterRule::Exact, false),
        (FilterRule::Factored, true),
        (FilterRule::Separable, true),
        (FilterRule::AllOnes, true),
    ] {
        let found = sets.iter().any(|&codes| turns(rule, codes));
        assert_eq!(found, expected, "{}", rule.name());
    }
}

#[test]
fn one_texel_alone_is_itself_by_every_rule() {
    for rule in FilterRule::ALL {
        let profile = profile(rule, Rounding::HalfEven, 8, 8);
        for format in FORMATS {
            for seed in 0..=u16::MAX {
                let code = code(format, seed);
                assert_eq!(
                    blend(&[Probe::one(Corners::one(code))], format, &profile),
                    code
                );
            }
        }
    }
}

#[test]
fn rules_that_round_between_steps_do_so_in_this_order() {
    let near = Corners {
        codes: [0, 1, 0, 1],
        fractions: [8, 0],
    };
    let far = Corners::one(0);
    let joined = Probe {
        near,
        far: Some(far),
        fraction: 8,
    };
    let other = Probe::one(Corners::one(0));
    // Real: a half, then a quarter, then an eighth: one rounding gives 0. Step by step each tie goes
    // up: 1, then 1, then 1.
    let by = |rule| {
        let profile = profile(rule, Rounding::HalfUp, 4, 4);
        blend(&[joined, other], OutputFormat::Unorm8, &profile)
    };
    assert_eq!(by(FilterRule::Exact), 0);
    assert_eq!(by(FilterRule::Separable), 1);
}

#[test]
fn an_average_of_three_has_no_ties_and_of_six_has() {
    let probes = |codes: &[i32]| -> Vec<Probe<Corners>> {
        codes.iter().map(|&c| Probe::one(Corners::one(c))).collect()
    };
    let by = |codes: &[i32], rounding| {
        let profile = profile(FilterRule::Exact, rounding, 8, 8);
        blend(&probes(codes), OutputFormat::Snorm8, &profile)
    };
    assert_eq!(Rounding::ALL.map(|r| by(&[1, 1, 0], r)), [1, 1, 1, 0]);
    assert_eq!(
        Rounding::ALL.map(|r| by(&[1, 1, 1, 0, 0, 0], r)),
        [1, 0, 1, 0]
    );
    assert_eq!(
        Rounding::ALL.map(|r| by(&[-1, -1, -1, 0, 0, 0], r)),
        [0, 0, -1, -1]
    );
}

#[test]
fn zeros_of_halves_keep_a_sign_that_all_of_them_have() {
    let blend_of = |codes, fractions| {
        let near = Corners { codes, fractions };
        blend(
            &[Probe::one(near)],
            OutputFormat::Float16,
            &Profile::NORMATIVE,
        )
    };
    assert_eq!(blend_of([0x8000; 4], [7, 9]), 0x8000);
    assert_eq!(blend_of([0x8000, 0, 0x8000, 0], [7, 9]), 0);
    // A corner without weight has no say.
    assert_eq!(blend_of([0x8000, 0, 0x8000, 0], [0, 9]), 0x8000);
    // −x and +x cancel to +0; less than half of the smallest keeps its sign.
    assert_eq!(blend_of([0x8001, 0x0001, 0x8001, 0x0001], [128, 0]), 0);
    assert_eq!(blend_of([0x8001, 0, 0, 0], [250, 250]), 0x8000);
}
