//! Claims about the graph: on every device it takes the steps of the processor's own kernels.

use super::{Graph, Subject};
use crate::adam::{BETA1, EPSILON, Moments, Rate};
use crate::config::TrainConfig;
use crate::encoder::{BLOCKS, Encoder};
use crate::engine::Engine;
use crate::error::TrainError;
use crate::model::{Ground, Model};
use crate::refine::Rates;
use crate::schedule::Stage;
use crate::tests::{small, source};
use crate::{ActivationKind, Address, GridSampling, Steps, TrainingDevice, train};
use burn_tensor::Device;
use std::sync::atomic::{AtomicBool, Ordering};

/// The unit roundoff of f32.
const U: f64 = 1.0 / (1_u64 << 24) as f64;

const BATCH: usize = 768;
const ENCODER_RATE: f64 = 1e-3;
const RATES: Rates = Rates {
    latents: 1e-2,
    synthesizer: 2e-3,
};

/// How far two evaluations of a step's gradient in f32 may be apart, over the Euclidean norm of the
/// gradient.
///
/// A sum of n products, in any order and with or without fused multiply-adds, errs by at most n·u
/// times the sum of their magnitudes (Higham 2002, section 3.1). A gradient passes the sums of every
/// layer forward and, as long, back, and at last a sum over the batch or over a crop's positions.
/// The errors of all of them add up; that a layer makes a relative error larger is left out, because
/// what it does to an error it does to the signal. Both evaluations err, hence the 2. The absolute
/// error of 10^−5 that WGSL allows a tanh is far below.
fn bound(ground: &Ground<'_>, stage: Stage) -> f64 {
    let synthesizer: usize = ground.topology.layers.iter().map(|l| l.inputs + 2).sum();
    let (forward, positions) = match stage {
        Stage::Encoder => {
            let encoder = Encoder::new(ground.config, ground.texels.channels);
            let sums = encoder
                .places()
                .map(|(_, [_, i, k, _], _, _)| i * k * k + 2);
            let side = ground.config.crop as usize / 2;
            let positions = usize::from(ground.config.crops) * side * side;
            (synthesizer + sums.sum::<usize>(), positions)
        }
        Stage::Refine | Stage::Integer => (synthesizer, 0),
    };
    2.0 * U * (2 * forward + positions.max(BATCH)) as f64
}

fn norm(values: impl Iterator<Item = f64>) -> f64 {
    values.map(|v| v * v).sum::<f64>().sqrt()
}

/// Fails unless the gradients that made `left` and `right` out of `before` are equal up to `bound`.
fn assert_gradients_agree(
    name: &str,
    bound: f64,
    before: &Moments,
    (left, right): (&Moments, &Moments),
) {
    let keep = f64::from(BETA1);
    let gradient = |after: &Moments| -> Vec<f64> {
        let moments = after.first.iter().zip(&before.first);
        moments
            .map(|(&after, &before)| (f64::from(after) - keep * f64::from(before)) / (1.0 - keep))
            .collect()
    };
    let (left, right) = (gradient(left), gradient(right));
    let size = norm(right.iter().copied());
    assert!(size > 0.0, "{name}: no gradient");
    let error = norm(left.iter().zip(&right).map(|(l, r)| l - r)) / size;
    assert!(error <= bound, "{name}: {error:e} > {bound:e}");
}

/// Fails unless `after` is what Adam makes of `before` with these moments, each element by itself.
fn assert_updated(name: &str, rate: Rate, before: &[f32], after: &[f32], moments: &Moments) {
    let elements = before
        .iter()
        .zip(after)
        .zip(&moments.first)
        .zip(&moments.second);
    for (at, (((&before, &after), &first), &second)) in elements.enumerate() {
        let step = rate.step * first / (second.sqrt() * rate.root + EPSILON);
        let expected = before - step;
        // WGSL allows a root 4.5 and a division 2.5 units in the last place; three products and
        // two sums are rounded on either side.
        let bound = 16.0 * U * f64::from(before.abs() + step.abs());
        let error = f64::from((after - expected).abs());
        assert!(error <= bound, "{name} {at}: {after} instead of {expected}");
    }
}

