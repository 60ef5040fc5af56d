//! What was trained is what is decoded, and an interrupted run goes on.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
#![cfg(feature = "train")]

use ntmu::brick_wall;
use ntmu::decoded::Decoded;
use ntmu::isa::asset::Map;
use ntmu::isa::shape::OutputFormat;
use ntmu::quality::{Quality, maps_of};
use ntmu::trainer::{self, Preset, Source, TrainConfig};
use std::process::Command;
use std::sync::atomic::AtomicBool;

fn source() -> Source {
    let set = brick_wall::generate(64, 3);
    let maps = set.maps.iter().map(|map| Map {
        name: map.name.clone(),
        first_channel: map.first_channel as u16,
        channel_count: map.channel_count as u16,
        encoding: map.encoding,
        bit_depth: map.bit_depth,
    });
    let outputs = vec![OutputFormat::Unorm8; set.channel_count()];
    Source {
        name: set.name.clone(),
        maps: maps.collect(),
        outputs,
        mips: set.texels,
    }
}

#[test]
fn the_model_decodes_what_the_trainer_measured() {
    for name in ["hw-16", "rtxntc", "ntc-0.2", "tsnc"] {
        let config = TrainConfig {
            effort: 0,
            ..Preset::by_name(name).unwrap().config()
        };
        let source = source();
        let stop = AtomicBool::new(false);
        let trained = trainer::train(&source, &config, None, false, &stop, &mut |_| ()).unwrap();
        let asset = trained.asset;
        let reals = Decoded::of(&asset, |_| ()).reals(&asset.shape);
        let quality = Quality::measure(&source.mips, &reals, &maps_of(&asset)).unwrap();
        let (model, trainer) = (quality.overall.psnr, trained.report.psnr_quantised);
        // Both are f64 sums over the same codes; only the order of the additions differs.
        assert!(
            (model - trainer).abs() < 1e-6,
            "{name}: model {model}, trainer {trainer}"
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
    let config = "checkpoint_every = 50\nsteps = { encoder = 0, refine = 3000, integer = 1000 }\n";
    std::fs::write(folder.path().join("run.toml"), config).unwrap();
    let encode = |output| {
        [
            "encode", "set", "-o", output, "--preset", "hw-16", "--config", "run.toml",
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
