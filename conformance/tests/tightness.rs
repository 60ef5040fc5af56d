//! Bounds are reached, or nearly: a bound that nothing comes near cannot fail.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use ntmu_conformance::bound::float::{self, Partial};
use ntmu_conformance::bound::{self, stage};
use ntmu_conformance::claims;
use ntmu_conformance::histogram::Histogram;
use ntmu_conformance::oracle::number;
use ntmu_conformance::suite;
use ntmu_conformance::synthetic::{self, Spec, SpecActivation, SpecScale, corners, interpolated};
use ntmu_conformance::vector::{Answer, Query};
use ntmu_conformance::{Oracle, bound::worst};
use ntmu_isa::filter::FilterRule;
use ntmu_isa::half::{Half, SumOrder};
use ntmu_isa::layout::Layout;
use ntmu_isa::profile::Profile;
use ntmu_isa::rescale::{Multiplier, Requantizer};
use ntmu_isa::round::Rounding;
use ntmu_isa::shape::OutputFormat;
use ntmu_isa::{Asset, Program};
use ntmu_model::Request;
use ntmu_model::exec::Decoder;
use std::collections::BTreeMap;

/// The exact distance of an answer from value·mantissa/2^shift, in LSB; none if it saturates.
fn distance(answer: i32, value: i32, mantissa: i32, shift: u8) -> Option<f64> {
    let product = i128::from(value) * i128::from(mantissa);
    let unit = 1_i128 << shift;
    let range = i128::from(i32::MIN) * unit..=i128::from(i32::MAX) * unit;
    let distance = i128::from(answer) * unit - product;
    range
        .contains(&product)
        .then(|| distance as f64 / unit as f64)
}

#[test]
fn every_requantiser_stays_within_its_bound_and_reaches_it() {
    let mut reached: BTreeMap<&str, f64> = BTreeMap::new();
    for case in &suite::rescale::suite().unwrap().cases {
        let (Query::Rescale(query), Some(Answer::Value(answer))) = (&case.request, &case.answer)
        else {
            panic!("{} is no rescaling", case.id);
        };
        let scale = Multiplier::new(query.mantissa, query.shift).unwrap();
        let bound = bound::requantize(query.requantizer, f64::from(query.value), scale);
        if let Some(found) = distance(*answer, query.value, query.mantissa, query.shift) {
            let found = found.abs();
            assert!(found <= bound, "{} {query:?}: {found} > {bound}", case.id);
            if bound > 0.0 {
                let most = reached.entry(query.requantizer.name()).or_default();
                *most = most.max(found / bound);
            }
        }
    }
    // A tie is at exactly half an LSB; the second rounding of `Double` reaches all of its ¾, and
    // a narrow multiplier its own error where the product is far larger than a rounding.
    for requantizer in Requantizer::ALL {
        let most = reached[requantizer.name()];
        let needed = if requantizer == Requantizer::Narrow {
            0.99
        } else {
            1.0
        };
        assert!(
            most >= needed,
            "{}: {most} of its bound",
            requantizer.name()
        );
    }
}