/// Moves the parameters so that no accumulator comes near a kink of an activation, and every part
/// between kinks has some: a slope jumps there, and an accumulator that two roundings put on either
/// side would change a gradient by far more than a rounding. The constructors' weights are multiplied
/// by `gain`, which sends latents beyond their range.
fn keep_from_kinks(ground: &Ground<'_>, model: &mut Model, gain: f32) {
    // At least ½ from 0, from ±1.5 and from 3. At a 128th of their start, the weights of a layer of
    // 32 inputs up to 5 cannot add as much: 16 · √(6/16) / 128 · 5 < ½.
    let biases = [-2.5, 0.5, 2.25, 4.0];
    for layer in &ground.topology.layers {
        for weight in &mut model.parameters[layer.weights_at..layer.bias_at] {
            *weight /= 128.0;
        }
        if layer.activated {
            let own = &mut model.parameters[layer.bias_at..layer.bias_at + layer.outputs];
            for (bias, value) in own.iter_mut().zip(biases.into_iter().cycle()) {
                *bias = value;
            }
        }
    }
    let encoder = Encoder::new(ground.config, ground.texels.channels);
    let last = encoder.count() - 3;
    for index in 0..encoder.count() {
        let (weights, bias) = encoder.parts_mut(index, &mut model.encoder);
        // Within a stage: the halving, then three convolutions for each block, two with a ReLU.
        let place = index % (1 + 3 * BLOCKS);
        if index < last && !place.is_multiple_of(3) {
            weights.iter_mut().for_each(|weight| *weight /= 32.0);
            for (bias, value) in bias.iter_mut().zip([2.0, -2.0].into_iter().cycle()) {
                *bias = value;
            }
        }
        if index > last {
            weights.iter_mut().for_each(|weight| *weight *= gain);
        }
    }
}

/// Takes three steps of a stage on `device` and with the processor's kernels, every step from the
/// same state, and compares losses, gradients and updates.
fn assert_steps_agree(device: &Device, stage: Stage, config: &TrainConfig, gain: f32) {
    let source = source(96, 80, 5);
    let ground = Ground::new(config, &source).unwrap();
    let mut model = Model::new(&ground).unwrap();
    model.start_encoder(&ground);
    keep_from_kinks(&ground, &mut model, gain);
    let mut engine = Engine::new(&ground.topology, BATCH, ground.texels.channels);
    let bound = bound(&ground, stage);
    for step in 0..3 {
        let before = model.clone();
        let mut graph = Graph::new(&ground, &before, Subject::of(stage), device);
        graph.step(&ground, (stage, step, BATCH), (ENCODER_RATE, RATES));
        let mut other = before.clone();
        graph.write_to(&mut other).unwrap();
        let losses = graph.losses().unwrap();
        assert_eq!((losses.len(), graph.losses().unwrap().len()), (1, 0));
        let loss = match stage {
            Stage::Encoder => {
                let rates = [ENCODER_RATE, RATES.synthesizer];
                let loss = model.encoder_step(&ground, &mut engine, step, rates);
                loss.unwrap()
            }
            Stage::Refine | Stage::Integer => model.step(&ground, &mut engine, stage, step, RATES),
        };
        assert!(
            (losses[0] - loss).abs() <= bound * loss,
            "{losses:?} {loss}"
        );

        let rate = |rate| Rate::new(rate, step + 1);
        let moments = (&other.moments, &model.moments);
        assert_gradients_agree("synthesizer", bound, &before.moments, moments);
        let of_synthesizer = rate(RATES.synthesizer);
        let (old, new) = (&before.parameters, &other.parameters);
        assert_updated("synthesizer", of_synthesizer, old, new, &other.moments);
        if stage == Stage::Encoder {
            let moments = (&other.encoder_moments, &model.encoder_moments);
            assert_gradients_agree("encoder", bound, &before.encoder_moments, moments);
            let (old, new) = (&before.encoder, &other.encoder);
            let moments = &other.encoder_moments;
            assert_updated("encoder", rate(ENCODER_RATE), old, new, moments);
            continue;
        }
        for (g, latents) in other.latents.iter().enumerate() {
            let (before, model) = (&before.latents[g], &model.latents[g]);
            let moments = (&latents.moments, &model.moments);
            assert_gradients_agree("latents", bound, &before.moments, moments);
            let codes = f64::from(1_u32 << latents.format.bits());
            let of_latents = rate(RATES.latents * codes);
            let free = |v: &f32| {
                let (low, high) = (latents.format.min_value(), latents.format.max_value());
                *v > low as f32 && *v < high as f32
            };
            // Those at the ends of the range were cut off there.
            let kept: Vec<usize> = (0..latents.values.len())
                .filter(|&at| free(&latents.values[at]))
                .collect();
            assert!(2 * kept.len() > latents.values.len());
            let pick = |from: &[f32]| kept.iter().map(|&at| from[at]).collect::<Vec<f32>>();
            let moments = Moments {
                first: pick(&latents.moments.first),
                second: pick(&latents.moments.second),
            };
            let (old, new) = (pick(&before.values), pick(&latents.values));
            assert_updated("latents", of_latents, &old, &new, &moments);
        }
    }
}

