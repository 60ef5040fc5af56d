//! Safety: a run that is interrupted, that diverges, or whose files are not its own.

use super::{resumed, run, run_with, small, source, stopped_at, usual};
use crate::checkpoint;
use crate::model::{Ground, Model};
use crate::{Plan, TrainConfig, TrainError, TrainingDevice, train};
use std::sync::atomic::AtomicBool;

#[test]
fn a_run_stopped_in_every_stage_and_resumed_equals_the_uninterrupted_run() {
    let source = source(80, 72, 5);
    let config = TrainConfig {
        plan: Some(usual([40, 40, 40])),
        ..small()
    };
    let whole = run(&source, &config).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.checkpoint");
    let mut resume = false;
    // Within the stages, and between them.
    for at in [20, 40, 60, 80, 100] {
        let error = stopped_at(&source, &config, &path, at, resume);
        assert!(
            matches!(&error, TrainError::Stopped { checkpoint: Some(p), .. } if *p == path),
            "{error}"
        );
        resume = true;
    }
    let resumed = resumed(&source, &config, &path).unwrap();
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
    stopped_at(&source, &config, &path, 1, false);
    let good = std::fs::read(&path).unwrap();
    let resumed = |config: &TrainConfig, bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        run_with(&source, config, Some(&path), true)
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
        rate_factor: 0.5,
        ..config
    };
    assert!(resumed(&every, &good).is_ok());
}

#[test]
fn a_loss_that_is_no_number_names_its_step() {
    let source = source(16, 16, 2);
    let config = small();
    let ground = Ground::new(&config, &source).unwrap();
    let mut model = Model::new(&ground).unwrap();
    model.parameters[0] = f32::NAN;
    let mut engine = crate::engine::Engine::new(&ground.topology, 768, 5);
    let stages = config.stages(&ground.texels.sizes).unwrap();
    let latents = stages[1];
    let rates = latents.rates_at(0);
    assert!(
        model
            .step(&ground, &mut engine, &latents, 0, rates)
            .is_nan()
    );
    // And through the front door: a checkpoint whose parameters are no numbers.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.checkpoint");
    let position = checkpoint::Position {
        stage: 1,
        step: 5,
        loss: 0.1,
        least: 0.1,
        seconds: 0.0,
        rounds: 0,
        extents: checkpoint::Extent::of(&stages),
    };
    let identity = checkpoint::identity(&ground).unwrap();
    model.start_encoder(&ground);
    checkpoint::write(&path, identity, &position, &model).unwrap();
    let stop = AtomicBool::new(false);
    // A device's losses are read together, some steps later.
    for device in [TrainingDevice::flex(), TrainingDevice::graph_on_flex()] {
        let error = train(
            &source,
            &config,
            &device,
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
                    stage: "latents",
                    step: 5,
                    ..
                }
            ),
            "{error}"
        );
    }
}

/// A plan with a stage of every kind.
fn every_kind() -> Plan {
    Plan::parse(
        r#"
        name = "every kind"
        [[stage]]
        train = "encoder"
        steps = 25
        latents = "noise"
        numbers = "real"
        [[stage]]
        train = "encoder"
        steps = 25
        crop = 128
        latents = "rounded"
        numbers = "real"
        [[stage]]
        train = "encoder"
        steps = 25
        latents = "rounded"
        numbers = "deployed"
        [[stage]]
        train = "latents"
        steps = 25
        batch = 1536
        latents = "rounded"
        numbers = "deployed"
        [[stage]]
        train = "synthesizer"
        steps = 25
        latents = "rounded"
        numbers = "deployed"
        "#,
    )
    .unwrap()
}

#[test]
fn a_run_of_every_kind_of_stage_stopped_in_each_and_resumed_equals_the_uninterrupted_run() {
    let source = source(80, 72, 5);
    let config = TrainConfig {
        plan: Some(every_kind()),
        ..small()
    };
    let whole = run(&source, &config).unwrap();
    assert_eq!(whole.report.steps, [25; 5]);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.checkpoint");
    for (at, resume) in [(20, false), (45, true), (70, true), (95, true), (120, true)] {
        stopped_at(&source, &config, &path, at, resume);
    }
    let resumed = resumed(&source, &config, &path).unwrap();
    assert_eq!(resumed.asset, whole.asset);
}

#[test]
fn a_run_that_diverges_stops_and_names_the_last_checkpoint_from_before() {
    let source = source(48, 48, 3);
    // A rate of 1 on every parameter: the network is gone within a few steps of the second stage.
    let plan = Plan::parse(
        r#"
        name = "diverges"
        [[stage]]
        train = "latents"
        steps = 400
        latents = "noise"
        numbers = "real"
        [[stage]]
        train = "latents"
        steps = 400
        rates = { latents = 1.0, synthesizer = 1.0 }
        rate_factor = 10.0
        fall = "constant"
        warm_up = 40
        latents = "noise"
        numbers = "real"
        "#,
    );
    let config = TrainConfig {
        plan: Some(plan.unwrap()),
        checkpoint_every: 100,
        ..small()
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.checkpoint");
    let error = run_with(&source, &config, Some(&path), false).unwrap_err();
    let TrainError::Diverged { good, .. } = &error else {
        panic!("{error}");
    };
    let good = good.clone().unwrap();
    assert_eq!(
        (good.path.as_path(), good.step),
        (path.as_path(), 400),
        "{error}"
    );
    assert!(error.to_string().contains("rate factor"), "{error}");
    let gentle = TrainConfig {
        rate_factor: 1e-3,
        ..config
    };
    run_with(&source, &gentle, Some(&path), true).unwrap();
}

#[test]
fn a_checkpoint_that_cannot_be_written_stops_the_run_and_leaves_nothing() {
    let source = source(16, 16, 3);
    let folder = tempfile::tempdir().unwrap();
    // A folder in its place can be neither written nor renamed over.
    let path = folder.path().join("run.checkpoint");
    std::fs::create_dir_all(path.join("inside")).unwrap();
    let config = TrainConfig {
        checkpoint_every: 10,
        ..small()
    };
    let error = run_with(&source, &config, Some(&path), false).unwrap_err();
    assert!(
        matches!(&error, TrainError::Io { path: p, .. } if *p == path),
        "{error}"
    );
    let left: Vec<_> = std::fs::read_dir(folder.path()).unwrap().collect();
    assert_eq!(left.len(), 1, "{left:?}");
}
