//! Every command of the README runs.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod support;

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

const README: &str = include_str!("../README.md");

/// The commands in the README's table: what stands between backticks and is ours.
fn commands() -> Vec<Vec<String>> {
    README
        .lines()
        .filter(|line| line.starts_with('|'))
        .flat_map(|line| {
            line.split('`')
                .skip(1)
                .step_by(2)
                .map(str::to_owned)
                .collect::<Vec<_>>()
        })
        .filter_map(|command| {
            let ours = command.strip_prefix("ntmu ").map(str::to_owned);
            ours.or_else(|| command.split_once(" -- ").map(|(_, rest)| rest.to_owned()))
        })
        .map(|command| command.split(' ').map(str::to_owned).collect())
        .collect()
}

#[test]
fn every_command_of_the_readme_runs() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    std::fs::write(path("wall.ntx"), ntmu::built_in::BYTES).unwrap();
    let mut places = BTreeMap::from([
        ("DIR", path("DIR")),
        ("out.ntx", path("wall.ntx")),
        ("IMAGES", path("IMAGES")),
        (
            "plans/evaluate/smoke.toml",
            concat!(env!("CARGO_MANIFEST_DIR"), "/plans/evaluate/smoke.toml").to_owned(),
        ),
    ]);
    for (file, psnr) in [("anchor.json", 30.0), ("test.json", 31.0)] {
        let curve = serde_json::json!({
            "name": file, "description": "",
            "results": { "bpp": [1.0, 2.0, 4.0], "psnr": [psnr, psnr + 3.0, psnr + 6.0] },
        });
        std::fs::write(path(file), curve.to_string()).unwrap();
    }
    run(
        &["generate".into(), "-o".into(), path("DIR")],
        folder.path(),
    );
    let commands = commands();
    assert!(commands.len() >= 10, "{commands:?}");
    for mut command in commands {
        let needs_adapter = command.contains(&"gpu".to_owned());
        let needs_trainer = ["encode", "settle"].contains(&command[0].as_str());
        if needs_trainer && !cfg!(feature = "train") {
            support::skip("this build has no trainer");
            continue;
        }
        if command[0] == "encode" {
            // A small set of its own, so that the default effort takes seconds.
            let small = ["generate", "-o", &path("small"), "--size", "64"].map(str::to_owned);
            run(&small, folder.path());
            places.insert("DIR", path("small"));
            places.insert("out.ntx", path("small.ntx"));
        } else {
            places.insert("DIR", path("DIR"));
            places.insert("out.ntx", path("wall.ntx"));
        }
        for word in &mut command {
            if let Some(place) = places.get(word.as_str()) {
                word.clone_from(place);
            }
        }
        if needs_adapter && !has_adapter() {
            support::skip("there is no wgpu adapter");
            continue;
        }
        run(&command, folder.path());
    }
}

fn run(arguments: &[String], folder: &Path) {
    let binary = env!("CARGO_BIN_EXE_ntmu");
    let output = Command::new(binary)
        .args(arguments)
        .current_dir(folder)
        .output()
        .unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {stderr}");
}

#[cfg(feature = "gpu")]
fn has_adapter() -> bool {
    ntmu::shaders::Gpu::open().is_ok()
}

#[cfg(not(feature = "gpu"))]
fn has_adapter() -> bool {
    false
}

#[test]
fn every_file_that_the_readme_links_is_there() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let links = README
        .split("](")
        .skip(1)
        .filter_map(|rest| rest.split(')').next());
    for link in links.filter(|link| !link.starts_with("http")) {
        assert!(root.join(link).is_file(), "{link}");
    }
}

#[test]
fn the_manifest_of_the_readme_is_read() {
    let manifest = README
        .split("```toml\n")
        .nth(1)
        .unwrap()
        .split("```")
        .next()
        .unwrap();
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("texture_set.toml"), manifest).unwrap();
    let wall =
        image::RgbaImage::from_fn(8, 8, |x, y| image::Rgba([x as u8, y as u8, 7, 9 * x as u8]));
    wall.save(folder.path().join("wall_a.png")).unwrap();
    let set = ntmu::texture_set::TextureSet::read(folder.path()).unwrap();
    let maps: Vec<_> = set
        .maps
        .iter()
        .map(|map| (map.name.as_str(), map.channel_count))
        .collect();
    assert_eq!(
        (set.name.as_str(), maps),
        ("old wall", vec![("color", 3), ("height", 1)])
    );
}
