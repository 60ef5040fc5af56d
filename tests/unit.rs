//! `ntmu unit`: what it prints, and what it refuses.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod support;

use ntmu::model::time::Unit;
use ntmu::model::time::energy::Operation;
use support::command::{folder, json, ntmu, stderr};

#[test]
fn the_presets_are_listed_and_each_field_has_a_reason() {
    let folder = folder();
    let listed = json(&ntmu(&["unit", "--json"], folder.path()));
    let units = Unit::presets();
    assert_eq!(listed.as_array().unwrap().len(), units.len());
    for (described, unit) in listed.as_array().unwrap().iter().zip(units) {
        assert_eq!(described["identity"], unit.identity());
        let fields = described["fields"].as_object().unwrap();
        assert_eq!(fields.len(), unit.fields().len());
        assert!(fields.values().all(|field| field["why"].is_string()));
    }
}

#[test]
fn a_file_of_its_own_making_is_the_same_unit() {
    let folder = folder();
    let path = |name: &str| folder.path().join(name);
    std::fs::write(path("mine.toml"), "base = \"desktop\"\nmshrs = 32\n").unwrap();
    let mine = json(&ntmu(&["unit", "mine.toml", "--json"], folder.path()));
    let set = ["unit", "desktop", "--set", "mshrs=32"];
    let text = ntmu(&[&set[..], &["--toml"]].concat(), folder.path());
    std::fs::write(path("again.toml"), text.stdout).unwrap();
    let again = json(&ntmu(&["unit", "again.toml", "--json"], folder.path()));
    let set = json(&ntmu(&[&set[..], &["--json"]].concat(), folder.path()));
    let hash = |described: &serde_json::Value| {
        let identity = described["identity"].as_str().unwrap();
        identity.split_once('@').unwrap().1.to_owned()
    };
    assert_eq!(mine["name"], "mine");
    assert_eq!(set["name"], "desktop, mshrs = 32");
    assert_eq!(mine["fields"]["mshrs"]["value"], 32);
    assert_eq!(mine["fields"]["mshrs"]["why"], serde_json::Value::Null);
    assert_eq!([hash(&set), hash(&again)], [hash(&mine), hash(&mine)]);
    assert_ne!(hash(&mine), Unit::desktop().hash());
}

#[test]
fn every_operation_has_a_price_a_formula_and_a_source() {
    let folder = folder();
    for table in ["--energy", "--energy=energy-7nm"] {
        let run = ntmu(&["unit", "desktop", table, "--json"], folder.path());
        let priced = json(&run)["energy"]["operations"].clone();
        assert_eq!(priced.as_object().unwrap().len(), Operation::ALL.len());
        for operation in Operation::ALL {
            let level = &priced[operation.name()];
            assert!(level["picojoules"].as_f64().unwrap() > 0.0);
            assert!(!level["formula"].as_str().unwrap().is_empty());
            assert!(!level["source"].as_str().unwrap().is_empty());
        }
    }
}

#[test]
fn a_bad_unit_is_refused_with_where_found_and_allowed_and_exit_code_2() {
    let folder = folder();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("key.toml", "base = \"mobile\"\nmshr = 1\n");
    write("part.toml", "mshrs = 1\n");
    write("free.toml", "about = \"nothing costs anything\"\n");
    for (arguments, expected) in [
        (&["phone"][..], "allowed: mobile, console, desktop"),
        (&["key.toml"], "key.toml: unit field: found \"mshr\""),
        (&["part.toml"], "part.toml: unit: found no clock_mhz, "),
        (
            &["mobile", "--set", "mshrs"],
            "--set: found \"mshrs\"; allowed: FIELD=VALUE",
        ),
        (
            &["mobile", "--set", "mshrs=0"],
            "unit.mshrs: found 0; allowed: 1..=4096",
        ),
        (
            &["mobile", "--energy=5nm"],
            "energy table: found \"5nm\"; allowed: energy, energy-7nm",
        ),
        (
            &["mobile", "--energy=free.toml"],
            "free.toml: no energy table: ",
        ),
        (
            &["--set", "mshrs=1"],
            "required arguments were not provided",
        ),
    ] {
        let run = ntmu(&[&["unit"], arguments].concat(), folder.path());
        assert_eq!(run.status.code(), Some(2), "{arguments:?}");
        assert!(stderr(&run).contains(expected), "{}", stderr(&run));
        assert!(run.stdout.is_empty());
    }
}
