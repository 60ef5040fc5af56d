//! `ntmu simulate`: what it prints, and what it refuses.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod support;

use ntmu::conformance::synthetic::{self, Spec};
use ntmu::model::time::{Cause, Resource, Unit};
use serde_json::Value;
use std::path::Path;
use support::command::{folder, json, ntmu, stderr};

fn simulate(options: &[&str], folder: &Path) -> Value {
    let arguments = [&["simulate", "--json"], options].concat();
    json(&ntmu(&arguments, folder))
}

fn number(value: &Value) -> u64 {
    value.as_u64().unwrap()
}

fn cycles(run: &Value) -> u64 {
    number(&run["totals"]["cycles"])
}

/// Whether a number of a result is the one computed here. `serde_json` reads a number of 17 digits to
/// within a unit of its last place, and so does it here.
fn assert_same(found: &Value, expected: f64) {
    let found = found.as_f64().unwrap();
    let off = (found - expected).abs();
    assert!(
        off <= 2.0 * f64::EPSILON * expected.abs(),
        "{found} {expected}"
    );
}

/// Scenes and scans small enough for a test.
const RUNS: [&[&str]; 5] = [
    &["--size", "96x64"],
    &["--access", "zorder:mip=1"],
    &["--access", "sphere", "--size", "64x64", "--filter", "point"],
    &[
        "--access",
        "quad:scale=3",
        "--size",
        "64x48",
        "--anisotropy",
        "4",
        "--unit",
        "mobile",
    ],
    &[
        "--size",
        "64x64",
        "--order",
        "filter-then-decode",
        "--layout",
        "morton+planar",
    ],
];

#[test]
fn the_ledger_adds_up_to_the_cycles_and_its_shares_to_all_of_them() {
    let folder = folder();
    for options in RUNS {
        let results = simulate(options, folder.path());
        let brackets = &results["brackets"];
        for run in [
            &results["run"],
            &brackets["no_cache"],
            &brackets["infinite_cache"],
        ] {
            let ledger = run["ledger"].as_array().unwrap();
            assert_eq!(ledger.len(), Cause::ALL.len());
            let sum = |key: &str| ledger.iter().map(|row| number(&row[key])).sum::<u64>();
            assert_eq!(sum("cycles"), cycles(run), "{options:?}");
            assert_eq!(sum("hundredths_of_percent"), 10_000, "{options:?}");
        }
    }
}

#[test]
fn a_run_lies_between_its_brackets_and_above_its_bounds() {
    let folder = folder();
    for options in RUNS {
        let results = simulate(options, folder.path());
        let (run, brackets) = (&results["run"], &results["brackets"]);
        let [none, infinite] = ["no_cache", "infinite_cache"].map(|name| &brackets[name]);
        assert!(cycles(none) >= cycles(run), "{options:?}");
        assert!(cycles(run) >= cycles(infinite), "{options:?}");
        for run in [run, none, infinite] {
            let bounds = &run["closed_form"];
            let bound = number(&bounds["cycles"]);
            assert!(cycles(run) >= bound, "{options:?}");
            assert!(bound >= number(&bounds["critical_path_cycles"]));
            let resources = bounds["resources"].as_array().unwrap();
            assert_eq!(resources.len(), Resource::ALL.len());
            let largest = resources
                .iter()
                .max_by_key(|row| number(&row["bound_cycles"]));
            let largest = number(&largest.unwrap()["bound_cycles"]);
            let binding = resources
                .iter()
                .find(|row| row["resource"] == bounds["binds"]);
            assert_eq!(number(&binding.unwrap()["bound_cycles"]), largest);
            assert!(bound >= largest, "{options:?}");
        }
        // An infinite cache fetches each line once.
        let totals = &infinite["totals"];
        assert_eq!(totals["fetched_lines"], totals["distinct_lines"]);
    }
}

