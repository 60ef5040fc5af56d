//! What was trained is what is decoded, and an interrupted run goes on.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
#![cfg(feature = "train")]

mod support;
mod training;

use ntmu::decoded::Decoded;
use ntmu::quality::{Quality, maps_of};
use ntmu::trainer::{self, Precision, Preset, TrainConfig, TrainReport, TrainingDevice};
use std::process::Command;
use std::sync::atomic::AtomicBool;

/// Decibels of the model's codes, and the trainer's report.
fn decoded(config: &TrainConfig) -> (f64, TrainReport) {
    let source = support::source::brick_wall(64);
    let stop = AtomicBool::new(false);
    let trained = trainer::train(
        &source,
        config,
        &TrainingDevice::flex(),
        None,
        false,
        &stop,
        &mut |_| (),
    )
    .unwrap();
    let asset = trained.asset;
    let reals = Decoded::of(&asset, |_| ()).reals(&asset.shape);
    let quality = Quality::measure(&source.mips, &reals, &maps_of(&asset)).unwrap();
    (quality.overall.psnr, trained.report)
}

fn preset(name: &str) -> TrainConfig {
    TrainConfig {
        effort: 0,
        ..Preset::by_name(name).unwrap().config()
    }
}

#[test]
fn the_model_decodes_what_the_trainer_measured() {
    for name in ["hw-16", "rtxntc", "ntc-0.2", "tsnc"] {
        for precision in [Precision::Int8, Precision::Fp16] {
            let (model, report) = decoded(&TrainConfig {
                precision,
                ..preset(name)
            });
            let trainer = report.psnr_quantised;
            // Both are f64 sums over the same codes; only the order of the additions differs.
            assert!(
                (model - trainer).abs() < 1e-6,
                "{name} {precision:?}: model {model}, trainer {trainer}"
            );
        }
    }
}

#[test]
fn the_model_decodes_layers_of_both_precisions_as_they_were_trained() {
    let (int8, fp16) = (Precision::Int8, Precision::Fp16);
    for (list, activation_bits) in [
        ([fp16, int8, int8, int8], 8),
        ([int8, int8, int8, fp16], 6),
        ([fp16, fp16, fp16, int8], 10),
    ] {
        let (model, report) = decoded(&TrainConfig {
            precision_per_layer: Some(list.to_vec()),
            activation_bits,
            ..preset("hw-32")
        });
        let trainer = report.psnr_quantised;
        assert!(
            (model - trainer).abs() < 1e-6,
            "{list:?}: model {model}, trainer {trainer}"
        );
    }
}

#[test]
fn halves_exported_from_reals_decode_like_the_reals() {
    for name in ["hw-16", "rtxntc", "tsnc"] {
        let (model, report) = decoded(&TrainConfig {
            precision: Precision::Fp16,
            plan: Some(TrainConfig::default().usual_plan([0, 200, 0])),
            ..preset(name)
        });
        let float = report.psnr_float;
        assert!(
            (model - float).abs() < 0.05,
            "{name}: model {model}, reals {float}"
        );
    }
}

#[cfg(unix)]
#[test]
fn an_interrupted_run_goes_on_to_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let ntmu = |arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_ntmu"));
        command
            .args(arguments)
            .current_dir(folder.path())
            .stderr(std::process::Stdio::piped());
        command
    };
    let generated = ntmu(&["generate", "-o", "set", "--size", "64"])
        .output()
        .unwrap();
    assert!(generated.status.success());
    std::fs::write(folder.path().join("run.toml"), "checkpoint_every = 50\n").unwrap();
    let encode = |output| {
        [
            "encode",
            "set",
            "-o",
            output,
            "--preset",
            "hw-16",
            "--config",
            "run.toml",
            "--steps",
            "0+3000+1000",
        ]
    };

    let mut interrupted = ntmu(&encode("a.ntx")).spawn().unwrap();
    // The first periodic checkpoint shows that the run is well under way.
    let checkpoint = folder.path().join("a.ntx.checkpoint");
    while !checkpoint.exists() {
        assert!(
            interrupted.try_wait().unwrap().is_none(),
            "it ended before its first checkpoint"
        );
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    let id = interrupted.id().to_string();
    assert!(
        Command::new("kill")
            .args(["-INT", &id])
            .status()
            .unwrap()
            .success()
    );
    let output = interrupted.wait_with_output().unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{stderr}");
    assert!(stderr.contains("--resume"), "{stderr}");
    assert!(checkpoint.exists() && !folder.path().join("a.ntx").exists());

    let mut resume = encode("a.ntx").to_vec();
    resume.push("--resume");
    for arguments in [resume.as_slice(), &encode("b.ntx")] {
        let output = ntmu(arguments).output().unwrap();
        assert!(
            output.status.success(),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        );
    }
    let read = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
    assert!(
        read("a.ntx") == read("b.ntx"),
        "the resumed run made other bytes"
    );
    assert!(!checkpoint.exists(), "a finished run leaves no checkpoint");

    let lost = ntmu(&resume).output().unwrap();
    assert_eq!(lost.status.code(), Some(2), "there is nothing to resume");
}
