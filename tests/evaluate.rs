//! `ntmu evaluate`, from a plan to the tables.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod support;

use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output};
use support::command::{folder, json, ntmu, stderr};

fn plan(name: &str) -> String {
    let root = env!("CARGO_MANIFEST_DIR");
    format!("{root}/plans/evaluate/{name}.toml")
}

fn files_in(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let names = entries.map(|e| e.unwrap().file_name().to_string_lossy().into_owned());
    let mut names: Vec<String> = names.collect();
    names.sort();
    names
}

#[test]
fn the_smoke_plan_runs_to_its_tables_and_a_second_time_makes_nothing() {
    let folder = folder();
    let plan = plan("smoke");
    let listed = json(&ntmu(
        &["evaluate", &plan, "--list", "--json"],
        folder.path(),
    ));
    assert_eq!(listed.as_array().unwrap().len(), 4);
    assert!(
        listed
            .as_array()
            .unwrap()
            .iter()
            .all(|p| p["finished"] == false)
    );
    assert!(
        !folder.path().join("evaluation").exists(),
        "--list makes nothing"
    );
    let first = json(&ntmu(&["evaluate", &plan, "--json"], folder.path()));
    assert_eq!(first["missing"], Value::Array(Vec::new()));
    assert_eq!(first["sets"].as_array().unwrap().len(), 2);
    let results = folder.path().join("evaluation");
    assert_eq!(
        files_in(&results),
        [
            "curves",
            "plots",
            "points",
            "results.json",
            "results.md",
            "unfinished"
        ]
    );
    assert_eq!(files_in(&results.join("points")).len(), 4);
    let again = ntmu(&["evaluate", &plan, "--json"], folder.path());
    assert!(!stderr(&again).contains("1 of"), "{}", stderr(&again));
    let again = json(&again);
    assert_eq!(again["sets"], first["sets"]);
    assert_eq!(again["mean"], first["mean"]);
}

#[test]
fn shards_together_are_the_whole_and_the_last_writes_the_tables() {
    let folder = folder();
    let plan = plan("smoke");
    for shard in ["0/3", "1/3", "2/3"] {
        let output = ntmu(&["evaluate", &plan, "--shard", shard], folder.path());
        assert!(output.status.success(), "{}", stderr(&output));
        let has_table = folder.path().join("evaluation/results.md").exists();
        assert_eq!(has_table, shard == "2/3");
    }
}