#[test]
fn figures_are_those_of_the_counts() {
    let folder = folder();
    for options in RUNS {
        let results = simulate(&[options, &["--energy"]].concat(), folder.path());
        let run = &results["run"];
        let (totals, throughput) = (&run["totals"], &run["throughput"]);
        let [pixels, texels, decodes] =
            ["pixels", "texels", "decodes"].map(|name| number(&totals[name]) as f64);
        let each = pixels / cycles(run) as f64;
        assert_same(&throughput["pixels_per_cycle"], each);
        let clock = throughput["clock_mhz"].as_f64().unwrap() / 1000.0;
        assert_same(&throughput["gigapixels_per_second"], each * clock);
        assert!(texels >= pixels && texels >= decodes, "{options:?}");
        let found = ["hits", "merges", "misses"].map(|name| number(&totals[name]));
        assert_eq!(found.iter().sum::<u64>(), number(&totals["lookups"]));
        let levels = run["traffic"].as_array().unwrap();
        assert_eq!(levels.len(), 5);
        for level in levels {
            let bytes = number(&level["bytes"]) as f64;
            assert_same(&level["bytes_per_pixel"], bytes / pixels);
            assert_same(&level["bytes_per_texel"], bytes / texels);
            assert_same(&level["bytes_per_block"], bytes / (pixels / 16.0));
        }
        let macs = results["energy"]["operations"].as_array().unwrap().iter();
        let macs = macs.filter(|row| row["operation"].as_str().unwrap().starts_with("macs_"));
        let macs: u64 = macs.map(|row| number(&row["count"])).sum();
        assert_eq!(number(&totals["macs"]), macs);
    }
}

#[test]
fn results_name_what_they_were_made_with() {
    let folder = folder();
    let options = ["--size", "64x48", "--set", "mshrs=8", "--copies", "2"];
    let results = simulate(&options, folder.path());
    let identities = &results["identities"];
    let unit = Unit::desktop().with(&[("mshrs", "8")]).unwrap();
    assert_eq!(identities["unit"], unit.identity());
    let asset = ntmu::built_in::asset().unwrap();
    let material = &identities["materials"][0];
    assert_eq!(material["profile"], asset.profile.identity());
    assert_eq!(identities["copies"], 2);
    assert_eq!(identities["layout"], "tiles-4");
    assert_eq!(identities["interleave"], "tiles:32");
    let access = "plane:height=1.7,pitch=10,fov=60,size=1,order=tiles:8,detail=gradients";
    assert_eq!(identities["access"], access);
    // Each copy has weights of its own, which come in at least once.
    assert!(number(&results["run"]["totals"]["weight_fills"]) >= 2);
    let text = String::from_utf8(ntmu(&["simulate", "--size", "64x48"], folder.path()).stdout);
    let text = text.unwrap();
    for said in [
        Unit::desktop().identity().as_str(),
        access,
        "tiles-4",
        "100.00",
    ] {
        assert!(text.contains(said), "{said}: {text}");
    }
}

#[test]
fn the_same_command_prints_the_same_bytes() {
    let folder = folder();
    for options in [
        ["--size", "96x64", "--copies", "3"].as_slice(),
        &["--size", "512x256", "--sample", "0.1", "--seed", "7"],
    ] {
        let arguments = [&["simulate", "--json"], options].concat();
        let first = ntmu(&arguments, folder.path());
        let second = ntmu(&arguments, folder.path());
        assert!(first.status.success(), "{}", stderr(&first));
        assert_eq!(first.stdout, second.stdout);
    }
}

#[test]
fn a_sample_of_all_is_the_whole_run_and_a_short_stream_is_run_whole() {
    let folder = folder();
    let size = ["--size", "256x128"];
    let of = |share| simulate(&[&size[..], &["--sample", share]].concat(), folder.path());
    let whole = of("off");
    assert_eq!(whole["sample"], Value::Null);
    assert_eq!(of("1"), whole);
    assert_eq!(of("auto"), whole);
}

#[test]
fn an_estimate_says_how_it_was_made_and_depends_on_its_seed() {
    let folder = folder();
    let options = [
        "--size",
        "512x256",
        "--sample",
        "0.1",
        "--measure-after",
        "512",
    ];
    let first = simulate(&options, folder.path());
    let sample = &first["sample"];
    let estimate = &sample["cycles_per_block"];
    let ends = ["low", "mean", "high"].map(|end| estimate[end].as_f64().unwrap());
    assert!(ends.is_sorted(), "{ends:?}");
    assert_eq!(sample["confidence"], 0.95);
    assert!(sample["warm_up_check"]["cycles_change_percent"].is_number());
    assert_eq!(
        estimate["mean"],
        first["run"]["throughput"]["cycles_per_block"]
    );
    assert_eq!(first["run"]["totals"]["distinct_lines"], Value::Null);
    let other = simulate(&[&options[..], &["--seed", "1"]].concat(), folder.path());
    assert_ne!(other["sample"]["cycles_per_block"], *estimate);
}

