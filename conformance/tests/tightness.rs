//! Bounds are reached, or nearly: a bound that nothing comes near cannot fail.

use ntmu_conformance::bound::{self, stage, typical};
use ntmu_conformance::histogram::Histogram;
use ntmu_conformance::oracle::reals;
use ntmu_conformance::suite;
use ntmu_conformance::synthetic::{self, Spec, SpecActivation, SpecScale, grid};
use ntmu_conformance::vector::{Answer, Query};
use ntmu_conformance::{Oracle, bound::worst};
use ntmu_isa::layout::Layout;
use ntmu_isa::profile::Profile;
use ntmu_isa::rescale::{Multiplier, Requantizer};
use ntmu_isa::round::Rounding;
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
    let program = Program::compile(asset, Layout::Linear);
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
    spec.shape.grids = [grid(2, 8, 3), grid(3, 8, 3)];
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
                &reals(&taps.inputs),
                &oracle.inputs(request),
                &stage::inputs(&asset),
            )
        });
        let leaks = largest(&asset, |oracle, _, taps| {
            let accumulators = reals(&taps.layers[0].accumulators);
            let bounds = stage::activated(&asset, 0, &accumulators);
            let real = oracle.activated(0, &accumulators);
            quotient(&reals(&taps.layers[0].activated), &real, &bounds)
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
        let accumulators = reals(&taps.layers[0].accumulators);
        let bounds = stage::activated(&asset, 0, &accumulators);
        quotient(
            &reals(&taps.layers[0].activated),
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
        let activated = reals(&taps.layers[2].activated);
        let source = reals(&taps.layers[0].outputs);
        let bounds = stage::outputs(&asset, 2, &activated, Some(&source));
        let real = oracle.outputs(2, &activated, Some(&source));
        quotient(&reals(&taps.layers[2].outputs), &real, &bounds)
    });
    assert!((0.95..=1.0).contains(&most), "{most}");
}

#[test]
fn without_hidden_layers_the_end_to_end_bound_is_nearly_reached() {
    let mut spec = Spec::small(64, 64);
    spec.hidden = Vec::new();
    // One latent per grid, two inputs that round: the weights cannot all conspire, but two can.
    spec.shape.grids = [grid(1, 4, 3), grid(1, 8, 3)];
    let asset = synthetic::asset(&spec, 5).unwrap();
    let mut histogram = Histogram::default();
    let most = largest(&asset, |oracle, request, taps| {
        let real = oracle.taps(request);
        quotient(
            &reals(&taps.codes),
            &real.channels,
            &worst::texel(oracle, &real),
        )
    });
    let program = Program::compile(&asset, Layout::Linear);
    let (decoder, oracle) = (Decoder::new(&asset, &program), Oracle::new(&asset));
    for request in Request::blocks(&asset.shape, 0) {
        histogram.record(
            request,
            &decoder.texel(request, &mut ()),
            &oracle.texel(request),
        );
    }
    assert!((0.8..=1.0).contains(&most), "{most}");
    assert_eq!(histogram.samples, 2 * 64 * 64);
    assert_eq!(histogram.counts.values().sum::<u64>(), histogram.samples);
    assert!(histogram.rms() < histogram.max);
}

/// The typical error is there to decide bits: it must be right to half a bit, a factor of √2.
const HALF_A_BIT: f64 = std::f64::consts::SQRT_2;

#[test]
fn the_typical_error_predicts_the_observed_one_to_half_a_bit() {
    let activations = [
        SpecActivation::Identity,
        SpecActivation::Relu,
        SpecActivation::Leaky(3),
        SpecActivation::HardGelu,
    ];
    for (activation, requantizer) in activations.into_iter().zip([
        Requantizer::Single,
        Requantizer::Double,
        Requantizer::HalfEven,
        Requantizer::Narrow,
    ]) {
        let mut spec = Spec::small(48, 48);
        spec.activation = activation;
        spec.hidden = vec![16];
        spec.blocks = 2;
        spec.profile.requantize = requantizer;
        let asset = synthetic::asset(&spec, 11).unwrap();
        let program = Program::compile(&asset, Layout::Linear);
        let (decoder, oracle) = (Decoder::new(&asset, &program), Oracle::new(&asset));
        let requests: Vec<Request> = Request::blocks(&asset.shape, 0).collect();
        let expected = typical::rms(&oracle, &requests);
        let mut observed = vec![Histogram::default(); expected.len()];
        for &request in &requests {
            let (codes, reals) = (decoder.texel(request, &mut ()), oracle.texel(request));
            for (channel, histogram) in observed.iter_mut().enumerate() {
                histogram.record_channel(request, channel, codes[channel], reals[channel]);
            }
        }
        for (expected, observed) in expected.iter().zip(&observed) {
            let ratio = observed.rms() / expected;
            let name = requantizer.name();
            assert!(
                (1.0 / HALF_A_BIT..HALF_A_BIT).contains(&ratio),
                "{activation:?} {name}: {ratio}"
            );
        }
    }
}
