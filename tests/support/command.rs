//! The program as a test runs it.
#![allow(dead_code, reason = "not every test binary uses all of it")]

use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

pub(crate) fn ntmu(arguments: &[&str], folder: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_ntmu"))
        .args(arguments)
        .current_dir(folder)
        .output()
        .unwrap()
}

pub(crate) fn folder() -> tempfile::TempDir {
    tempfile::tempdir().unwrap()
}

pub(crate) fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

pub(crate) fn json(output: &Output) -> Value {
    assert!(output.status.success(), "{}", stderr(output));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// The built-in asset as a file in `folder`.
pub(crate) fn asset_in(folder: &Path) -> PathBuf {
    let path = folder.join("wall.ntx");
    std::fs::write(&path, ntmu::built_in::BYTES).unwrap();
    path
}
