//! The verbs about numbers: profiles, conversions, samples, certificates.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod support;

use serde_json::Value;
use support::command::{asset_in, folder, json, ntmu, stderr};

fn codes(value: &Value) -> Vec<i64> {
    let codes = value["codes"].as_array().unwrap();
    codes.iter().map(|code| code.as_i64().unwrap()).collect()
}

#[test]
fn every_listed_profile_prints_as_a_file_that_is_taken_again() {
    let folder = folder();
    let asset = asset_in(folder.path());
    let asset = asset.to_str().unwrap();
    let listed = json(&ntmu(&["profile", "--json"], folder.path()));
    let listed = listed.as_array().unwrap();
    assert_eq!(listed.len(), ntmu::isa::profile::NAMED.len());
    for entry in listed {
        let name = entry["profile"]["name"].as_str().unwrap();
        let file = folder.path().join("chosen.toml");
        std::fs::write(&file, ntmu(&["profile", name], folder.path()).stdout).unwrap();
        for chosen in [name, "chosen.toml"] {
            let arguments = ["texel", asset, "3", "4", "1", "--profile", chosen, "--json"];
            let texel = json(&ntmu(&arguments, folder.path()));
            assert_eq!(texel["profile"], entry["identity"], "{name}");
        }
    }
}

#[test]
fn a_wrong_profile_is_refused_with_what_is_allowed() {
    let folder = folder();
    let asset = asset_in(folder.path());
    let asset = asset.to_str().unwrap();
    let printed = ntmu(&["profile", "nt-d3d11"], folder.path()).stdout;
    let printed = String::from_utf8(printed).unwrap();
    let files = [
        (
            "range",
            printed.replace("lod_bits = 8", "lod_bits = 9"),
            "4..=8",
        ),
        ("missing", printed.replace("lod_bits = 8", ""), "lod_bits"),
        ("unknown", printed.replace("leak =", "drip ="), "drip"),
        (
            "narrow",
            printed.replace("bias_bits = 32", "bias_bits = 8"),
            "bias",
        ),
        ("empty", String::new(), "missing field"),
    ];
    for (name, text, said) in files {
        let file = format!("{name}.toml");
        std::fs::write(folder.path().join(&file), text).unwrap();
        let refused = ntmu(
            &["texel", asset, "0", "0", "0", "--profile", &file],
            folder.path(),
        );
        assert_eq!(refused.status.code(), Some(2), "{name}");
        assert!(
            stderr(&refused).contains(said),
            "{name}: {}",
            stderr(&refused)
        );
    }
    let unknown = ntmu(&["profile", "d3d12"], folder.path());
    assert_eq!(unknown.status.code(), Some(2));
    assert!(
        stderr(&unknown).contains("nt-d3d11"),
        "{}",
        stderr(&unknown)
    );
}

#[test]
fn a_converted_asset_says_its_numbers_and_decodes() {
    let folder = folder();
    let asset = asset_in(folder.path());
    let asset = asset.to_str().unwrap();
    let conversions: [(&[&str], &str); 4] = [
        (&["--fp16"], "fp16"),
        (&["--weight-bits", "5"], "w5a8"),
        (&["--activation-bits", "12", "--latent-bits", "3"], "w8a12"),
        (&["--profile", "half-even"], "w8a8"),
    ];
    for (options, precision) in conversions {
        let arguments = [&["convert", asset, "-o", "other.ntx", "--json"], options].concat();
        assert_eq!(json(&ntmu(&arguments, folder.path()))["to"], precision);
        let info = json(&ntmu(&["info", "other.ntx", "--json"], folder.path()));
        assert_eq!(info["precision"], precision);
        let texel = json(&ntmu(
            &["texel", "other.ntx", "7", "9", "2", "--json"],
            folder.path(),
        ));
        assert_eq!(codes(&texel).len(), 9);
    }
    let refused = ntmu(
        &["convert", asset, "-o", "no.ntx", "--weight-bits", "9"],
        folder.path(),
    );
    assert_eq!(refused.status.code(), Some(2));
    assert!(stderr(&refused).contains("2..=8"), "{}", stderr(&refused));
    assert!(!folder.path().join("no.ntx").exists());
}

#[test]
fn a_point_sample_at_a_texels_centre_is_the_texel() {
    let folder = folder();
    let asset = asset_in(folder.path());
    let asset = asset.to_str().unwrap();
    let texel = json(&ntmu(
        &["texel", asset, "5", "9", "2", "--json"],
        folder.path(),
    ));
    // Mip 2 has 64 × 64 texels: 5.5/64 and 9.5/64 are exact.
    let place = ["0.0859375", "0.1484375"];
    let mut sample = vec!["sample", asset, place[0], place[1], "--lod", "2", "--json"];
    for filter in ["point", "linear"] {
        sample.extend(["--filter", filter]);
        let found = json(&ntmu(&sample, folder.path()));
        sample.truncate(7);
        assert_eq!(codes(&found), codes(&texel), "{filter}");
        assert_eq!(
            found["decodes"], 1,
            "neighbours without weight are not decoded"
        );
    }
}

