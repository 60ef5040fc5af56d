//! The table of texel blocks: what its rows promise, and that the committed page is what the verb makes.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod support;

use ntmu::isa::preset::Preset;
use ntmu::model::time::Unit;
use ntmu::timing::table::{self, Plan, Row};
use std::collections::BTreeMap;
use support::command::{folder, json, ntmu, stderr};

const DOCUMENT: &str = include_str!("../docs/src/throughput.md");

/// The rows that are made again, of every scene; the rest of the page takes minutes.
const UNITS: [&str; 2] = ["console", "desktop"];
const PRESETS: [&str; 4] = ["default", "hw-16", "ntc-2.25", "tsnc"];

/// The page's rows by their headings.
fn sections() -> BTreeMap<&'static str, Vec<&'static str>> {
    let mut sections = BTreeMap::new();
    for section in DOCUMENT.split("\n## ").skip(1) {
        let (heading, rest) = section.split_once('\n').unwrap();
        let rows = rest.lines().filter(|line| line.starts_with("| "));
        sections.insert(heading, rows.skip(1).collect());
    }
    sections
}

#[test]
fn the_committed_page_has_the_rows_that_are_made_again() {
    let plan = Plan {
        units: UNITS.map(|name| Unit::by_name(name).unwrap()).to_vec(),
        presets: PRESETS.map(|name| Preset::by_name(name).unwrap()).to_vec(),
        ..Plan::usual(Vec::new()).unwrap()
    };
    let table = table::run(&plan, |_| {}).unwrap();
    assert_eq!(table.rows.len() as u64, plan.rows());
    assert!(DOCUMENT.starts_with(&table.introduction()));
    let committed = sections();
    for section in table.sections() {
        let heading = section.heading();
        let lines = &committed[heading.strip_prefix("## ").unwrap()];
        for line in section.lines() {
            assert!(lines.contains(&line.as_str()), "{heading}: {line}");
        }
    }
}

#[test]
fn the_committed_page_has_a_row_for_every_preset_precision_unit_and_scene() {
    let plan = Plan::usual(Vec::new()).unwrap();
    let mut committed = sections();
    committed.remove("Extremes").unwrap();
    assert_eq!(committed.len(), plan.units.len() * plan.accesses.len());
    for access in &plan.accesses {
        for unit in &plan.units {
            let found: Vec<(&str, &str)> = committed
                [&*format!("`{access}` on {}", unit.identity())]
                .iter()
                .map(|line| {
                    let cells: Vec<&str> = line.split('|').map(str::trim).collect();
                    (cells[1], cells[2])
                })
                .collect();
            let mut expected = vec![("BC7", "")];
            for preset in &plan.presets {
                expected.extend([(preset.name, "int8"), (preset.name, "fp16")]);
                if unit.narrow_columns > 1 {
                    expected.push((preset.name, "int4"));
                }
            }
            assert_eq!(found, expected, "{access} {}", unit.name());
        }
    }
}

#[test]
fn a_row_lies_above_its_closed_form_and_the_control_is_one() {
    let plan = Plan {
        size: 64,
        screen: [32, 32],
        ..Plan::usual(Vec::new()).unwrap()
    };
    let table = table::run(&plan, |_| {}).unwrap();
    for Row {
        subject,
        unit,
        figures,
        to_control,
        ..
    } in &table.rows
    {
        let at = format!("{} {} on {unit}", subject.name, subject.precision);
        assert!(
            figures.closed_form_per_block <= figures.cycles_per_block,
            "{at}"
        );
        assert!(figures.mac_utilisation <= 1.0, "{at}");
        assert!(figures.largest_stall_share <= 1.0, "{at}");
        if subject.name == "BC7" {
            let ratios = [to_control.cycles, to_control.bytes, to_control.picojoules];
            assert_eq!(ratios, [1.0; 3], "{at}");
            assert_eq!(figures.mac_utilisation, 0.0, "{at}");
        } else {
            assert!(figures.mac_utilisation > 0.0, "{at}");
        }
    }
    for section in table.sections() {
        let of = |preset: &Preset, precision| {
            let mut rows = section.rows.iter();
            let is =
                |row: &&Row| row.subject.name == preset.name && row.subject.precision == precision;
            rows.find(is).map(|row| row.figures.cycles)
        };
        for preset in &Preset::ALL {
            let bytes = of(preset, "int8").unwrap();
            assert!(bytes <= of(preset, "fp16").unwrap(), "{}", preset.name);
            if let Some(narrow) = of(preset, "int4") {
                assert!(narrow <= bytes, "{}", preset.name);
            }
        }
    }
}

#[test]
fn the_verb_prints_the_same_rows_as_tables_markdown_and_json() {
    let folder = folder();
    let arguments = [
        "throughput",
        "--unit",
        "mobile",
        "--preset",
        "hw-16",
        "--size",
        "64",
        "--access",
        "zorder:mip=1",
    ];
    let with = |more: &str| {
        let arguments: Vec<&str> = arguments.into_iter().chain([more]).collect();
        ntmu(&arguments, folder.path())
    };
    let described = json(&with("--json"));
    let rows = described["rows"].as_array().unwrap();
    assert_eq!(rows.len(), 3);
    let identity = Unit::mobile().identity();
    for row in rows {
        assert_eq!(row["unit"], identity);
        assert_eq!(row["access"], "zorder:mip=1");
        assert_eq!(row["figures"]["pixels"], 32 * 32);
    }
    assert!(
        rows[1]["subject"]["profile"]
            .as_str()
            .unwrap()
            .contains('@')
    );
    let markdown = with("--markdown");
    assert!(markdown.status.success(), "{}", stderr(&markdown));
    let text = String::from_utf8(markdown.stdout).unwrap();
    assert!(text.contains(&format!("## `zorder:mip=1` on {identity}")));
    let plain = ntmu(&arguments, folder.path());
    assert!(plain.status.success(), "{}", stderr(&plain));
    let text = String::from_utf8(plain.stdout).unwrap();
    assert!(text.contains(&identity) && text.contains("hw-16"));
}

#[test]
fn what_is_not_there_is_named() {
    let folder = folder();
    for (arguments, expected) in [
        (["--preset", "hw-17"], "found \"hw-17\""),
        (["--unit", "phone"], "found \"phone\""),
        (["--size", "0"], "found 0"),
        (["--access", "trace.csv"], "trace.csv"),
        (["--access", "raster:mip=30"], "mip: found 30"),
    ] {
        let arguments: Vec<&str> = ["throughput"].into_iter().chain(arguments).collect();
        let output = ntmu(&arguments, folder.path());
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        let message = stderr(&output);
        assert!(message.contains(expected), "{arguments:?}: {message}");
    }
}
