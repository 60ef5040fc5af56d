//! The predicted root mean square is about the observed one.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use ntmu_conformance::claims;
use ntmu_conformance::synthetic::{self, Spec, SpecActivation, SpecKind, interpolated};
use ntmu_isa::filter::FilterRule;
use ntmu_isa::half::SumOrder;
use ntmu_isa::profile::NamedProfile;
use ntmu_isa::rescale::Requantizer;
use ntmu_isa::round::Rounding;
use ntmu_isa::shape::OutputFormat;
use ntmu_model::Request;

/// The typical error is there to decide bits: for integer layers it is right to half a bit.
const HALF_A_BIT: f64 = std::f64::consts::SQRT_2;
/// What is claimed of every arithmetic: one bit.
const ONE_BIT: f64 = 2.0;

fn spec(activation: SpecActivation) -> Spec {
    let mut spec = Spec::small(48, 48);
    spec.activation = activation;
    spec.hidden = vec![16];
    spec.blocks = 2;
    spec
}

fn check(name: &str, spec: &Spec, factor: f64) {
    let asset = synthetic::asset(spec, 11).unwrap();
    let requests: Vec<Request> = Request::blocks(&asset.shape, 0).step_by(3).collect();
    let findings = claims::findings(&asset, &requests);
    assert!(findings.hold(), "{name}");
    assert_eq!(findings.overflowing, 0, "{name}");
    for (index, channel) in findings.channels.iter().enumerate() {
        let ratio = channel.observed_rms / channel.predicted_rms;
        assert!(
            (1.0 / factor..factor).contains(&ratio),
            "{name} channel {index}: {ratio}, {channel:?}"
        );
    }
}

#[test]
fn integer_layers_are_predicted_to_half_a_bit() {
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
        let mut spec = spec(activation);
        spec.profile.requantize = requantizer;
        check(requantizer.name(), &spec, HALF_A_BIT);
    }
}

#[test]
fn every_other_activation_and_width_is_predicted_to_a_bit() {
    check("table", &spec(SpecActivation::Table), ONE_BIT);
    check("gelu 3", &spec(SpecActivation::ClampedGelu), ONE_BIT);
    check(
        "sixteen bits",
        &spec(SpecActivation::Relu).with_bits(8, 16),
        ONE_BIT,
    );
    check(
        "five bits",
        &spec(SpecActivation::Leaky(2)).with_bits(8, 5),
        ONE_BIT,
    );
}

#[test]
fn fp16_layers_are_predicted_to_a_bit_in_every_order() {
    for sum in SumOrder::ALL {
        for activation in [
            SpecActivation::Identity,
            SpecActivation::Relu,
            SpecActivation::Leaky(3),
            SpecActivation::HardGelu,
        ] {
            let mut spec = spec(activation).with_halves();
            spec.profile.sum = sum;
            spec.shape.outputs = vec![OutputFormat::Unorm16, OutputFormat::Float16];
            let name = format!("{} {activation:?}", sum.name());
            check(&name, &spec, ONE_BIT);
        }
    }
}

#[test]
fn mixed_layers_are_predicted_to_a_bit() {
    let mut spec = spec(SpecActivation::Relu);
    spec.kinds = vec![
        SpecKind::Half { quantize: None },
        SpecKind::Half { quantize: Some(8) },
        SpecKind::Integer {
            weight_bits: 8,
            output_bits: 10,
        },
    ];
    spec.shape.outputs = vec![OutputFormat::Unorm16, OutputFormat::Float16];
    for convert in Rounding::ALL {
        spec.profile.convert = convert;
        check(convert.name(), &spec, ONE_BIT);
    }
}

#[test]
fn interpolations_are_predicted_to_a_bit() {
    for interpolate in FilterRule::ALL {
        let mut spec = spec(SpecActivation::Identity);
        // Nothing but inputs and one layer in sixteen bits.
        (spec.hidden, spec.blocks) = (Vec::new(), 0);
        spec.shape.grids = [interpolated(6, 8, 3), interpolated(8, 6, 3)];
        spec.shape.outputs = vec![OutputFormat::Unorm16; 2];
        spec.profile.interpolate = interpolate;
        for subtexel_bits in [4, 8] {
            spec.profile.subtexel_bits = subtexel_bits;
            check(interpolate.name(), &spec, ONE_BIT);
        }
    }
}

#[test]
fn every_named_profile_is_predicted_to_a_bit() {
    for named in NamedProfile::all().unwrap() {
        let mut spec = spec(SpecActivation::Leaky(3));
        spec.profile = named.profile;
        check(&named.name, &spec, ONE_BIT);
        check(&named.name, &spec.with_halves(), ONE_BIT);
    }
}