#[test]
fn samples_are_asked_for_in_every_way() {
    let folder = folder();
    let asset = asset_in(folder.path());
    let asset = asset.to_str().unwrap();
    let at = |options: &[&str]| {
        let arguments = [&["sample", asset, "0.3", "0.7", "--json"], options].concat();
        json(&ntmu(&arguments, folder.path()))
    };
    assert_eq!(at(&["--lod", "1.5"])["decodes"], 8);
    assert_eq!(
        at(&["--lod", "1.5", "--order", "filter-then-decode"])["decodes"],
        2
    );
    let level = [
        "--lod",
        "1.5",
        "--order",
        "filter-then-decode",
        "--mip-blend",
        "level",
    ];
    assert_eq!(at(&level)["decodes"], 1);
    assert_eq!(at(&["--lod", "1.5", "--random", "77"])["decodes"], 1);
    let probes = at(&["--gradients", "0.02,0,0,0.003", "--max-anisotropy", "8"]);
    assert_eq!(probes["probes"].as_array().unwrap().len(), 7);
    assert_eq!(
        at(&["--gather", "3"])["gathered"].as_array().unwrap().len(),
        4
    );
    // The same number as bits.
    let bits = json(&ntmu(
        &["sample", asset, "0x3e99999a", "0x3f333333", "--json"],
        folder.path(),
    ));
    assert_eq!(bits["codes"], at(&[])["codes"]);
    std::fs::write(
        folder.path().join("s.toml"),
        "address = [\"clamp\", \"mirror\"]\n",
    )
    .unwrap();
    assert_eq!(
        at(&["--sampler", "s.toml"])["sampler"]["address"][1],
        "mirror"
    );
    for (options, said) in [
        (["--address", "fold"], "mirror-once"),
        (["--gather", "9"], "0..=8"),
        (["--max-anisotropy", "17"], "1..=16"),
        (["--gradients", "1,2,3"], "four"),
        (["--address", "border"], "border"),
    ] {
        let arguments = [&["sample", asset, "0.3", "0.7"], options.as_slice()].concat();
        let refused = ntmu(&arguments, folder.path());
        assert_eq!(refused.status.code(), Some(2), "{options:?}");
        assert!(
            stderr(&refused).contains(said),
            "{options:?}: {}",
            stderr(&refused)
        );
    }
}

#[test]
fn a_certificate_fails_where_a_sum_may_leave_its_width() {
    let folder = folder();
    let asset = asset_in(folder.path());
    let asset = asset.to_str().unwrap();
    let certify = |options: &[&str]| {
        let arguments = [&["certify", asset, "--json"], options].concat();
        let output = ntmu(&arguments, folder.path());
        let value: Value = serde_json::from_slice(&output.stdout).unwrap();
        (output.status.code(), value)
    };
    let (code, proven) = certify(&["--witness", "witness.ntx"]);
    assert_eq!(code, Some(0));
    let layers = proven["layers"].as_array().unwrap();
    let widths = layers
        .iter()
        .map(|layer| layer["sums"]["width"].as_u64().unwrap());
    let width = widths.max().unwrap();
    assert!((16..=32).contains(&width));
    let narrower = |bits: u64| {
        let text = ntmu::isa::profile::NAMED[0].1;
        let text = text.replace("\nbits = 32", &format!("\nbits = {bits}"));
        std::fs::write(folder.path().join("narrow.toml"), text).unwrap();
        certify(&["--profile", "narrow.toml"]).0
    };
    assert_eq!(narrower(width), Some(0));
    assert_eq!(narrower(width - 1), Some(1));

    // The witness is an asset like any other, and its texel reaches what was promised.
    let witness = &proven["witness"];
    let place = ["x", "y", "mip"].map(|key| witness[key].to_string());
    let [x, y, mip] = place.each_ref().map(String::as_str);
    let texel = json(&ntmu(
        &["texel", "witness.ntx", x, y, mip, "--json"],
        folder.path(),
    ));
    let inputs = texel["inputs"].as_array().unwrap();
    let file = std::fs::read(folder.path().join("witness.ntx")).unwrap();
    let found = ntmu::isa::Asset::from_bytes(&file).unwrap();
    let (row, steps) = (
        witness["row"].as_u64().unwrap() as usize,
        witness["after_products"].as_u64().unwrap() as usize,
    );
    let layer = &found.layers[0];
    let integers = layer.integer().unwrap();
    let products = integers
        .row(row, layer.inputs)
        .iter()
        .zip(inputs)
        .take(steps);
    let sum = products.fold(i64::from(integers.bias[row]), |sum, (&weight, input)| {
        sum + i64::from(weight) * input.as_i64().unwrap()
    });
    assert_eq!(Some(sum), witness["sum"].as_i64());
}
