//! Devices that are the model with one rule changed: each is caught, at the stage that it breaks.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use ntmu_conformance::device::{Device, DeviceError, ModelDevice};
use ntmu_conformance::run;
use ntmu_conformance::stage::Taps;
use ntmu_conformance::suite;
use ntmu_isa::Asset;
use ntmu_isa::accumulate::Overflow;
use ntmu_isa::activation::Activation;
use ntmu_isa::asset::Parts;
use ntmu_isa::embed::Wave;
use ntmu_isa::filter::FilterRule;
use ntmu_isa::half::{Half, SumOrder};
use ntmu_isa::layer::Parameters;
use ntmu_isa::position::{AddressMode, CornerSnap};
use ntmu_isa::pyramid::Pyramid;
use ntmu_isa::rescale::Requantizer;
use ntmu_isa::round::Rounding;
use ntmu_isa::shape::OutputFormat;
use ntmu_model::Request;

type Change = fn(&mut Parts);

/// The model with one rule changed: it decodes an asset in which the rule is another.
struct Mutant {
    name: &'static str,
    change: Change,
}

impl Mutant {
    fn of(&self, asset: &Asset) -> Asset {
        let mut parts = asset.clone().into_parts();
        (self.change)(&mut parts);
        Asset::new(parts).expect("still valid")
    }
}

impl Device for Mutant {
    fn name(&self) -> String {
        self.name.to_owned()
    }

    fn texel_codes(
        &mut self,
        asset: &Asset,
        requests: &[Request],
    ) -> Result<Vec<Vec<i32>>, DeviceError> {
        ModelDevice.texel_codes(&self.of(asset), requests)
    }

    fn taps(&mut self, asset: &Asset, request: Request) -> Result<Taps, DeviceError> {
        ModelDevice.taps(&self.of(asset), request)
    }
}

/// Only where a layer's rule applies and the normative choice is made does the mutant differ.
fn swap(requantizer: &mut Requantizer, to: Requantizer) {
    if *requantizer == Requantizer::Single {
        *requantizer = to;
    }
}

