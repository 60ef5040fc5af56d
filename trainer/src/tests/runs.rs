//! Runs: quality, determinism, checkpoints, refusals.

use super::{run, small, source};
use crate::checkpoint;
use crate::model::{Ground, Model};
use crate::refine::Rates;
use crate::schedule::Stage;
use crate::{
    ActivationKind, GridSampling, Precision, Preset, Source, Steps, TrainConfig, TrainError,
    TrainingDevice, WaveForm, train,
};
use ntmu_isa::shape::Shape;
use std::path::Path;
use std::sync::atomic::AtomicBool;

#[test]
fn training_improves_and_the_numbers_of_the_decode_keep_the_quality() {
    let source = source(64, 64, 5);
    let quality = |n: u64, config: &TrainConfig| {
        let steps = Steps {
            encoder: 0,
            refine: n,
            integer: n / 2,
        };
        let config = TrainConfig {
            steps: Some(steps),
            ..config.clone()
        };
        run(&source, &config).unwrap().report
    };
    let (int8, fp16) = (Precision::Int8, Precision::Fp16);
    for config in [
        small(),
        TrainConfig {
            precision: fp16,
            ..small()
        },
        TrainConfig {
            precision_per_layer: Some(vec![fp16, fp16, int8, int8, int8, int8, fp16]),
            ..small()
        },
        TrainConfig {
            activation: ActivationKind::ClampedHardGelu,
            sampling: [GridSampling::Interpolated; 2],
            wave: WaveForm::Saw,
            padding: 3,
            ..small()
        },
    ] {
        let (short, long) = (quality(10, &config), quality(600, &config));
        assert!(
            long.psnr_quantised > short.psnr_quantised + 6.0,
            "{short:?} {long:?}"
        );
        assert!(long.psnr_quantised > long.psnr_float - 0.3, "{long:?}");
    }
}

#[test]
fn the_same_seed_gives_the_same_asset_and_another_seed_another() {
    let source = source(50, 33, 4);
    let config = small();
    let first = run(&source, &config).unwrap().asset;
    assert_eq!(first, run(&source, &config).unwrap().asset);
    assert_ne!(
        first,
        run(&source, &TrainConfig { seed: 1, ..config })
            .unwrap()
            .asset
    );
}

/// Stops a run at its `at`-th observation.
fn stopped_at(
    source: &Source,
    config: &TrainConfig,
    path: &Path,
    at: u64,
    resume: bool,
) -> TrainError {
    let stop = AtomicBool::new(false);
    let mut observer = |p: &crate::Progress| {
        stop.store(p.done >= at, std::sync::atomic::Ordering::Relaxed);
    };
    train(
        source,
        config,
        &TrainingDevice::flex(),
        Some(path),
        resume,
        &stop,
        &mut observer,
    )
    .unwrap_err()
}

#[test]
fn a_run_stopped_in_every_stage_and_resumed_equals_the_uninterrupted_run() {
    let source = source(80, 72, 5);
    let config = TrainConfig {
        steps: Some(Steps {
            encoder: 40,
            refine: 40,
            integer: 40,
        }),
        ..small()
    };
    let whole = run(&source, &config).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.checkpoint");
    let mut resume = false;
    for at in [20, 60, 100] {
        let error = stopped_at(&source, &config, &path, at, resume);
        assert!(
            matches!(&error, TrainError::Stopped { checkpoint: Some(p), .. } if *p == path),
            "{error}"
        );
        resume = true;
    }
    let stop = AtomicBool::new(false);
    let resumed = train(
        &source,
        &config,
        &TrainingDevice::flex(),
        Some(&path),
        true,
        &stop,
        &mut |_| {},
    )
    .unwrap();
    assert_eq!(resumed.asset, whole.asset);
    assert_eq!(
        resumed.report.psnr_float.to_bits(),
        whole.report.psnr_float.to_bits()
    );
}

#[test]
fn a_foreign_a_damaged_and_a_truncated_checkpoint_are_refused() {
    let source = source(16, 16, 3);
    let config = small();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.checkpoint");
    let stop = AtomicBool::new(true);
    train(
        &source,
        &config,
        &TrainingDevice::flex(),
        Some(&path),
        false,
        &stop,
        &mut |_| {},
    )
    .unwrap_err();
    let good = std::fs::read(&path).unwrap();
    let stop = AtomicBool::new(false);
    let resumed = |config: &TrainConfig, bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        train(
            &source,
            config,
            &TrainingDevice::flex(),
            Some(&path),
            true,
            &stop,
            &mut |_| {},
        )
    };
    let other = resumed(
        &TrainConfig {
            seed: 9,
            ..config.clone()
        },
        &good,
    )
    .unwrap_err();
    assert!(other.to_string().contains("same configuration"), "{other}");
    for at in [8, 20, 40, good.len() / 2, good.len() - 1] {
        let mut damaged = good.clone();
        damaged[at] ^= 4;
        assert!(
            matches!(
                resumed(&config, &damaged),
                Err(TrainError::Checkpoint { .. })
            ),
            "{at}"
        );
        assert!(
            matches!(
                resumed(&config, &good[..at]),
                Err(TrainError::Checkpoint { .. })
            ),
            "{at}"
        );
    }
    let every = TrainConfig {
        checkpoint_every: 7,
        ..config
    };
    assert!(resumed(&every, &good).is_ok());
}

