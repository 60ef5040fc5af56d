//! Synthetic assets: valid, deterministic, and exercising what they are for.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use ntmu_conformance::Oracle;
use ntmu_conformance::synthetic::{self, Spec, SpecActivation, SpecKind, arbitrary_spec};
use ntmu_isa::Asset;
use ntmu_isa::accumulate::Overflow;
use ntmu_isa::embed::Wave;
use ntmu_isa::filter::FilterRule;
use ntmu_isa::half::SumOrder;
use ntmu_isa::position::{AddressMode, CornerSnap};
use ntmu_isa::profile::Profile;
use ntmu_isa::rescale::Requantizer;
use ntmu_isa::round::Rounding;
use ntmu_isa::shape::{LaneFormat, OutputFormat};
use ntmu_model::Request;
use std::collections::BTreeSet;

#[test]
fn the_same_spec_and_seed_give_the_same_bytes_and_another_seed_others() {
    for seed in 0..20 {
        let spec = arbitrary_spec(seed);
        let bytes = |seed| synthetic::asset(&spec, seed).unwrap().to_bytes();
        assert_eq!(bytes(seed), bytes(seed));
        assert_ne!(bytes(seed), bytes(seed + 1));
        assert_eq!(
            Asset::from_bytes(&bytes(seed)).unwrap().to_bytes(),
            bytes(seed)
        );
    }
}

#[test]
fn six_hundred_seeds_cover_every_choice() {
    let specs: Vec<_> = (0..600).map(arbitrary_spec).collect();
    let all = |values: BTreeSet<String>, count: usize, what: &str| {
        assert_eq!(values.len(), count, "{what}: {values:?}");
    };
    let names = |of: &dyn Fn(&Spec) -> String| specs.iter().map(of).collect();
    all(
        names(&|s| s.shape.snap.name().into()),
        CornerSnap::ALL.len(),
        "snap",
    );
    all(
        names(&|s| s.shape.address_mode.name().into()),
        AddressMode::ALL.len(),
        "address mode",
    );
    all(
        names(&|s| s.shape.outputs[0].name().into()),
        OutputFormat::ALL.len(),
        "output",
    );
    all(
        names(&|s| s.profile.input.name().into()),
        Rounding::ALL.len(),
        "input",
    );
    all(
        names(&|s| s.profile.leak.name().into()),
        Rounding::ALL.len(),
        "leak",
    );
    all(
        names(&|s| s.profile.requantize.name().into()),
        Requantizer::ALL.len(),
        "requantize",
    );
    all(
        names(&|s| s.profile.skip.name().into()),
        Requantizer::ALL.len(),
        "skip",
    );
    all(
        names(&|s| s.profile.output.name().into()),
        Requantizer::ALL.len(),
        "output",
    );
    all(names(&|s| s.shape.octaves.to_string()), 4, "octaves");
    all(
        names(&|s| s.shape.wave.name().into()),
        Wave::ALL.len(),
        "wave",
    );
    all(names(&|s| s.shape.padding.to_string()), 16, "padding");
    all(names(&|s| s.shape.input_bits.to_string()), 13, "input bits");
    all(
        names(&|s| s.profile.interpolate.name().into()),
        FilterRule::ALL.len(),
        "interpolate",
    );
    all(
        names(&|s| s.profile.filter.name().into()),
        FilterRule::ALL.len(),
        "filter",
    );
    all(
        names(&|s| s.profile.sum.name().into()),
        SumOrder::ALL.len(),
        "sum",
    );
    all(
        names(&|s| s.profile.convert.name().into()),
        Rounding::ALL.len(),
        "convert",
    );
    all(
        names(&|s| s.profile.accumulator.overflow.name().into()),
        Overflow::ALL.len(),
        "overflow",
    );
    all(
        names(&|s| s.profile.accumulator.bits.to_string()),
        17,
        "accumulator bits",
    );
    all(names(&|s| s.profile.bias_bits.to_string()), 25, "bias bits");
    all(
        names(&|s| s.profile.residual_bits.to_string()),
        25,
        "residual bits",
    );
    all(
        names(&|s| s.profile.subtexel_bits.to_string()),
        9,
        "subtexel bits",
    );
    let kinds = || specs.iter().flat_map(|s| s.kinds.iter().copied());
    for bits in 2..=8 {
        let has =
            |kind| matches!(kind, SpecKind::Integer { weight_bits, .. } if weight_bits == bits);
        assert!(kinds().any(has), "weights of {bits} bits");
    }
    for bits in 4..=16 {
        let has =
            |kind| matches!(kind, SpecKind::Integer { output_bits, .. } if output_bits == bits);
        assert!(kinds().any(has), "outputs of {bits} bits");
        let has = |kind| {
            kind == SpecKind::Half {
                quantize: Some(bits),
            }
        };
        assert!(kinds().any(has), "halves into {bits} bits");
    }
    let assets: Vec<Asset> = (0..)
        .zip(&specs)
        .map(|(seed, spec)| synthetic::asset(spec, seed).unwrap())
        .collect();
    // Neighbours of both kinds, and skip paths of both.
    let pairs = || assets.iter().flat_map(|a| a.layers.windows(2));
    for (before, after) in [(true, true), (true, false), (false, true), (false, false)] {
        let found = pairs()
            .any(|pair| (pair[0].half().is_some(), pair[1].half().is_some()) == (before, after));
        assert!(found, "fp16: {before}, then {after}");
    }
    for is_half in [true, false] {
        let mut layers = assets.iter().flat_map(|a| &a.layers);
        assert!(layers.any(|l| l.skip.is_some() && l.half().is_some() == is_half));
    }
    for g in 0..2 {
        all(
            names(&|s| s.shape.grids[g].sampling.name().into()),
            2,
            "sampling",
        );
        all(
            names(&|s| s.shape.grids[g].format.bits().to_string()),
            8,
            "bits",
        );
        all(
            names(&|s| s.shape.grids[g].scale_log2.to_string()),
            3,
            "scale",
        );
    }
    // A single level, and every pyramid that the longest of these chains can show.
    all(
        names(&|s| format!("{:?}", s.shape.pyramid)),
        1 + 21,
        "pyramid",
    );
    let levels = |s: &Spec| s.shape.level_count().to_string();
    all(names(&levels), 7, "levels");
    all(names(&|s| s.blocks.to_string()), 4, "blocks");
    all(names(&|s| s.block_span.to_string()), 3, "span");
    all(names(&|s| s.hidden.len().to_string()), 4, "hidden layers");
    all(names(&|s| format!("{:?}", s.scale)), 3, "scale");
    // Identity, ReLU, two hard GELUs, a table, and seven slopes of a leaky ReLU.
    all(names(&|s| format!("{:?}", s.activation)), 12, "activation");
    assert!(
        specs
            .iter()
            .any(|s| s.activation == SpecActivation::Leaky(7))
    );
}