#[test]
fn on_the_processor_the_graph_takes_the_kernels_steps_on_crops() {
    for (address, gain) in [(Address::Wrap, 1.0), (Address::Clamp, 8.0)] {
        let config = TrainConfig { address, ..small() };
        assert_steps_agree(&Device::flex(), Stage::Encoder, &config, gain);
    }
}

#[test]
fn on_the_processor_the_graph_takes_the_kernels_steps_on_the_whole_set() {
    for activation in [
        ActivationKind::Relu,
        ActivationKind::Leaky { shift: 3 },
        ActivationKind::HardGelu,
        ActivationKind::ClampedHardGelu,
    ] {
        let config = TrainConfig {
            activation,
            sampling: [GridSampling::Interpolated, GridSampling::Corners],
            ..small()
        };
        assert_steps_agree(&Device::flex(), Stage::Refine, &config, 1.0);
    }
}

#[cfg(any(feature = "wgpu", feature = "vulkan"))]
#[test]
fn on_a_gpu_the_graph_takes_the_processors_steps() {
    let backend = if cfg!(feature = "vulkan") {
        crate::Backend::Vulkan
    } else {
        crate::Backend::Wgpu
    };
    let device = match backend.open() {
        Ok(device) => device,
        Err(error) => {
            let demanded = ["NTMU_REQUIRE_ALL", "NTMU_REQUIRE_ADAPTER"]
                .iter()
                .find(|name| std::env::var_os(name).is_some_and(|value| value == "1"));
            assert!(demanded.is_none(), "{demanded:?} is 1 and {error}");
            eprintln!("SKIPPED: {error}");
            return;
        }
    };
    eprintln!("{}", device.name());
    assert_steps_agree(device.tensors(), Stage::Encoder, &small(), 8.0);
    assert_steps_agree(device.tensors(), Stage::Refine, &small(), 1.0);
}

#[test]
fn a_run_of_the_graph_that_is_stopped_ends_with_the_bytes_of_one_that_is_not() {
    let source = source(64, 64, 5);
    let config = TrainConfig {
        steps: Some(Steps {
            encoder: 3,
            refine: 30,
            integer: 3,
        }),
        checkpoint_every: 7,
        ..small()
    };
    let device = TrainingDevice::graph_on_flex();
    let never = AtomicBool::new(false);
    let whole = train(&source, &config, &device, None, false, &never, &mut |_| {}).unwrap();
    let record = &whole.asset.metadata.record;
    let named = record.iter().find(|(key, _)| key == "backend");
    assert_eq!(
        named.map(|(_, v)| v.as_str()),
        Some("wgpu on the processor")
    );
    assert_eq!(whole.report.adapter.as_deref(), device.adapter());

    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("state");
    let stop = AtomicBool::new(false);
    let stopped = train(
        &source,
        &config,
        &device,
        Some(&path),
        false,
        &stop,
        &mut |progress| {
            if progress.stage == Stage::Refine && progress.step >= 20 {
                stop.store(true, Ordering::Relaxed);
            }
        },
    );
    assert!(matches!(stopped, Err(TrainError::Stopped { .. })));
    let resumed = train(
        &source,
        &config,
        &device,
        Some(&path),
        true,
        &never,
        &mut |_| {},
    )
    .unwrap();
    assert_eq!(resumed.asset.to_bytes(), whole.asset.to_bytes());
}