#[test]
fn a_trace_file_that_was_written_gives_the_run_that_wrote_it() {
    let folder = folder();
    let scene = ["--size", "256x128", "--write-trace", "trace.csv"];
    let file = ["--access", "trace.csv"];
    let first = simulate(&scene, folder.path());
    let second = simulate(&file, folder.path());
    assert_eq!(first["run"], second["run"]);
    assert_eq!(first["brackets"], second["brackets"]);
    let sampled = simulate(
        &[&file[..], &["--sample", "0.25", "--measure-after", "256"]].concat(),
        folder.path(),
    );
    assert!(sampled["sample"]["segments"].is_u64());
}

#[test]
fn a_ramulator_trace_has_a_line_for_each_line_asked_of_memory() {
    let folder = folder();
    let options = ["--size", "96x64", "--ramulator", "misses.trace"];
    let run = simulate(&options, folder.path());
    let text = std::fs::read_to_string(folder.path().join("misses.trace")).unwrap();
    let line_bytes = u64::from(Unit::desktop().line_bytes);
    for line in text.lines() {
        let address = u64::from_str_radix(line.strip_prefix("LD 0x").unwrap(), 16);
        assert!(address.unwrap().is_multiple_of(line_bytes), "{line}");
    }
    let lines = text.lines().count() as u64;
    assert_eq!(lines, number(&run["run"]["totals"]["fetched_lines"]));
}

#[test]
fn a_run_behind_a_warm_up_has_the_pixels_that_are_left() {
    let folder = folder();
    let whole = simulate(&["--size", "96x64"], folder.path());
    let options = ["--size", "96x64", "--measure-after", "1000"];
    let results = simulate(&options, folder.path());
    assert_eq!(results["run"], whole["run"]);
    let behind = &results["behind_warm_up"];
    let warm_up = number(&behind["warm_up_pixels"]);
    assert!(warm_up >= 1000);
    let all = number(&whole["run"]["totals"]["pixels"]);
    assert_eq!(warm_up + number(&behind["pixels"]), all);
    let ledger = behind["ledger"].as_array().unwrap().iter();
    let sum: u64 = ledger.map(|row| number(&row["cycles"])).sum();
    assert_eq!(sum, number(&behind["cycles"]));
    assert!(sum < cycles(&whole["run"]));
}

