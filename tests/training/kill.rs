//! A process that is killed at any moment loses nothing that matters.

use super::{encode, folder, read, run};
use serde_json::Value;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

/// The lines of a log, without the seconds; the last may be cut off.
fn lines(folder: &Path, name: &str) -> Vec<Value> {
    let text = std::fs::read_to_string(folder.join(name)).unwrap_or_default();
    let lines = text.lines().map(serde_json::from_str::<Value>);
    lines
        .map_while(Result::ok)
        .map(|mut line| {
            line.as_object_mut().unwrap().remove("seconds");
            line
        })
        .collect()
}

fn spawn(folder: &Path, arguments: &[&str]) -> Child {
    Command::new(env!("CARGO_BIN_EXE_ntmu"))
        .args(arguments)
        .current_dir(folder)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap()
}

#[test]
fn a_run_killed_at_random_points_and_resumed_ends_with_the_bytes_of_an_uninterrupted_run() {
    let folder = folder();
    let folder = folder.path();
    let plan = ["--plan", "plan.toml", "--settle", "2"];
    let (code, said) = run(
        folder,
        &encode(
            "whole.ntx",
            &[plan.as_slice(), &["--log", "whole.jsonl"]].concat(),
        ),
    );
    assert_eq!(code, Some(0), "{said}");
    let said = lines(folder, "whole.jsonl");
    let settled = said.iter().filter(|line| line["stage"] == "settling");
    assert_eq!(settled.count(), 2);
    let total = said[0]["total"].as_u64().unwrap();

    let mut arguments = encode(
        "killed.ntx",
        &[plan.as_slice(), &["--log", "killed.jsonl"]].concat(),
    );
    let checkpoint = folder.join("killed.ntx.checkpoint");
    // Where the kills fall is chosen by a generator (Knuth's MMIX constants), and within a step or a
    // write of a checkpoint by the machine.
    let mut state = 0x5eed_u64;
    let mut kills = 0;
    for round in 1..=6_u64 {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        let at = (round * total / 7).saturating_sub((state >> 33) % 20);
        if checkpoint.exists() && !arguments.contains(&"--resume") {
            arguments.push("--resume");
        }
        let mut child = spawn(folder, &arguments);
        loop {
            let last = lines(folder, "killed.jsonl").last().cloned();
            if last.is_some_and(|line| line["done"].as_u64().is_some_and(|done| done >= at)) {
                break;
            }
            assert!(
                child.try_wait().unwrap().is_none(),
                "round {round}: it ended before step {at}"
            );
            std::thread::sleep(Duration::from_millis(1));
        }
        std::thread::sleep(Duration::from_millis((state >> 40) % 30));
        // On Unix, SIGKILL.
        child.kill().unwrap();
        let status = child.wait().unwrap();
        kills += u32::from(!status.success());
    }
    assert_eq!(kills, 6, "a run ended before it was killed");
    assert!(checkpoint.exists() && !folder.join("killed.ntx").exists());
    if !arguments.contains(&"--resume") {
        arguments.push("--resume");
    }
    let (code, said) = run(folder, &arguments);
    assert_eq!(code, Some(0), "{said}");
    assert!(
        read(folder, "killed.ntx") == read(folder, "whole.ntx"),
        "other bytes"
    );
    assert_eq!(lines(folder, "killed.jsonl"), lines(folder, "whole.jsonl"));
    let left = std::fs::read_dir(folder).unwrap();
    let names: Vec<_> = left.map(|entry| entry.unwrap().file_name()).collect();
    let name = |n: &std::ffi::OsString| n.to_string_lossy().into_owned();
    assert!(
        names.iter().map(name).all(|n| !n.contains("checkpoint")),
        "{names:?}"
    );
}