#[test]
fn killed_at_any_moment_what_is_there_is_whole_and_the_rest_follows() {
    let folder = folder();
    let sizes = [8, 16, 32, 64, 128];
    let sets = sizes.map(|size| format!("'built-in {size}'"));
    let text = format!(
        "name = 'p'\nsets = [{}]\n[[curve]]\nname = 'BC'\ncodec = 'bc'\nscalars = ['together', 'alone']\n",
        sets.join(", ")
    );
    std::fs::write(folder.path().join("plan.toml"), text).unwrap();
    let points = folder.path().join("evaluation/points");
    let mut before = Vec::new();
    // Killed with more and more points there; each time it goes on.
    for enough in [1, 4, 7] {
        let mut child = Command::new(env!("CARGO_BIN_EXE_ntmu"))
            .args(["evaluate", "plan.toml"])
            .stderr(std::process::Stdio::null())
            .stdout(std::process::Stdio::null())
            .current_dir(folder.path())
            .spawn()
            .unwrap();
        let count = || match points.exists() {
            true => whole_results(&points).len(),
            false => 0,
        };
        while count() < enough && child.try_wait().unwrap().is_none() {
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
        child.kill().unwrap();
        child.wait().unwrap();
        for name in whole_results(&points) {
            let text = std::fs::read_to_string(points.join(&name)).unwrap();
            let result: Value = serde_json::from_str(&text).unwrap();
            assert!(name.contains(result["id"].as_str().unwrap()));
            before.push((name, text));
        }
    }
    let summary = json(&ntmu(&["evaluate", "plan.toml", "--json"], folder.path()));
    assert_eq!(summary["missing"], Value::Array(Vec::new()));
    assert_eq!(whole_results(&points).len(), 10);
    for (name, text) in before {
        assert_eq!(std::fs::read_to_string(points.join(name)).unwrap(), text);
    }
}

/// The results in a folder; a kill may leave temporary files beside them.
fn whole_results(folder: &Path) -> Vec<String> {
    let mut names = files_in(folder);
    names.retain(|name| name.ends_with(".json"));
    names
}

/// Runs with no `astcenc` to be found.
fn without_astcenc(arguments: &[&str], folder: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_ntmu"))
        .args(arguments)
        .env("NTMU_ASTCENC", "/nowhere/astcenc")
        .current_dir(folder)
        .output()
        .unwrap()
}

#[test]
fn a_point_that_fails_stops_no_other_and_the_exit_code_tells() {
    let folder = folder();
    std::fs::write(
        folder.path().join("plan.toml"),
        "name = 'p'\nsets = ['built-in 16']\n[[curve]]\nname = 'ASTC'\ncodec = 'astc'\nblocks = ['8x8']\n\
         [[curve]]\nname = 'BC'\ncodec = 'bc'\n",
    )
    .unwrap();
    let dry = without_astcenc(&["evaluate", "plan.toml", "--dry-run"], folder.path());
    assert_eq!(dry.status.code(), Some(1));
    let said = String::from_utf8_lossy(&dry.stdout).into_owned();
    assert!(said.contains("apt-get install astcenc"), "{said}");
    let output = without_astcenc(&["evaluate", "plan.toml", "--json"], folder.path());
    assert_eq!(output.status.code(), Some(1));
    assert!(
        stderr(&output).contains("apt-get install astcenc"),
        "{}",
        stderr(&output)
    );
    let summary: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(summary["missing"].as_array().unwrap().len(), 1);
    assert_eq!(summary["sets"][0]["rows"].as_array().unwrap().len(), 1);
}

#[cfg(not(feature = "train"))]
#[test]
fn a_neural_point_in_a_build_without_the_trainer_says_how_to_get_it() {
    let folder = folder();
    let output = ntmu(
        &[
            "evaluate",
            &plan("smoke-all"),
            "--only",
            "cntc",
            "--dry-run",
        ],
        folder.path(),
    );
    assert_eq!(output.status.code(), Some(1));
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(said.contains("--features train"), "{said}");
}

#[cfg(feature = "train")]
#[test]
fn a_neural_point_leaves_its_asset_and_no_checkpoint() {
    let folder = folder();
    let arguments = ["evaluate", &plan("smoke-all"), "--only", "cntc", "--json"];
    let summary = json(&ntmu(&arguments, folder.path()));
    let row = &summary["sets"][0]["rows"][0];
    let results = folder.path().join("evaluation");
    let names = files_in(&results.join("points"));
    let asset = names.iter().find(|name| name.ends_with(".ntx")).unwrap();
    let bytes = std::fs::read(results.join("points").join(asset)).unwrap();
    let asset = ntmu::isa::Asset::from_bytes(&bytes).unwrap();
    assert_eq!(row["bppc"].as_f64(), Some(ntmu::quality::bppc(&asset)));
    assert_eq!(files_in(&results.join("unfinished")), [""; 0]);
}

#[cfg(feature = "train")]
#[test]
fn a_neural_point_killed_in_its_training_goes_on_from_its_checkpoint_to_the_same_bytes() {
    let folder = folder();
    let text = "name = 'p'\nsets = ['built-in 64']\n[[curve]]\nname = 'CNTC'\ncodec = 'neural'\n\
                presets = ['cntc-16']\neffort = 'fast'\nconfig = { batch = 768, checkpoint_every = 10 }\n";
    std::fs::write(folder.path().join("plan.toml"), text).unwrap();
    let whole = json(&ntmu(
        &["evaluate", "plan.toml", "-o", "whole", "--json"],
        folder.path(),
    ));
    let unfinished = folder.path().join("killed/unfinished");
    let checkpoint = || -> Option<(std::path::PathBuf, Vec<u8>)> {
        let entries = std::fs::read_dir(&unfinished).ok()?;
        let path = entries.map(|entry| entry.unwrap().path());
        let mut paths = path.filter(|p| p.extension().is_some_and(|e| e == "checkpoint"));
        let path = paths.next()?;
        let bytes = std::fs::read(&path).ok()?;
        Some((path, bytes))
    };
    let mut last = None;
    for _kill in 0..3 {
        let mut child = Command::new(env!("CARGO_BIN_EXE_ntmu"))
            .args(["evaluate", "plan.toml", "-o", "killed"])
            .stderr(std::process::Stdio::null())
            .stdout(std::process::Stdio::null())
            .current_dir(folder.path())
            .spawn()
            .unwrap();
        while checkpoint() == last {
            assert!(child.try_wait().unwrap().is_none(), "it ended unkilled");
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
        child.kill().unwrap();
        child.wait().unwrap();
        last = checkpoint();
    }
    let go_on = || {
        ntmu(
            &["evaluate", "plan.toml", "-o", "killed", "--json"],
            folder.path(),
        )
    };
    // That it goes on from the checkpoint shows where that is cut short.
    let (path, bytes) = last.unwrap();
    std::fs::write(&path, &bytes[..bytes.len() - 1]).unwrap();
    let refused = go_on();
    assert_eq!(refused.status.code(), Some(1));
    assert!(
        stderr(&refused).contains("checkpoint"),
        "{}",
        stderr(&refused)
    );
    std::fs::write(&path, &bytes).unwrap();
    let killed = json(&go_on());
    assert_eq!(files_in(&unfinished), [""; 0]);
    let asset = |name: &str| {
        let points = folder.path().join(name).join("points");
        let names = files_in(&points);
        let found = names.iter().find(|name| name.ends_with(".ntx")).unwrap();
        std::fs::read(points.join(found)).unwrap()
    };
    assert!(asset("killed") == asset("whole"), "other bytes");
    let psnr = |summary: &Value| summary["sets"][0]["rows"][0]["psnr"].clone();
    assert!(psnr(&killed).is_f64(), "{killed}");
    assert_eq!(psnr(&killed), psnr(&whole));
}

#[test]
fn the_committed_plans_are_plans() {
    for name in files_in(
        Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("plans/evaluate")
            .as_path(),
    ) {
        let path = plan(name.strip_suffix(".toml").unwrap());
        let text = std::fs::read_to_string(&path).unwrap();
        // The variable is this test's own business: any folder will do.
        let text = text.replace("$NTMU_TEXTURES", "textures");
        ntmu::evaluate::Plan::parse(Path::new(&path), &text).unwrap();
    }
}
