//! The command line: what it writes, what it refuses, and how it exits.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod support;

use serde_json::Value;
use std::path::Path;
use support::command::{asset_in, folder, json, ntmu, stderr};

fn files_in(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut names: Vec<String> = entries
        .map(|e| e.unwrap().file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

#[test]
fn study_writes_its_three_files_and_its_ledgers_add_up() {
    let folder = folder();
    let study = json(&ntmu(&["study", "--quick", "--json"], folder.path()));
    assert_eq!(
        files_in(&folder.path().join("study")),
        ["report.html", "study.json", "vectors.json"]
    );
    let text = std::fs::read_to_string(folder.path().join("study/study.json")).unwrap();
    assert_eq!(serde_json::from_str::<Value>(&text).unwrap(), study);
    let rows = study["timing"].as_array().unwrap();
    assert_eq!(
        rows.len(),
        36,
        "three units with six layouts on two accesses"
    );
    for row in rows {
        let charges = row["ledger"].as_array().unwrap();
        let sum: u64 = charges
            .iter()
            .map(|charge| charge["cycles"].as_u64().unwrap())
            .sum();
        assert_eq!(Some(sum), row["cycles"].as_u64());
    }
    let channels = study["asset"]["channels"].as_u64().unwrap();
    let codes = study["asset"]["texels"].as_u64().unwrap() * channels;
    assert_eq!(study["oracle"]["codes"].as_u64(), Some(codes));
    // The asset says what its trainer measured.
    let record = ntmu::built_in::asset().unwrap().metadata.record.clone();
    let trained = record
        .iter()
        .find(|(key, _)| key == "psnr_quantised")
        .unwrap();
    let psnr = study["quality"]["overall"]["psnr"].as_f64().unwrap();
    assert_eq!(format!("{psnr:.3}"), trained.1);
    assert!(!study["sweep"].as_array().unwrap().is_empty());
    if study["twin"]["status"] == "skipped" {
        support::skip(study["twin"]["reason"].as_str().unwrap());
    } else {
        assert_eq!(study["twin"]["codes"].as_u64(), Some(codes));
        assert_eq!(study["twin"]["differing"], 0);
    }
    // Its own vectors pass on the model.
    let run = ntmu(&["conform", "run", "study/vectors.json"], folder.path());
    assert!(run.status.success(), "{}", stderr(&run));
}

#[test]
fn the_same_study_twice_is_the_same_bytes() {
    let folder = folder();
    for name in ["a", "b"] {
        let asset = asset_in(folder.path());
        let output = ntmu(
            &["study", "--quick", asset.to_str().unwrap(), "-o", name],
            folder.path(),
        );
        assert!(output.status.success(), "{}", stderr(&output));
    }
    for file in ["report.html", "study.json", "vectors.json"] {
        let read = |name: &str| std::fs::read(folder.path().join(name).join(file)).unwrap();
        assert!(read("a") == read("b"), "{file} differs");
    }
}

#[test]
fn decoded_images_compare_as_the_asset_does() {
    let folder = folder();
    let asset = asset_in(folder.path());
    let asset = asset.to_str().unwrap();
    json(&ntmu(
        &["generate", "-o", "source", "--json"],
        folder.path(),
    ));
    for (name, format) in [("png8", "png8"), ("png16", "png16"), ("exr", "exr")] {
        let decode = [
            "decode", asset, "-o", name, "--mip", "0", "--format", format, "--json",
        ];
        json(&ntmu(&decode, folder.path()));
    }
    let whole = json(&ntmu(
        &["compare", "source", asset, "--json"],
        folder.path(),
    ));
    let of = |value: &Value| value["quality"]["mips"][0]["psnr"].as_f64().unwrap();
    for name in ["png8", "png16", "exr"] {
        let images = json(&ntmu(&["compare", "source", name, "--json"], folder.path()));
        // The codes have 8 bits: every container holds them exactly, up to the f32 of a real.
        assert!((of(&whole) - of(&images)).abs() < 1e-4, "{name}");
    }
    let decoded = json(&ntmu(
        &["decode", asset, "-o", "chain", "--json"],
        folder.path(),
    ));
    assert_eq!(
        decoded["written"].as_array().unwrap().len(),
        7 * 5,
        "7 mips of 5 maps"
    );
    let too_good = ntmu(
        &["compare", "source", asset, "--min-psnr", "90"],
        folder.path(),
    );
    assert_eq!(too_good.status.code(), Some(1));
}

#[test]
fn texel_shows_the_codes_that_decode_writes() {
    let folder = folder();
    let asset = asset_in(folder.path());
    let asset = asset.to_str().unwrap();
    let texel = json(&ntmu(
        &["texel", asset, "10", "20", "0", "--json"],
        folder.path(),
    ));
    let codes: Vec<i64> = texel["codes"]
        .as_array()
        .unwrap()
        .iter()
        .map(|code| code.as_i64().unwrap())
        .collect();
    let built_in = ntmu::built_in::asset().unwrap();
    let model = ntmu::decoded::Decoded::of_mip(&built_in, 0);
    let expected: Vec<i64> = (0..codes.len())
        .map(|channel| i64::from(model.mips[0][[channel, 20, 10]]))
        .collect();
    assert_eq!(codes, expected);
    let table = ntmu(&["texel", asset, "10", "20", "0"], folder.path());
    let table = String::from_utf8(table.stdout).unwrap();
    for word in [
        "grid 0",
        "grid 1",
        "inputs",
        "layer 0",
        "accumulators",
        "codes",
        "color",
    ] {
        assert!(table.contains(word), "{word}");
    }
}

#[test]
fn a_printed_program_is_accepted_again() {
    let folder = folder();
    let asset = asset_in(folder.path());
    let asset = asset.to_str().unwrap();
    let printed = ntmu(&["program", asset, "--layout", "tiles-4"], folder.path());
    std::fs::write(folder.path().join("wall.asm"), &printed.stdout).unwrap();
    let again = ntmu(&["program", asset, "--check", "wall.asm"], folder.path());
    assert_eq!(printed.stdout, again.stdout);
    std::fs::write(folder.path().join("bad.asm"), "position g0\nfly\n").unwrap();
    let bad = ntmu(&["program", asset, "--check", "bad.asm"], folder.path());
    assert_eq!(bad.status.code(), Some(2));
    assert!(stderr(&bad).contains("line 2"), "{}", stderr(&bad));
}

#[test]
fn the_manual_holds_every_instruction_in_both_forms() {
    let folder = folder();
    let rows = json(&ntmu(&["program", "--manual", "--json"], folder.path()));
    let text = ntmu(&["program", "--manual"], folder.path());
    let text = String::from_utf8(text.stdout).unwrap();
    let table = ntmu::isa::instruction::TABLE;
    assert_eq!(rows.as_array().unwrap().len(), table.len());
    for (row, expected) in rows.as_array().unwrap().iter().zip(table) {
        assert_eq!(row["mnemonic"], expected.mnemonic);
        assert!(text.contains(&format!("`{}`", expected.mnemonic)));
        assert_eq!(row["class"], expected.class.name());
    }
}

#[test]
fn wrong_input_is_refused_with_what_was_found_where_and_what_is_allowed() {
    let folder = folder();
    let asset = asset_in(folder.path());
    let asset = asset.to_str().unwrap();
    let mut damaged = ntmu::built_in::BYTES.to_vec();
    damaged[5000] ^= 4;
    std::fs::write(folder.path().join("damaged.ntx"), damaged).unwrap();
    std::fs::write(
        folder.path().join("short.ntx"),
        &ntmu::built_in::BYTES[..1000],
    )
    .unwrap();
    std::fs::write(folder.path().join("foreign.ntx"), b"\x89PNG\r\n\x1a\n....").unwrap();
    std::fs::write(folder.path().join("empty.ntx"), b"").unwrap();
    std::fs::create_dir(folder.path().join("nothing")).unwrap();
    let cases: [(&[&str], &str); 11] = [
        (&["info", "missing.ntx"], "missing.ntx"),
        (&["info", "damaged.ntx"], "CRC-32"),
        (&["info", "short.ntx"], "ends after 1000 bytes"),
        (&["info", "foreign.ntx"], "not an .ntx file"),
        (&["info", "empty.ntx"], "not an .ntx file"),
        (&["info", "nothing"], "nothing"),
        (&["texel", asset, "256", "0", "0"], "x 0..=255"),
        (&["texel", asset, "0", "0", "7"], "mips 0..=6"),
        (&["decode", asset, "-o", "out", "--mip", "9"], "mips 0..=6"),
        (&["compare", "nothing", asset], "nothing"),
        (&["conform", "run", "foreign.ntx"], "foreign.ntx"),
    ];
    for (arguments, word) in cases {
        let output = ntmu(arguments, folder.path());
        assert_eq!(
            output.status.code(),
            Some(2),
            "{arguments:?}: {}",
            stderr(&output)
        );
        assert!(
            stderr(&output).contains(word),
            "{arguments:?}: {}",
            stderr(&output)
        );
        assert!(output.stdout.is_empty(), "{arguments:?}");
    }
    assert!(
        !folder.path().join("out").exists(),
        "nothing is left of a refused decode"
    );
}

#[cfg(not(feature = "train"))]
#[test]
fn encode_without_the_trainer_says_which_command_brings_it() {
    let output = ntmu(&["encode", "--built-in", "-o", "x.ntx"], folder().path());
    assert_eq!(output.status.code(), Some(2));
    let command = "cargo run --release --features train -- encode --built-in -o x.ntx";
    assert!(stderr(&output).contains(command), "{}", stderr(&output));
}
