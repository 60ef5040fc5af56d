//! Curves, analyses and comparisons from the command line.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod support;

use ntmu::isa::Asset;
use ntmu::isa::pyramid::Pyramid;
use std::path::Path;
use support::command::{asset_in, folder, json, ntmu, stderr};

fn curve(folder: &Path, file: &str, name: &str, rates: &[f64], psnrs: &[f64]) {
    let results = serde_json::json!({ "bpp": rates, "psnr": psnrs });
    let text = serde_json::json!({ "name": name, "description": "", "results": results });
    std::fs::write(folder.join(file), text.to_string()).unwrap();
}

/// The example of the README of PyPI's bjontegaard.
fn readme(folder: &Path) {
    let rates = [9487.76, 4593.60, 2486.44, 1358.24];
    curve(
        folder,
        "a.json",
        "anchor",
        &rates,
        &[40.037, 38.615, 36.845, 34.851],
    );
    let rates = [9787.80, 4469.00, 2451.52, 1356.24];
    curve(
        folder,
        "t.json",
        "test",
        &rates,
        &[40.121, 38.651, 36.970, 34.987],
    );
}

#[test]
fn curve_bd_prints_what_bjontegaard_does() {
    let folder = folder();
    readme(folder.path());
    // bjontegaard 1.3.0.
    for (method, percent, decibels) in [
        ("pchip", -4.417485350589045, 0.11969278542479489),
        ("akima", -4.425245156997493, 0.11940927028529469),
    ] {
        let arguments = [
            "curve", "bd", "a.json", "t.json", "--method", method, "--json",
        ];
        let found = json(&ntmu(&arguments, folder.path()));
        let test = &found["tests"][0];
        let value = |key: &str| test[key]["value"].as_f64().unwrap();
        assert!((value("bd_rate") - percent).abs() < 1e-8);
        assert!((value("bd_psnr") - decibels).abs() < 1e-8);
        assert_eq!(
            (&found["anchor"], &test["name"]),
            (&"anchor".into(), &"test".into())
        );
    }
}

#[test]
fn curves_that_do_not_overlap_fail_the_check_and_say_so() {
    let folder = folder();
    readme(folder.path());
    curve(folder.path(), "far.json", "far", &[1.0, 2.0], &[10.0, 11.0]);
    let output = ntmu(&["curve", "bd", "a.json", "far.json"], folder.path());
    assert_eq!(output.status.code(), Some(1));
    assert!(stderr(&output).contains("intervals that overlap"));
}

#[test]
fn curves_are_drawn_and_tabled() {
    let folder = folder();
    readme(folder.path());
    for file in ["plot.svg", "plot.png"] {
        json(&ntmu(
            &["curve", "plot", "a.json", "t.json", "-o", file, "--json"],
            folder.path(),
        ));
    }
    let svg = std::fs::read_to_string(folder.path().join("plot.svg")).unwrap();
    assert!(svg.contains(">anchor<") && svg.contains(">test<"));
    image::open(folder.path().join("plot.png")).unwrap();
    let output = ntmu(&["curve", "table", "a.json", "t.json"], folder.path());
    let text = String::from_utf8(output.stdout).unwrap();
    assert_eq!(text.lines().count(), 2 + 8);
    let matrix = json(&ntmu(
        &["curve", "matrix", "a.json", "t.json", "--json"],
        folder.path(),
    ));
    assert_eq!(matrix["rates"][0][0]["value"], 0.0);
    assert!(matrix["rates"][0][1]["value"].as_f64().unwrap() < 0.0);
}

#[test]
fn what_cannot_be_measured_is_refused_with_what_is_allowed() {
    let folder = folder();
    readme(folder.path());
    let asset = asset_in(folder.path());
    let asset = asset.to_str().unwrap();
    curve(folder.path(), "one.json", "one", &[1.0], &[10.0]);
    curve(
        folder.path(),
        "fall.json",
        "fall",
        &[1.0, 2.0, 3.0],
        &[10.0, 9.0, 11.0],
    );
    std::fs::write(folder.path().join("bad.json"), "{\"name\": 1}").unwrap();
    json(&ntmu(
        &["generate", "-o", "source", "--json"],
        folder.path(),
    ));
    image::GrayImage::new(3, 2)
        .save(folder.path().join("mask.png"))
        .unwrap();
    let cases: [(&[&str], &str); 9] = [
        (
            &["curve", "bd", "a.json", "one.json"],
            "found 1 points; allowed with pchip: at least 2",
        ),
        (
            &["curve", "bd", "a.json", "fall.json"],
            "allowed: rate and metric both greater",
        ),
        (
            &["curve", "bd", "a.json", "t.json", "--metric", "vmaf"],
            "allowed: bpp, psnr",
        ),
        (&["curve", "bd", "a.json", "bad.json"], "bad.json"),
        (
            &["curve", "plot", "a.json", "-o", "plot.gif"],
            "allowed: .svg and .png",
        ),
        (
            &["analyse", asset, "-o", "out", "--channel", "99"],
            "found 99; allowed: 0 to",
        ),
        (
            &["analyse", asset, "-o", "out", "--level", "1"],
            "levels 0 to 0",
        ),
        (
            &["compare", "source", asset, "--mask", "mask.png"],
            "found 3 × 2 texels",
        ),
        (
            &["compare", "source", asset, "--markdown", "--json"],
            "allowed: one of them",
        ),
    ];
    for (arguments, words) in cases {
        let output = ntmu(arguments, folder.path());
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert!(
            stderr(&output).contains(words),
            "{arguments:?}: {}",
            stderr(&output)
        );
    }
    assert!(
        !folder.path().join("out").exists(),
        "nothing is written before all is checked"
    );
}