/// The largest |model − oracle| over its bound at one kind of stage of all texels of an asset.
fn largest(
    asset: &Asset,
    of: impl Fn(&Oracle<'_>, Request, &ntmu_model::exec::Taps) -> f64,
) -> f64 {
    let program = Program::compile(asset, Layout::LINEAR);
    let (decoder, oracle) = (Decoder::new(asset, &program), Oracle::new(asset));
    let mips = 0..asset.shape.mip_count;
    let requests = mips.flat_map(|mip| Request::blocks(&asset.shape, mip));
    requests
        .map(|r| of(&oracle, r, &decoder.taps(r)))
        .fold(0.0, f64::max)
}

/// The largest quotient over lanes; a bound of 0 must be kept exactly.
fn quotient(model: &[f64], oracle: &[f64], bounds: &[f64]) -> f64 {
    let lanes = model.iter().zip(oracle).zip(bounds);
    lanes
        .map(|((m, o), bound)| if m == o { 0.0 } else { (m - o).abs() / bound })
        .fold(0.0, f64::max)
}

fn spec(input: Rounding, leak: Rounding) -> Spec {
    let mut spec = Spec::small(32, 32);
    spec.shape.grids = [corners(2, 8, 3), interpolated(3, 8, 3)];
    spec.profile = Profile {
        input,
        leak,
        ..Profile::NORMATIVE
    };
    spec.activation = SpecActivation::Leaky(4);
    spec
}

#[test]
fn input_and_leak_roundings_come_within_a_hundredth_of_their_bounds() {
    for mode in Rounding::ALL {
        let asset = synthetic::asset(&spec(mode, mode), 5).unwrap();
        let inputs = largest(&asset, |oracle, request, taps| {
            quotient(
                &number::lanes(asset.shape.input_format(), &taps.inputs),
                &oracle.inputs(request),
                &stage::inputs(&asset),
            )
        });
        let leaks = largest(&asset, |oracle, _, taps| {
            let accumulators = number::sums(&asset.layers[0], &taps.layers[0].accumulators);
            let bounds = stage::activated(&asset, 0, &accumulators);
            let real = oracle.activated(0, &accumulators);
            quotient(
                &number::sums(&asset.layers[0], &taps.layers[0].activated),
                &real,
                &bounds,
            )
        });
        for most in [inputs, leaks] {
            assert!((0.99..=1.0).contains(&most), "{}: {most}", mode.name());
        }
    }
}

#[test]
fn a_gates_argument_rounding_comes_near_its_bound() {
    let mut spec = Spec::small(32, 32);
    spec.activation = SpecActivation::HardGelu;
    let asset = synthetic::asset(&spec, 5).unwrap();
    let most = largest(&asset, |oracle, _, taps| {
        let accumulators = number::sums(&asset.layers[0], &taps.layers[0].accumulators);
        let bounds = stage::activated(&asset, 0, &accumulators);
        quotient(
            &number::sums(&asset.layers[0], &taps.layers[0].activated),
            &oracle.activated(0, &accumulators),
            &bounds,
        )
    });
    assert!((0.98..=1.0).contains(&most), "{most}");
}

#[test]
fn a_skip_paths_two_roundings_come_near_one_lsb() {
    let mut spec = Spec::small(32, 32);
    spec.scale = SpecScale::PowerOfTwo;
    spec.activation = SpecActivation::Identity;
    let asset = synthetic::asset(&spec, 5).unwrap();
    let most = largest(&asset, |oracle, _, taps| {
        let activated = number::sums(&asset.layers[2], &taps.layers[2].activated);
        let source = number::lanes(asset.layers[0].output_format(), &taps.layers[0].outputs);
        let bounds = stage::outputs(&asset, 2, &activated, Some(&source));
        let real = oracle.outputs(2, &activated, Some(&source));
        quotient(
            &number::lanes(asset.layers[2].output_format(), &taps.layers[2].outputs),
            &real,
            &bounds,
        )
    });
    assert!((0.95..=1.0).contains(&most), "{most}");
}

#[test]
fn without_hidden_layers_the_end_to_end_bound_is_nearly_reached() {
    let mut spec = Spec::small(64, 64);
    spec.hidden = Vec::new();
    // One latent per grid, two inputs that round: the weights cannot all conspire, but two can.
    spec.shape.grids = [corners(1, 4, 3), interpolated(1, 8, 3)];
    let asset = synthetic::asset(&spec, 5).unwrap();
    let mut histogram = Histogram::default();
    let most = largest(&asset, |oracle, request, taps| {
        let real = oracle.taps(request);
        quotient(
            &oracle.code_units(&taps.codes),
            &real.channels,
            &worst::texel(oracle, &real),
        )
    });
    let program = Program::compile(&asset, Layout::LINEAR);
    let (decoder, oracle) = (Decoder::new(&asset, &program), Oracle::new(&asset));
    for request in Request::blocks(&asset.shape, 0) {
        histogram.record(
            request,
            &asset.shape.outputs,
            &decoder.texel(request, &mut ()),
            &oracle.texel(request),
        );
    }
    assert!((0.8..=1.0).contains(&most), "{most}");
    assert_eq!(histogram.samples, 2 * 64 * 64);
    assert_eq!(histogram.counts.values().sum::<u64>(), histogram.samples);
    assert!(histogram.rms() < histogram.max);
}

/// An fp16 sum of one product and a bias that lies between two f32 numbers.
#[test]
fn the_bound_of_one_f32_addition_is_reached() {
    let half = |real: f32| Half::round(real);
    // 2048 has a last place of 2^−12 in f32: 2^−13 is half of it, 3·2^−13 a tie too.
    for tie in [2_f32.powi(-13), 3.0 * 2_f32.powi(-13), -(2_f32.powi(-14))] {
        for order in SumOrder::ALL {
            let found = order.dot(half(2048.0), &[half(tie)], &[Half::ONE]);
            let real = 2048.0 + f64::from(tie);
            let product = [Partial::exact(f64::from(tie))].into_iter();
            let bound = float::dot(order, 2048.0, product).error;
            let distance = (f64::from(found) - real).abs();
            assert!(distance <= bound, "{}", order.name());
            if order != SumOrder::Fused {
                // The oracle's own 2^−52 is in the bound as well.
                assert!(
                    distance >= bound * (1.0 - 2_f64.powi(-20)),
                    "{}",
                    order.name()
                );
            }
        }
    }
    // fp16 at 2048 has steps of 2: a product of 1 is a tie.
    let found = SumOrder::Fused.dot(half(2048.0), &[Half::ONE], &[Half::ONE]);
    let product = [Partial::exact(1.0)].into_iter();
    let bound = float::dot(SumOrder::Fused, 2048.0, product).error;
    let distance = (f64::from(found) - 2049.0).abs();
    assert!(distance <= bound && distance >= bound * (1.0 - 2_f64.powi(-20)));
}

/// Every kind of stage of some fp16 layers, and how much of its bound is used.
#[test]
fn the_stages_of_fp16_layers_come_near_their_bounds() {
    let mut spec = Spec::small(32, 32).with_halves();
    spec.shape.outputs = vec![OutputFormat::Float16, OutputFormat::Unorm16];
    for sum in SumOrder::ALL {
        (spec.activation, spec.profile.sum) = (SpecActivation::Leaky(2), sum);
        let asset = synthetic::asset(&spec, 5).unwrap();
        let requests: Vec<Request> = Request::blocks(&asset.shape, 0).collect();
        let findings = claims::findings(&asset, &requests);
        assert!(findings.hold());
        let share = |stage: &str| findings.stages[stage].share();
        // Half an ulp, of lanes anywhere between two powers of two, and half a code.
        for stage in ["layer.outputs", "channels"] {
            assert!(
                share(stage) > 0.9,
                "{} {stage}: {}",
                sum.name(),
                share(stage)
            );
        }
        // Two dozen additions do not all round the same way; one fp16 rounding may be most of it.
        assert!(share("layer.accumulators") > 0.1, "{}", sum.name());
    }
    spec.activation = SpecActivation::HardGelu;
    let asset = synthetic::asset(&spec, 5).unwrap();
    let requests: Vec<Request> = Request::blocks(&asset.shape, 0).collect();
    let findings = claims::findings(&asset, &requests);
    assert!(findings.hold() && findings.stages["layer.activated"].share() > 0.3);
}

#[test]
fn interpolations_that_round_more_than_once_come_near_their_bounds() {
    for (interpolate, subtexel_bits) in [
        (FilterRule::Exact, 8),
        (FilterRule::Factored, 4),
        (FilterRule::Factored, 8),
        (FilterRule::Separable, 8),
        (FilterRule::AllOnes, 4),
        (FilterRule::AllOnes, 8),
    ] {
        let mut spec = spec(Rounding::HalfUp, Rounding::HalfUp);
        spec.shape.grids = [interpolated(8, 8, 3), interpolated(8, 8, 3)];
        spec.profile.interpolate = interpolate;
        spec.profile.subtexel_bits = subtexel_bits;
        let asset = synthetic::asset(&spec, 5).unwrap();
        let most = largest(&asset, |oracle, request, taps| {
            quotient(
                &number::lanes(asset.shape.input_format(), &taps.inputs),
                &oracle.inputs(request),
                &stage::inputs(&asset),
            )
        });
        // Several roundings, and corners at both ends of their range, have to meet.
        let needed = if interpolate == FilterRule::Exact {
            0.99
        } else {
            0.6
        };
        let name = interpolate.name();
        assert!(
            (needed..=1.0).contains(&most),
            "{name} {subtexel_bits}: {most}"
        );
    }
}

#[test]
fn a_table_takes_the_farthest_entry_that_its_bound_allows() {
    let mut spec = Spec::small(32, 32);
    spec.activation = SpecActivation::Table;
    let asset = synthetic::asset(&spec, 5).unwrap();
    let requests: Vec<Request> = Request::blocks(&asset.shape, 0).collect();
    let share = claims::findings(&asset, &requests).stages["layer.activated"].share();
    assert!((0.98..=1.0).contains(&share), "{share}");
}