/// Lanes that never change over a chain, and the share of saturated activations.
#[test]
fn activations_use_their_range_and_channels_vary() {
    let (mut lanes, mut wide, mut values, mut saturated) = (0, 0, 0, 0);
    for seed in 0..60 {
        let mut spec = arbitrary_spec(seed);
        (spec.shape.width, spec.shape.height) = (24, 24);
        spec.shape.mip_count = 5;
        // What is cut off by narrow sums, biases or inputs is not fitted.
        (spec.profile, spec.shape.input_bits) = (Profile::NORMATIVE, 8);
        spec.reach = 0;
        let asset = synthetic::asset(&spec, seed).unwrap();
        let oracle = Oracle::new(&asset);
        let requests: Vec<Request> = (0..5)
            .flat_map(|mip| Request::blocks(&asset.shape, mip))
            .step_by(5)
            .collect();
        let taps: Vec<_> = requests
            .iter()
            .map(|&request| oracle.taps(request))
            .collect();
        for channel in 0..asset.shape.outputs.len() {
            let (low, high) = span(taps.iter().map(|t| t.channels[channel]));
            // Of 255 codes, or of the 2048 steps of fp16 between −1 and 1.
            assert!(
                high - low >= 16.0,
                "seed {seed} channel {channel}: {low}..{high}"
            );
        }
        for layer in 0..asset.layers.len() - 1 {
            for row in 0..usize::from(asset.layers[layer].outputs) {
                let (low, high) = span(taps.iter().map(|t| t.layers[layer].outputs[row]));
                // An integer's own range; sums of fp16 layers reach about 1 here.
                let (range, top) = match asset.layers[layer].output_format() {
                    LaneFormat::Integer { bits, .. } => {
                        let steps = 2_f64.powi(i32::from(bits));
                        (steps, steps / 2.0 - 1.0)
                    }
                    LaneFormat::Half => (2.0, 65_504.0),
                };
                lanes += 1;
                wide += usize::from(high - low >= range / 4.0);
                values += taps.len();
                let edge =
                    |t: &ntmu_conformance::oracle::RealTaps| t.layers[layer].outputs[row] == top;
                saturated += taps.iter().filter(|t| edge(t)).count();
            }
        }
    }
    // Three quarters of the lanes use at least a quarter of their range; saturation happens, and
    // is the exception.
    assert!(wide * 4 >= lanes * 3, "{wide} of {lanes}");
    assert!(
        saturated > 0 && saturated * 10 < values,
        "{saturated} of {values}"
    );
}

fn span(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
        (low.min(v), high.max(v))
    })
}

#[test]
fn a_spec_outside_the_limits_is_refused_by_name() {
    let refused = |change: &dyn Fn(&mut Spec)| {
        let mut spec = Spec::small(8, 8);
        change(&mut spec);
        synthetic::asset(&spec, 1).unwrap_err().to_string()
    };
    assert!(refused(&|s| s.shape.width = 0).starts_with("shape.width"));
    assert!(refused(&|s| s.shape.outputs.clear()).starts_with("shape.channels"));
    let bits = |weight, output| move |s: &mut Spec| *s = s.clone().with_bits(weight, output);
    assert!(refused(&bits(0, 8)).starts_with("spec.weight_bits"));
    assert!(refused(&bits(8, 3)).starts_with("spec.output_bits"));
    assert!(refused(&|s| s.reach = 16).starts_with("spec.reach"));
    assert!(refused(&|s| s.profile.lod_bits = 9).starts_with("profile.lod_bits"));
    assert!(refused(&|s| s.block_span = 0).starts_with("spec.block_span"));
    assert!(refused(&|s| s.hidden = vec![0]).starts_with("spec.hidden"));
    assert!(refused(&|s| s.hidden = vec![1; 64]).starts_with("spec.layers"));
    assert!(refused(&|s| s.activation = SpecActivation::Leaky(8)).contains("leak_shift"));
}
