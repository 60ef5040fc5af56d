//! The latents of a finished asset settle on its source.

use super::{done, encode, folder, read, recorded, run};
use crate::support::command::{json, ntmu};
use ntmu::isa::Asset;

/// Settles `of` to `settled.ntx`; what the program says as JSON.
fn settled(folder: &std::path::Path, of: &str, more: &[&str]) -> serde_json::Value {
    let arguments = [&["settle", of, "set", "-o", "settled.ntx", "--json"], more].concat();
    let output = ntmu(&arguments, folder);
    assert!(output.status.success(), "{output:?}");
    json(&output)
}

#[test]
fn an_asset_of_fewer_bits_wins_back_some_of_what_it_lost() {
    let folder = folder();
    let folder = folder.path();
    done(
        folder,
        &encode("whole.ntx", &["--steps", "0+200+100", "--settle", "0"]),
    );
    let fewer = [
        "convert",
        "whole.ntx",
        "-o",
        "fewer.ntx",
        "--weight-bits",
        "5",
    ];
    done(folder, &fewer);
    let result = settled(folder, "fewer.ntx", &["--rounds", "3"]);
    let psnr = |name: &str| result[name]["overall"]["psnr"].as_f64().unwrap();
    assert!(psnr("quality") > psnr("before") + 0.1, "{result}");
    let rounds = result["rounds"].as_array().unwrap();
    assert_eq!(rounds.len(), 3);
    let last = rounds[2]["psnr"].as_f64().unwrap();
    assert!((last - psnr("quality")).abs() < 1e-3, "{result}");

    let asset = read(folder, "settled.ntx");
    assert_eq!(recorded(&asset, "settle").as_deref(), Some("0+3"));
    assert_eq!(recorded(&asset, "psnr_quantised"), None);
    let [before, after] =
        ["fewer.ntx", "settled.ntx"].map(|name| Asset::from_bytes(&read(folder, name)).unwrap());
    assert_eq!(before.layers, after.layers);
    // What was claimed is what somebody else measures.
    let compared = ntmu(&["compare", "set", "settled.ntx", "--json"], folder);
    let measured = json(&compared)["quality"]["overall"]["psnr"]
        .as_f64()
        .unwrap();
    assert!(
        (measured - psnr("quality")).abs() < 1e-9,
        "{measured} {result}"
    );
}

#[test]
fn encode_ends_with_what_settle_does() {
    let folder = folder();
    let folder = folder.path();
    let steps = ["--steps", "0+60+30", "--settle"];
    for rounds in ["0", "2"] {
        let name = format!("{rounds}.ntx");
        done(folder, &encode(&name, &[&steps[..], &[rounds]].concat()));
    }
    settled(folder, "0.ntx", &["--rounds", "2"]);
    let [own, later] =
        ["2.ntx", "settled.ntx"].map(|name| Asset::from_bytes(&read(folder, name)).unwrap());
    assert_eq!(own.grids, later.grids);
}

#[test]
fn another_set_another_map_and_no_rounds_are_refused_and_nothing_is_written() {
    let folder = folder();
    let folder = folder.path();
    done(folder, &encode("a.ntx", &["--steps", "0+10+10"]));
    done(folder, &["generate", "-o", "larger", "--size", "128"]);
    for (set, more, said) in [
        ("larger", ["--rounds", "1"], "128"),
        ("set", ["--weight", "velvet=2"], "velvet"),
        ("set", ["--rounds", "0"], "1..=100"),
        ("nowhere", ["--rounds", "1"], "nowhere"),
    ] {
        let arguments = [&["settle", "a.ntx", set, "-o", "b.ntx"], &more[..]].concat();
        let (code, error) = run(folder, &arguments);
        assert_eq!(code, Some(2), "{error}");
        assert!(error.contains(said), "{error}");
        assert!(!folder.join("b.ntx").exists());
    }
}
