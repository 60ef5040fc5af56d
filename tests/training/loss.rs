//! Weights, masks, normals and plans, by flag.

use super::{done, encode, folder, read, recorded, run};
use ntmu::isa::Asset;

const SHORT: [&str; 2] = ["--steps", "0+40+20"];

fn with<'a>(flags: &[&'a str]) -> Vec<&'a str> {
    [&SHORT[..], flags].concat()
}

#[test]
fn every_flag_of_the_loss_changes_what_is_made_and_names_what_it_does_not_know() {
    let folder = folder();
    let folder = folder.path();
    let mask = image::GrayImage::from_fn(64, 64, |x, _| image::Luma([u8::from(x < 40)]));
    mask.save(folder.join("mask.png")).unwrap();
    let white = image::GrayImage::from_pixel(64, 64, image::Luma([255]));
    white.save(folder.join("white.png")).unwrap();
    done(folder, &encode("plain.ntx", &with(&[])));
    let plain = Asset::from_bytes(&read(folder, "plain.ntx")).unwrap();
    for flags in [
        ["--weight", "normal=3"],
        ["--mask", "mask.png"],
        ["--mask", "white.png"],
        ["--renormalise", "normal"],
        ["--rate-factor", "0.5"],
    ] {
        done(folder, &encode("other.ntx", &with(&flags)));
        let other = Asset::from_bytes(&read(folder, "other.ntx")).unwrap();
        let is_same = flags == ["--mask", "white.png"];
        assert_eq!(other.grids == plain.grids, is_same, "{flags:?}");
    }
    for (flags, part) in [
        (["--weight", "nrml=3"], "nrml"),
        (["--mask", "nrml"], "nrml"),
        (["--renormalise", "roughness"], "three"),
        (["--rate-factor", "11"], "rate_factor"),
        (["--plan", "papers"], "paper-short"),
    ] {
        let flags = if flags[0] == "--plan" {
            flags.to_vec()
        } else {
            with(&flags)
        };
        let (code, said) = run(folder, &encode("none.ntx", &flags));
        assert_eq!(code, Some(2), "{flags:?}: {said}");
        assert!(said.contains(part), "{flags:?}: {said}");
    }
}

#[test]
fn a_plan_by_name_without_its_encoder_is_recorded() {
    let folder = folder();
    let folder = folder.path();
    let steps = ["--steps", "3+0+0+0+0+3+3"];
    for (flags, name) in [
        (&["--plan", "paper"][..], "paper"),
        (
            &["--plan", "paper", "--no-encoder"],
            "paper without encoder",
        ),
    ] {
        done(folder, &encode("a.ntx", &[flags, &steps].concat()));
        let made = read(folder, "a.ntx");
        assert_eq!(recorded(&made, "plan").as_deref(), Some(name));
        assert_eq!(recorded(&made, "steps").as_deref(), Some("3+0+0+0+0+3+3"));
        assert_eq!(recorded(&made, "effort"), None);
    }
    let (code, said) = run(folder, &encode("a.ntx", &["--steps", "3+4"]));
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("2 numbers"), "{said}");
}