#[test]
fn what_cannot_be_run_is_refused_with_what_is_allowed_and_nothing_is_written() {
    let folder = folder();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("empty.csv", "u,v,lod\n");
    write("wrong.csv", "u,v,lod\n0,0,0\n0,nan,0\n");
    write("beyond.csv", "x,y,mip\n0,999,0\n");
    write("no.ntx", "no asset");
    write("border.toml", "address = [\"border\", \"wrap\"]\n");
    let mut spec = Spec::small(64, 64);
    spec.shape.grids[1].scale_log2 -= 1;
    let two = synthetic::asset(&spec, 1).unwrap();
    std::fs::write(folder.path().join("two.ntx"), two.to_bytes()).unwrap();
    let before = std::fs::read_dir(folder.path()).unwrap().count();
    let cases: &[(&[&str], &str)] = &[
        (&["missing.ntx"], "missing.ntx"),
        (&["no.ntx"], "no.ntx"),
        (&["--unit", "phone"], "mobile, console, desktop"),
        (&["--set", "mshr=8"], "mshrs"),
        (&["--set", "mshrs"], "FIELD=VALUE"),
        (&["--set", "mshrs=0"], "1..=4096"),
        (&["--layout", "tiles-5"], "tiles-4"),
        (
            &["two.ntx", "--layout", "linear+together"],
            "grids of one size",
        ),
        (&["--access", "flat"], "plane, sphere"),
        (&["--access", "plane:roll=1"], "pitch"),
        (&["--access", "plane:pitch=100"], "-90 to 90"),
        (&["--access", "raster:mip=20"], "0..=6"),
        (&["--access", "plane:pitch=-90"], "no pixel that asks"),
        (&["--access", "missing.csv"], "missing.csv"),
        (&["--access", "empty.csv"], "one or more"),
        (&["--access", "wrong.csv"], "row 2, column v"),
        (&["--access", "beyond.csv"], "0..=255"),
        (&["--access", "empty.csv", "--size", "8x8"], "a scene"),
        (&["--access", "raster", "--filter", "point"], "no effect"),
        (&["--access", "raster", "--stochastic"], "no effect"),
        (&["--size", "0x8"], "1..=16384"),
        (&["--size", "20000x8"], "1..=16384"),
        (&["--size", "8"], "WIDTHxHEIGHT"),
        (&["--interleave", "tiles:3"], "an even N"),
        (&["--copies", "0"], "1..=65535"),
        (&["--copies", "70000"], "1..=65535"),
        (&["--anisotropy", "17"], "1..=16"),
        (&["--anisotropy", "4", "--filter", "point"], "filter linear"),
        (&["--filter", "cubic"], "trilinear"),
        (&["--order", "both"], "filter-then-decode"),
        (&["--sampler", "border.toml"], "one a channel"),
        (&["--sampler", "missing.toml"], "missing.toml"),
        (&["--sample", "0"], "auto, off, or a share"),
        (&["--sample", "1.5"], "auto, off, or a share"),
        (&["--size", "8x8", "--measure-after", "64"], "fewer than"),
        (
            &["--size", "64x48", "--measure-after", "3000"],
            "fewer than",
        ),
        (&["--energy=gold"], "energy-7nm"),
        (&["--profile", "d3d12"], "nt-d3d11"),
        (&["--sample", "0.5"], "--sample off"),
        (&["--size", "8x8", "--write-trace", "no/t.csv"], "no/t.csv"),
    ];
    for (options, said) in cases {
        let output = ["--ramulator", "left.trace"];
        let arguments = [&["simulate"], *options, &output].concat();
        let refused = ntmu(&arguments, folder.path());
        assert_eq!(refused.status.code(), Some(2), "{options:?}");
        let message = stderr(&refused);
        assert!(message.contains(said), "{options:?}: {message}");
        assert!(refused.stdout.is_empty(), "{options:?}");
        let after = std::fs::read_dir(folder.path()).unwrap().count();
        assert_eq!(after, before, "{options:?}");
    }
    let into_nowhere = ["simulate", "--size", "8x8", "--ramulator", "no/left.trace"];
    let refused = ntmu(&into_nowhere, folder.path());
    assert_eq!(refused.status.code(), Some(2));
    let again = [
        "simulate",
        "--access",
        "empty.csv",
        "--write-trace",
        "t.csv",
    ];
    assert_eq!(ntmu(&again, folder.path()).status.code(), Some(2));
}

#[test]
fn a_run_leaves_the_files_that_were_asked_for_and_reads_as_it_would_without() {
    let folder = folder();
    let scan = ["--access", "blocks:mip=2", "--no-brackets", "--json"];
    let plain = ntmu(&[&["simulate"], &scan[..]].concat(), folder.path());
    let files = ["vcd", "perfetto", "konata", "ramulator", "heatmap"];
    let options = files.map(|file| format!("--{file}"));
    let mut arguments = [&["simulate"], &scan[..]].concat();
    for (option, file) in options.iter().zip(files) {
        arguments.extend([option.as_str(), file]);
    }
    let watched = ntmu(&arguments, folder.path());
    assert_eq!(watched.stdout, plain.stdout, "{}", stderr(&watched));
    let begins: [&[u8]; 5] = [b"$", b"{", b"Kanata\t0004\n", b"LD 0x", b"\x89PNG"];
    for (file, begin) in files.into_iter().zip(begins) {
        let bytes = std::fs::read(folder.path().join(file)).unwrap();
        assert!(bytes.starts_with(begin), "{file}");
    }
    let refused = ntmu(&["simulate", "--cycles", "9..3"], folder.path());
    assert_eq!(refused.status.code(), Some(2));
}