#[test]
fn analyse_writes_its_figures_and_a_picture_of_each_channel() {
    let folder = folder();
    let asset = asset_in(folder.path());
    let asset = asset.to_str().unwrap();
    let found = json(&ntmu(
        &["analyse", asset, "-o", "out", "--json"],
        folder.path(),
    ));
    let out = folder.path().join("out");
    let written = std::fs::read_to_string(out.join("analysis.json")).unwrap();
    assert_eq!(
        serde_json::from_str::<serde_json::Value>(&written).unwrap(),
        found
    );
    assert!(found["cka"].as_array().unwrap().is_empty());
    assert!(found["cka_missing"].as_str().unwrap().contains("found 1"));
    for grid in found["fourier"].as_array().unwrap() {
        for channel in grid["channels"].as_array().unwrap() {
            let share = channel["low_share"].as_f64().unwrap();
            assert!((0.0..=1.0).contains(&share));
            let stem = format!(
                "grid{}_channel{:02}",
                grid["grid"],
                channel["channel"].as_u64().unwrap()
            );
            for file in [format!("{stem}.png"), format!("{stem}_fourier.png")] {
                image::open(out.join(file)).unwrap();
            }
        }
    }
}

/// The built-in asset as a pyramid with a level a mip behind mip 3, in `folder`. The further levels
/// begin like the first.
fn pyramid_in(folder: &Path) {
    let mut parts = ntmu::built_in::asset().unwrap().into_parts();
    parts.shape.pyramid = Pyramid::EVERY_MIP;
    for grid in 0..2 {
        let latents = usize::try_from(parts.shape.grid_latents(grid)).unwrap();
        let codes = parts.grids[grid].clone();
        parts.grids[grid] = codes.iter().copied().cycle().take(latents).collect();
    }
    let asset = Asset::new(parts).unwrap();
    std::fs::write(folder.join("pyramid.ntx"), asset.to_bytes()).unwrap();
}

#[test]
fn analyse_compares_the_levels_of_a_pyramid_and_draws_them() {
    let folder = folder();
    pyramid_in(folder.path());
    for align in ["pool", "bilinear"] {
        let arguments = [
            "analyse",
            "pyramid.ntx",
            "-o",
            align,
            "--align",
            align,
            "--json",
        ];
        let found = json(&ntmu(&arguments, folder.path()));
        assert!(found["cka_missing"].is_null());
        for (grid, cka) in found["cka"].as_array().unwrap().iter().enumerate() {
            assert_eq!(
                (&cka["grid"], &cka["alignment"]),
                (&grid.into(), &align.into())
            );
            let rows = cka["alike"].as_array().unwrap();
            assert_eq!(rows.len(), 4);
            assert!((0..4).all(|level| rows[level][level]["cka"] == 1.0));
            let stem = folder.path().join(align).join(format!("cka_grid{grid}"));
            image::open(stem.with_extension("png")).unwrap();
            let svg = std::fs::read_to_string(stem.with_extension("svg")).unwrap();
            assert_eq!(svg.matches(">1.00<").count(), 4, "the diagonal");
        }
    }
}

#[test]
fn compare_prints_the_tables_of_the_paper() {
    let folder = folder();
    let asset = asset_in(folder.path());
    let asset = asset.to_str().unwrap();
    json(&ntmu(
        &["generate", "-o", "source", "--json"],
        folder.path(),
    ));
    let output = ntmu(&["compare", "source", asset, "--markdown"], folder.path());
    let text = String::from_utf8(output.stdout).unwrap();
    let rows = text.lines().filter(|line| line.starts_with('|')).count();
    assert_eq!(
        rows,
        2 + (5 + 1) * (7 + 1),
        "5 maps and all, 7 mips and all"
    );
    assert!(text.contains("| color | 0 | 256 × 256 |"));
    assert!(text.contains("SSIMULACRA2 needs 113 × 113 texels: 5 smaller mips are left out."));
    let figures = json(&ntmu(
        &["compare", "source", asset, "--json"],
        folder.path(),
    ));
    let maps = figures["quality"]["maps"].as_array().unwrap();
    let of = |name: &str| maps.iter().find(|map| map["map"] == name).unwrap();
    assert!(of("normal")["angles"]["overall"]["mean"].as_f64().unwrap() > 0.0);
    assert!(of("color")["perceptual"]["mips"][0].as_f64().unwrap() < 100.0);
    assert!(of("height")["angles"].is_null() && of("height")["perceptual"].is_null());

    let white = image::GrayImage::from_pixel(256, 256, image::Luma([255]));
    white.save(folder.path().join("mask.png")).unwrap();
    let arguments = ["compare", "source", asset, "--mask", "mask.png", "--json"];
    let masked = json(&ntmu(&arguments, folder.path()));
    assert_eq!(masked["quality"]["overall"], figures["quality"]["overall"]);
    assert_eq!(masked["quality"]["masked_share"], 1.0);
}
