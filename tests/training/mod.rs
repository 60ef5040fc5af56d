//! Runs of the real program, and what they leave.

mod budgets;
mod kill;
mod loss;
mod places;
mod settle;
mod shape;
mod threads;

use crate::support::command::{ntmu, stderr};
use ntmu::isa::Asset;
use std::path::Path;
use tempfile::TempDir;

/// A plan with a stage of every kind, short.
const PLAN: &str = r#"
name = "every kind"

[[stage]]
train = "encoder"
steps = 30
latents = "noise"
numbers = "real"

[[stage]]
train = "encoder"
steps = 30
latents = "rounded"
numbers = "deployed"

[[stage]]
train = "latents"
steps = 150
latents = "rounded"
numbers = "deployed"

[[stage]]
train = "synthesizer"
steps = 100
latents = "rounded"
numbers = "deployed"
"#;

/// A folder with the built-in set at 64 × 64 in `set`, a plan in `plan.toml`, and `small.toml` with
/// a small encoder and frequent checkpoints.
fn folder() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let generated = ntmu(&["generate", "-o", "set", "--size", "64"], folder.path());
    assert!(generated.status.success(), "{}", stderr(&generated));
    std::fs::write(folder.path().join("plan.toml"), PLAN).unwrap();
    let small = "encoder_width = 8\ncrop = 64\nbatch = 768\ncheckpoint_every = 3\n";
    std::fs::write(folder.path().join("small.toml"), small).unwrap();
    folder
}

/// `ntmu encode` of that set to `output`, with `more` arguments.
fn encode<'a>(output: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    let mut arguments = vec![
        "encode",
        "set",
        "-o",
        output,
        "--preset",
        "hw-16",
        "--config",
        "small.toml",
    ];
    arguments.extend(more);
    arguments
}

/// Its exit code and what it said, after a run in `folder`.
fn run(folder: &Path, arguments: &[&str]) -> (Option<i32>, String) {
    let output = ntmu(arguments, folder);
    (output.status.code(), stderr(&output))
}

fn done(folder: &Path, arguments: &[&str]) {
    let (code, said) = run(folder, arguments);
    assert_eq!(code, Some(0), "{said}");
}

fn read(folder: &Path, name: &str) -> Vec<u8> {
    std::fs::read(folder.join(name)).unwrap()
}

/// What an asset's record says of `key`.
fn recorded(bytes: &[u8], key: &str) -> Option<String> {
    let asset = Asset::from_bytes(bytes).unwrap();
    let record = asset.metadata.record.iter();
    record
        .filter(|(name, _)| name == key)
        .map(|(_, value)| value.clone())
        .next()
}
