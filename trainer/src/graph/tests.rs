//! Claims about the graph: on every device it takes the steps of the processor's own kernels.

mod agreement;

use self::agreement::{assert_gradients_agree, assert_muon_agrees, assert_updated, bound};
use super::{Graph, Subject};
use crate::adam::{Moments, Rate};
use crate::config::TrainConfig;
use crate::crop::{constructors, encoder};
use crate::encoder::BLOCKS;
use crate::engine::Engine;
use crate::error::TrainError;
use crate::model::{Ground, Model};
use crate::tests::{small, source};
use crate::{
    ActivationKind, Address, GridSampling, Optimiser, Progress, Pyramid, Rates, Shown, Source,
    Stage, Train, TrainingDevice, Watch, train, watched,
};
use burn_tensor::Device;
use ndarray::Array2;
use ntmu_isa::Asset;
use ntmu_isa::asset::Map;
use std::sync::atomic::{AtomicBool, Ordering};

const BATCH: usize = 768;
const RATES: Rates = Rates {
    encoder: 1e-3,
    latents: 1e-2,
    synthesizer: 2e-3,
};

/// Moves the parameters so that no accumulator comes near a kink of an activation, and every part
/// between kinks has some: a slope jumps there, and an accumulator that two roundings put on either
/// side would change a gradient by far more than a rounding. So would a latent half-way between two
/// codes where latents are rounded: there the encoder's are codes with little added. Elsewhere the
/// constructors' weights are multiplied by `gain`, which sends latents beyond their range.
fn keep_from_kinks(ground: &Ground<'_>, model: &mut Model, shown: Shown, gain: f32) {
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
    let encoder = encoder(ground, &constructors(ground));
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
            match shown {
                Shown::Noise => weights.iter_mut().for_each(|weight| *weight *= gain),
                Shown::Rounded => {
                    // 13 planes up to ½ times weights up to √(6/13) / 512 are less than a 100th of
                    // the range, a sixth of a code of 16. Eighths are codes of 8 and of 16.
                    weights.iter_mut().for_each(|weight| *weight /= 512.0);
                    for (bias, value) in
                        bias.iter_mut().zip([-0.25, 0.0, 0.125].into_iter().cycle())
                    {
                        *bias = value;
                    }
                }
            }
        }
    }
}

/// What is compared.
struct Case {
    config: TrainConfig,
    source: Source,
    train: Train,
    shown: Shown,
    /// As in [`keep_from_kinks`].
    gain: f32,
}

impl Case {
    fn of(train: Train) -> Case {
        Case {
            config: TrainConfig {
                optimiser: Optimiser::Adam,
                ..small()
            },
            source: source(96, 80, 5),
            train,
            shown: Shown::Noise,
            gain: 1.0,
        }
    }

    /// With maps that count differently and texels that do not count.
    fn weighted_and_masked(mut self) -> Case {
        let all = self.source.maps.remove(0);
        let part = |name: &str, first_channel: u16, channel_count: u16| Map {
            name: name.into(),
            first_channel,
            channel_count,
            ..all.clone()
        };
        self.source.maps = vec![part("first", 0, 2), part("second", 2, 3)];
        self.config.weights = [("second".to_owned(), 3.0)].into_iter().collect();
        // No crop lies in what counts alone.
        let mask = Array2::from_shape_fn((80, 96), |(y, x)| (x / 8 + y / 8) % 3 == 0);
        self.source.mask = Some(mask);
        self
    }

    fn stage(&self, ground: &Ground<'_>) -> Stage {
        Stage {
            train: self.train,
            latents: self.shown,
            batch: BATCH,
            ..self.config.stages(&ground.texels.sizes).unwrap()[0]
        }
    }
}

