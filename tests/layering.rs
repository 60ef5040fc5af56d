//! Who may import whom, and the shape of the sources.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// Crate, and the crates of this workspace that it may use. The root may use all.
const MAY_USE: [(&str, &[&str]); 5] = [
    ("isa", &[]),
    ("model", &["ntmu-isa"]),
    ("shaders", &["ntmu-isa"]),
    ("trainer", &["ntmu-isa", "ntmu-model"]),
    ("conformance", &["ntmu-isa", "ntmu-model"]),
];

/// Outside crates that only one room may know.
const OWNED: [(&str, &str); 2] = [("burn-tensor", "trainer"), ("wgpu", "shaders")];

fn manifest(folder: &str) -> toml::Table {
    let path = Path::new(ROOT).join(folder).join("Cargo.toml");
    std::fs::read_to_string(path).unwrap().parse().unwrap()
}

fn dependencies(folder: &str) -> BTreeSet<String> {
    let manifest = manifest(folder);
    let tables = ["dependencies", "build-dependencies"];
    tables
        .iter()
        .filter_map(|name| manifest.get(*name)?.as_table())
        .flat_map(|table| table.keys().cloned())
        .collect()
}

fn sources(folder: &Path, extension: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == extension) {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}

#[test]
fn every_crate_uses_only_what_the_table_allows() {
    for (folder, allowed) in MAY_USE {
        for dependency in dependencies(folder)
            .iter()
            .filter(|d| d.starts_with("ntmu"))
        {
            assert!(
                allowed.contains(&dependency.as_str()),
                "{folder} uses {dependency}"
            );
        }
    }
}

#[test]
fn burn_and_wgpu_each_have_one_owner() {
    for (dependency, owner) in OWNED {
        for folder in [".", "isa", "model", "shaders", "trainer", "conformance"] {
            let uses = dependencies(folder).contains(dependency);
            assert_eq!(uses, folder == owner, "{folder} and {dependency}");
        }
    }
}

#[test]
fn values_and_cycles_never_import_each_other() {
    let model = Path::new(ROOT).join("model/src");
    for (room, forbidden) in [("exec", "time"), ("time", "exec")] {
        for path in sources(&model.join(room), "rs") {
            let text = std::fs::read_to_string(&path).unwrap();
            for form in [
                format!("crate::{forbidden}"),
                format!("super::super::{forbidden}"),
            ] {
                assert!(!text.contains(&form), "{} names {form}", path.display());
            }
        }
    }
}

#[test]
fn the_specification_computes_without_floats_but_for_the_sums_of_fp16_layers() {
    let folder = Path::new(ROOT).join("isa/src");
    let half = folder.join("half.rs");
    for path in sources(&folder, "rs").into_iter().filter(|p| *p != half) {
        for (number, line) in std::fs::read_to_string(&path).unwrap().lines().enumerate() {
            let code = line.split("//").next().unwrap();
            let words: Vec<&str> = code
                .split(|c: char| !c.is_ascii_alphanumeric() && c != '_')
                .collect();
            let float = words.iter().find(|word| ["f32", "f64"].contains(word));
            assert_eq!(float, None, "{}:{}: {line}", path.display(), number + 1);
        }
    }
}

#[test]
fn no_source_file_exceeds_five_hundred_lines() {
    for folder in [
        "src",
        "isa",
        "model",
        "shaders",
        "trainer",
        "conformance",
        "tests",
    ] {
        for extension in ["rs", "wgsl"] {
            for path in sources(&Path::new(ROOT).join(folder), extension) {
                let lines = std::fs::read_to_string(&path).unwrap().lines().count();
                assert!(lines <= 500, "{}: {lines} lines", path.display());
            }
        }
    }
}

#[test]
fn unsafe_code_is_in_the_engines_kernels_alone() {
    let root = Path::new(ROOT);
    let kernels = root.join("model/src/engine/kernel");
    let folders = [
        "src",
        "isa/src",
        "model/src",
        "shaders/src",
        "trainer/src",
        "conformance/src",
    ];
    let mut in_kernels = 0;
    for path in folders
        .iter()
        .flat_map(|folder| sources(&root.join(folder), "rs"))
    {
        let text = std::fs::read_to_string(&path).unwrap();
        let lines = text.lines().map(|line| line.split("//").next().unwrap());
        let found = lines.filter(|code| {
            let mut words = code.split(|c: char| !c.is_ascii_alphanumeric() && c != '_');
            words.any(|word| word == "unsafe")
        });
        let count = found.count();
        if path.starts_with(&kernels) {
            in_kernels += count;
        } else {
            assert_eq!(count, 0, "{}", path.display());
        }
    }
    assert!(in_kernels > 0, "the search finds what it looks for");
}