/// What is changed, the part of a stage's name at which the device must part from the vectors first,
/// and the change.
const MUTANTS: &[(&str, &str, Change)] = &[
    ("input floor", "inputs", |p| {
        p.profile.input = Rounding::Floor
    }),
    ("input half-even", "inputs", |p| {
        p.profile.input = Rounding::HalfEven
    }),
    ("input half-away", "inputs", |p| {
        p.profile.input = Rounding::HalfAway
    }),
    ("leak floor", "activated", |p| {
        p.profile.leak = Rounding::Floor
    }),
    ("leak half-even", "activated", |p| {
        p.profile.leak = Rounding::HalfEven
    }),
    ("leak half-away", "activated", |p| {
        p.profile.leak = Rounding::HalfAway
    }),
    ("requantize double", "outputs", |p| {
        swap(&mut p.profile.requantize, Requantizer::Double)
    }),
    ("requantize half-even", "outputs", |p| {
        swap(&mut p.profile.requantize, Requantizer::HalfEven)
    }),
    ("requantize half-away", "outputs", |p| {
        swap(&mut p.profile.requantize, Requantizer::HalfAway)
    }),
    ("requantize narrow", "outputs", |p| {
        swap(&mut p.profile.requantize, Requantizer::Narrow)
    }),
    ("skip double", "outputs", |p| {
        swap(&mut p.profile.skip, Requantizer::Double)
    }),
    ("skip half-even", "outputs", |p| {
        swap(&mut p.profile.skip, Requantizer::HalfEven)
    }),
    ("skip half-away", "outputs", |p| {
        swap(&mut p.profile.skip, Requantizer::HalfAway)
    }),
    ("skip narrow", "outputs", |p| {
        swap(&mut p.profile.skip, Requantizer::Narrow)
    }),
    ("output double", "channels", |p| {
        swap(&mut p.profile.output, Requantizer::Double)
    }),
    ("output half-even", "channels", |p| {
        swap(&mut p.profile.output, Requantizer::HalfEven)
    }),
    ("output half-away", "channels", |p| {
        swap(&mut p.profile.output, Requantizer::HalfAway)
    }),
    ("output narrow", "channels", |p| {
        swap(&mut p.profile.output, Requantizer::Narrow)
    }),
    ("snap to the cell", "position", |p| {
        p.shape.snap = CornerSnap::Cell
    }),
    ("snap to the stride", "position", |p| {
        p.shape.snap = CornerSnap::Stride
    }),
    ("wrap as clamp", "cells", |p| {
        p.shape.address_mode = AddressMode::Clamp
    }),
    ("all wraps", "cells", |p| {
        p.shape.address_mode = AddressMode::Wrap
    }),
    ("bias forgotten", "accumulators", |p| {
        match &mut p.layers[0].parameters {
            Parameters::Integer(p) => p.bias.fill(0),
            Parameters::Half(p) => p.bias.fill(Half::ZERO),
        }
    }),
    ("no leak", "activated", |p| {
        for layer in &mut p.layers {
            if let Activation::Leaky { .. } = layer.activation {
                layer.activation = Activation::Relu;
            }
        }
    }),
    ("skip path forgotten", "outputs", |p| {
        p.layers.iter_mut().for_each(|l| l.skip = None)
    }),
    ("zero point forgotten", "outputs", |p| {
        for layer in &mut p.layers {
            match &mut layer.parameters {
                Parameters::Integer(p) => p.zero_point = 0,
                Parameters::Half(p) => {
                    if let Some(quantize) = &mut p.quantize {
                        quantize.zero_point = 0;
                    }
                }
            }
        }
    }),
    ("interpolate factored", "inputs", |p| {
        p.profile.interpolate = FilterRule::Factored
    }),
    ("interpolate separable", "inputs", |p| {
        p.profile.interpolate = FilterRule::Separable
    }),
    ("interpolate all ones", "inputs", |p| {
        p.profile.interpolate = FilterRule::AllOnes
    }),
    ("saws as triangles", "inputs", |p| {
        p.shape.wave = Wave::Triangle
    }),
    ("wide accumulators", "accumulators", |p| {
        p.profile.accumulator.bits = 32
    }),
    ("always wraps", "accumulators", |p| {
        p.profile.accumulator.overflow = Overflow::Wrap
    }),
    ("always saturates", "accumulators", |p| {
        p.profile.accumulator.overflow = Overflow::Saturate
    }),
    ("wide skip terms", "outputs", |p| {
        p.profile.residual_bits = 32
    }),
    ("sum fused", "accumulators", |p| {
        p.profile.sum = SumOrder::Fused
    }),
    ("sum in trees of four", "accumulators", |p| {
        p.profile.sum = SumOrder::Tree4
    }),
    ("sum in trees of eight", "accumulators", |p| {
        p.profile.sum = SumOrder::Tree8
    }),
    ("sum one by one", "accumulators", |p| {
        p.profile.sum = SumOrder::Sequential
    }),
    ("convert floor", "outputs", |p| {
        p.profile.convert = Rounding::Floor
    }),
    ("convert half-even", "outputs", |p| {
        p.profile.convert = Rounding::HalfEven
    }),
    ("gates not limited", "activated", |p| {
        for layer in &mut p.layers {
            if let Activation::HardGelu { is_clamped, .. } = &mut layer.activation {
                *is_clamped = false;
            }
        }
    }),
    ("a table's index one off", "activated", |p| {
        for layer in &mut p.layers {
            if let Parameters::Integer(p) = &mut layer.parameters
                && !p.table.is_empty()
            {
                p.table.rotate_left(1);
            }
        }
    }),
    ("level 0 for every mip", "position", |p| {
        for grid in [0, 1] {
            let latents = p.shape.level_latents(grid, 0) as usize;
            p.grids[grid].truncate(latents);
        }
        p.shape.pyramid = Pyramid::SINGLE;
    }),
    ("level 0 behind the others", "codes", |p| {
        for grid in [0, 1] {
            let latents = p.shape.level_latents(grid, 0) as usize;
            p.grids[grid].rotate_left(latents);
        }
    }),
    ("fp16 channels as bytes", "channels", |p| {
        p.shape.outputs.fill(OutputFormat::Unorm8)
    }),
];

#[test]
fn every_mutant_of_the_model_is_caught_at_the_stage_it_breaks() {
    let suites = [suite::texel::suite().unwrap()];
    for &(name, stage, change) in MUTANTS {
        let mut mutant = Mutant { name, change };
        let summary = run(&suites, &mut mutant, &mut |_| {});
        let suite = &summary.suites[0];
        assert!(suite.failed > 0, "{} survives", mutant.name);
        let parts_there = |(found, count): (&String, &usize)| found.ends_with(stage) && *count > 0;
        let stages = &suite.diverging_stages;
        assert!(
            stages.iter().any(parts_there),
            "{}: {stages:?}",
            mutant.name
        );
        // Wherever codes differ, some stage does.
        assert_eq!(
            stages.values().sum::<usize>(),
            suite.failed,
            "{}",
            mutant.name
        );
    }
}
