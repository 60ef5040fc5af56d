//! Budgets of time, quality and bytes; the preview.

use super::{done, encode, folder, read, recorded, run};
use ntmu::isa::Asset;

const SHORT: [&str; 2] = ["--steps", "0+60+30"];

#[test]
fn a_run_that_a_time_fixed_is_repeated_by_its_recorded_steps() {
    let folder = folder();
    let folder = folder.path();
    done(folder, &encode("timed.ntx", &["--time", "2s"]));
    let timed = read(folder, "timed.ntx");
    let [steps, rounds] = ["steps", "settle"].map(|key| recorded(&timed, key).unwrap());
    let again = ["--steps", &steps, "--settle", &rounds];
    done(folder, &encode("again.ntx", &again));
    assert!(read(folder, "again.ntx") == timed, "{steps} {rounds}");
}

#[test]
fn a_target_ends_the_run_early_or_fails_with_the_asset_written() {
    let folder = folder();
    let folder = folder.path();
    let (code, said) = run(
        folder,
        &encode("far.ntx", &[&SHORT[..], &["--target-psnr", "80"]].concat()),
    );
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("--target-psnr: the asset has"), "{said}");
    Asset::from_bytes(&read(folder, "far.ntx")).unwrap();
    let near = [
        "--steps",
        "0+4000+1000",
        "--target-psnr",
        "12",
        "--log",
        "near.jsonl",
    ];
    done(folder, &encode("near.ntx", &near));
    let log = String::from_utf8(read(folder, "near.jsonl")).unwrap();
    let last: serde_json::Value = serde_json::from_str(log.lines().last().unwrap()).unwrap();
    assert!(last["done"].as_u64().unwrap() < 5000, "{last}");
    assert!(last["deployed_psnr"].as_f64().unwrap() >= 12.0, "{last}");
    assert!(last["rates"]["latents"].as_f64().unwrap() > 0.0, "{last}");
}

#[test]
fn an_asset_fits_its_budget_of_bytes_or_the_smallest_that_would_is_named() {
    let folder = folder();
    let folder = folder.path();
    done(folder, &encode("whole.ntx", &SHORT));
    let whole = read(folder, "whole.ntx");
    for share in [95, 85, 70] {
        let most = (whole.len() * share / 100).to_string();
        done(
            folder,
            &encode("less.ntx", &[&SHORT[..], &["--max-bytes", &most]].concat()),
        );
        let less = read(folder, "less.ntx").len();
        assert!(less <= whole.len() * share / 100, "{less} of {most}");
        // No more than a channel in each grid is given away: less than a tenth of this asset.
        assert!(less > whole.len() * (share - 12) / 100, "{less} of {most}");
    }
    let generous = ["--max-bytes", "10M"];
    done(
        folder,
        &encode("same.ntx", &[&SHORT[..], &generous].concat()),
    );
    assert!(read(folder, "same.ntx") == whole);
    let (code, said) = run(
        folder,
        &encode("none.ntx", &[&SHORT[..], &["--max-bytes", "100"]].concat()),
    );
    assert_eq!(code, Some(2), "{said}");
    let smallest = said.split("at least ").nth(1).unwrap();
    let smallest = smallest.split(',').next().unwrap();
    done(
        folder,
        &encode(
            "least.ntx",
            &[&SHORT[..], &["--max-bytes", smallest]].concat(),
        ),
    );
}

#[test]
fn a_preview_has_an_image_of_every_map_and_changes_nothing() {
    let folder = folder();
    let folder = folder.path();
    done(folder, &encode("plain.ntx", &SHORT));
    let flags = [
        "--preview",
        "looks",
        "--preview-every",
        "0.001s",
        "--preview-side",
        "24",
    ];
    done(folder, &encode("seen.ntx", &[&SHORT[..], &flags].concat()));
    assert!(read(folder, "plain.ntx") == read(folder, "seen.ntx"));
    let asset = Asset::from_bytes(&read(folder, "seen.ntx")).unwrap();
    assert!(!asset.metadata.maps.is_empty());
    for map in &asset.metadata.maps {
        let path = folder.join("looks").join(format!("{}.png", map.name));
        let image = image::open(&path).unwrap();
        assert_eq!((image.width(), image.height()), (24, 24), "{}", map.name);
    }
    let files = std::fs::read_dir(folder.join("looks")).unwrap().count();
    assert_eq!(files, asset.metadata.maps.len());
}

#[test]
fn a_result_names_the_memory_that_was_estimated_and_that_was_used() {
    let folder = folder();
    let mut arguments = encode("a.ntx", &SHORT);
    arguments.push("--json");
    let output = crate::support::command::ntmu(&arguments, folder.path());
    let result = crate::support::command::json(&output);
    let estimate = &result["memory"]["estimate"];
    // Two copies of nine channels in f32, of 64² texels and the mips below.
    assert_eq!(estimate["texels"], 2 * 9 * 4 * 5456, "{estimate}");
    if cfg!(target_os = "linux") {
        let peak = result["memory"]["peak_resident"].as_u64().unwrap();
        assert!(peak > estimate["texels"].as_u64().unwrap(), "{peak}");
    }
}