/// Takes three steps of a stage on `device` and with the processor's kernels, every step from the
/// same state, and compares losses, gradients and updates.
fn assert_steps_agree(device: &Device, case: &Case) {
    let ground = Ground::new(&case.config, &case.source).unwrap();
    let mut model = Model::new(&ground).unwrap();
    model.start_encoder(&ground);
    keep_from_kinks(&ground, &mut model, case.shown, case.gain);
    let mut engine = Engine::new(&ground.topology, BATCH, ground.texels.channels);
    let bound = bound(&ground, case.train);
    let stage = case.stage(&ground);
    for step in 0..3 {
        let before = model.clone();
        let mut graph = Graph::new(&ground, &before, Subject::of(case.train), device);
        graph.step(&ground, &stage, step, RATES);
        let mut other = before.clone();
        graph.write_to(&mut other).unwrap();
        let losses = graph.losses().unwrap();
        assert_eq!((losses.len(), graph.losses().unwrap().len()), (1, 0));
        let loss = match case.train {
            Train::Encoder => {
                let loss = model.encoder_step(&ground, &mut engine, &stage, step, RATES);
                loss.unwrap()
            }
            Train::Latents | Train::Synthesizer => {
                model.step(&ground, &mut engine, &stage, step, RATES)
            }
        };
        assert!(
            (losses[0] - loss).abs() <= bound * loss,
            "{losses:?} {loss}"
        );

        let rate = |rate| Rate::new(rate, step + 1);
        let of_synthesizer = rate(RATES.synthesizer);
        if stage.optimiser == Optimiser::Muon {
            assert_muon_agrees(&ground, bound, of_synthesizer, [&before, &other, &model]);
        } else {
            let moments = (&other.moments, &model.moments);
            assert_gradients_agree("synthesizer", bound, &before.moments, moments);
            let (old, new) = (&before.parameters, &other.parameters);
            assert_updated("synthesizer", of_synthesizer, old, new, &other.moments);
        }
        if case.train == Train::Encoder {
            let moments = (&other.encoder_moments, &model.encoder_moments);
            assert_gradients_agree("encoder", bound, &before.encoder_moments, moments);
            let (old, new) = (&before.encoder, &other.encoder);
            let moments = &other.encoder_moments;
            assert_updated("encoder", rate(RATES.encoder), old, new, moments);
            continue;
        }
        for (g, latents) in other.latents.iter().enumerate() {
            let (before, model) = (&before.latents[g], &model.latents[g]);
            if case.train == Train::Synthesizer {
                assert_eq!(latents.values, before.values);
                assert_eq!(latents.moments.first, before.moments.first);
                continue;
            }
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

/// What a device is asked in a test.
fn cases() -> Vec<Case> {
    let plain = Case::of;
    let rounded = |train| Case {
        shown: Shown::Rounded,
        ..plain(train)
    };
    let of_levels = |train, pyramid, mut case: Case| {
        case.config.pyramid = pyramid;
        Case { train, ..case }
    };
    let [encoder, latents] = [Train::Encoder, Train::Latents];
    let muon = |mut case: Case| {
        case.config.optimiser = Optimiser::Muon;
        case
    };
    vec![
        muon(plain(encoder)),
        muon(plain(latents)),
        Case {
            gain: 8.0,
            ..plain(encoder)
        },
        rounded(encoder).weighted_and_masked(),
        of_levels(encoder, Pyramid::NTC, plain(encoder)),
        of_levels(encoder, Pyramid::EVERY_MIP, rounded(encoder)),
        plain(latents),
        rounded(latents),
        of_levels(latents, Pyramid::NTC, plain(latents)).weighted_and_masked(),
        plain(Train::Synthesizer),
        of_levels(
            Train::Synthesizer,
            Pyramid::EVERY_MIP,
            rounded(Train::Synthesizer),
        ),
    ]
}

#[test]
fn on_the_processor_the_graph_takes_the_kernels_steps() {
    for case in cases() {
        assert_steps_agree(&Device::flex(), &case);
    }
}

#[test]
fn on_the_processor_the_graph_takes_the_kernels_steps_on_crops_that_do_not_wrap() {
    let mut case = Case::of(Train::Encoder);
    case.config.address = Address::Clamp;
    assert_steps_agree(&Device::flex(), &case);
}

#[test]
fn on_the_processor_the_graph_takes_the_kernels_steps_at_every_activation() {
    for activation in [
        ActivationKind::Relu,
        ActivationKind::Leaky { shift: 3 },
        ActivationKind::HardGelu,
        ActivationKind::ClampedHardGelu,
    ] {
        let mut case = Case::of(Train::Latents);
        case.config.activation = activation;
        case.config.sampling = [GridSampling::Interpolated, GridSampling::Corners];
        assert_steps_agree(&Device::flex(), &case);
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
    for case in cases() {
        assert_steps_agree(device.tensors(), &case);
    }
}

/// A run with a stage of each kind.
fn run_of_the_graph() -> TrainConfig {
    let mut plan = TrainConfig::default().usual_plan([3, 30, 3]);
    let frozen = crate::StagePlan {
        train: Train::Synthesizer,
        steps: 5,
        latents: Shown::Rounded,
        ..plan.stage[1].clone()
    };
    plan.stage.insert(2, frozen);
    TrainConfig {
        plan: Some(plan),
        checkpoint_every: 7,
        ..small()
    }
}

#[test]
fn a_run_of_the_graph_that_is_stopped_ends_with_the_bytes_of_one_that_is_not() {
    let source = source(64, 64, 5);
    let config = run_of_the_graph();
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
            if progress.stage.train == Train::Latents && progress.step >= 20 {
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

/// Asks for the asset whenever it can.
struct Curious {
    losses: Vec<f64>,
    assets: usize,
}

impl Watch for Curious {
    fn observe(&mut self, progress: &Progress) {
        self.losses.push(progress.loss);
    }

    fn wants_asset(&mut self) -> bool {
        true
    }

    fn asset(&mut self, _progress: &Progress, _asset: &Asset) {
        self.assets += 1;
    }
}

#[test]
fn a_run_of_the_graph_that_is_looked_at_and_saved_ends_as_one_that_is_not() {
    let source = source(64, 64, 5);
    let config = run_of_the_graph();
    let device = TrainingDevice::graph_on_flex();
    let never = AtomicBool::new(false);
    let mut losses = Vec::new();
    let mut observer = |p: &Progress| losses.push(p.loss);
    let alone = train(
        &source,
        &config,
        &device,
        None,
        false,
        &never,
        &mut observer,
    )
    .unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("state");
    let mut watch = Curious {
        losses: Vec::new(),
        assets: 0,
    };
    let looked_at = watched(
        &source,
        &config,
        &device,
        Some(&path),
        false,
        &never,
        &mut watch,
    )
    .unwrap();
    assert_eq!(looked_at.asset.to_bytes(), alone.asset.to_bytes());
    assert_eq!(watch.losses, losses);
    // The end of the encoder's stage, steps 20 and 30, and the ends of the two others.
    assert_eq!((losses.len(), watch.assets), (5, 5));
}