#[test]
fn sets_of_any_size_train() {
    for (width, height) in [(1, 1), (1, 40), (3, 2), (9, 65), (130, 70)] {
        let mips = usize::from(Shape::max_mip_count(width as u32, height as u32));
        let source = source(width, height, mips);
        let asset = run(&source, &small()).unwrap().asset;
        assert_eq!(
            (asset.shape.width, asset.shape.height),
            (width as u32, height as u32)
        );
    }
}

#[test]
fn a_loss_that_is_no_number_names_its_step() {
    let source = source(16, 16, 2);
    let config = small();
    let ground = Ground::new(&config, &source).unwrap();
    let mut model = Model::new(&ground).unwrap();
    model.parameters[0] = f32::NAN;
    let mut engine = crate::engine::Engine::new(&ground.topology, 768, 5);
    let rates = Rates {
        latents: 0.0,
        synthesizer: 0.0,
    };
    assert!(
        model
            .step(&ground, &mut engine, Stage::Refine, 0, rates)
            .is_nan()
    );
    // And through the front door: a checkpoint whose parameters are no numbers.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.checkpoint");
    let position = checkpoint::Position {
        stage: Stage::Refine,
        step: 5,
        psnr_float: 0.0,
    };
    let identity = checkpoint::identity(&ground).unwrap();
    model.start_encoder(&ground);
    checkpoint::write(&path, identity, position, &model).unwrap();
    let stop = AtomicBool::new(false);
    let error = train(
        &source,
        &config,
        &TrainingDevice::flex(),
        Some(&path),
        true,
        &stop,
        &mut |_| {},
    )
    .unwrap_err();
    assert!(
        matches!(
            error,
            TrainError::Diverged {
                stage: "refine",
                step: 5,
                ..
            }
        ),
        "{error}"
    );
}

#[test]
fn every_preset_is_valid_and_makes_an_asset_of_its_sizes() {
    let source = source(24, 16, 3);
    for preset in Preset::ALL {
        let config = TrainConfig {
            batch: 768,
            steps: Some(Steps {
                encoder: 0,
                refine: 2,
                integer: 2,
            }),
            ..preset.config()
        };
        let trained = run(&source, &config).unwrap();
        assert_eq!(
            trained.report.macs,
            u64::from(trained.asset.macs()),
            "{}",
            preset.name
        );
        let outputs = source.outputs.clone();
        let mip_count = source.mips.len() as u8;
        let asset = &trained.asset;
        let shape = preset.shape(asset.shape.width, asset.shape.height, mip_count, outputs);
        assert_eq!(asset.shape, shape, "{}", preset.name);
        let layers = asset.layers.iter();
        let sizes: Vec<(u16, u16)> = layers.map(|l| (l.inputs, l.outputs)).collect();
        let channels = asset.shape.channel_count();
        assert_eq!(sizes, preset.layers(channels), "{}", preset.name);
        assert_eq!(asset.macs(), preset.macs(channels), "{}", preset.name);
        assert_eq!(Preset::by_name(preset.name).unwrap(), preset);
    }
    let error = Preset::by_name("cntc-17").unwrap_err().to_string();
    assert!(error.contains("cntc-16"), "{error}");
}

#[test]
fn configurations_out_of_range_are_refused_by_field() {
    type Change = fn(&mut TrainConfig);
    let cases: [(&str, Change); 13] = [
        ("grids[1].bits", |c| c.grids[1].bits = 9),
        ("hidden", |c| c.hidden.clear()),
        ("layers_per_block", |c| c.layers_per_block = 4),
        ("activation.shift", |c| {
            c.activation = ActivationKind::Leaky { shift: 0 }
        }),
        ("batch", |c| c.batch = 1000),
        ("crop", |c| c.crop = 100),
        ("uniform_mips", |c| c.uniform_mips = f64::NAN),
        ("padding", |c| c.padding = 16),
        ("input_bits: found 3; allowed: 4..=16", |c| c.input_bits = 3),
        ("input_bits: found 13; allowed: 4..=12", |c| {
            c.input_bits = 13;
            c.precision = Precision::Fp16;
        }),
        ("input_bits: found 14; allowed: 4..=12", |c| {
            c.input_bits = 14
        }),
        ("activation_bits: found 13; allowed: 4..=12", |c| {
            c.activation_bits = 13
        }),
        ("precision_per_layer: found 2 layers; allowed: 7", |c| {
            c.precision_per_layer = Some(vec![Precision::Int8; 2]);
        }),
    ];
    for (field, change) in cases {
        let mut config = small();
        change(&mut config);
        let error = config.validate().unwrap_err().to_string();
        assert!(error.contains(field), "{error}");
    }
}
