//! Flags for the shape of an asset: each is in the asset, and what has no name is refused.

use super::{done, encode, folder, read, run};
use ntmu::isa::Asset;
use ntmu::isa::position::{AddressMode, CornerSnap};
use ntmu::isa::pyramid::Pyramid;
use ntmu::isa::shape::Shape;
use std::path::Path;

/// That of an asset which a few steps make with these flags.
fn shape(folder: &Path, flags: &[&str]) -> Shape {
    let flags = [&["--steps", "0+4+4"], flags].concat();
    done(folder, &encode("a.ntx", &flags));
    let asset = Asset::from_bytes(&read(folder, "a.ntx")).unwrap();
    asset.shape.clone()
}

#[test]
fn every_flag_of_the_shape_is_in_the_asset() {
    let folder = folder();
    let folder = folder.path();
    for snap in CornerSnap::ALL {
        for address in AddressMode::ALL {
            let flags = ["--snap", snap.name(), "--address", address.name()];
            let shape = shape(folder, &flags);
            assert_eq!((shape.snap, shape.address_mode), (snap, address));
        }
    }
    let shape = shape(folder, &["--pyramid", "every-mip", "--grids", "3,5"]);
    assert_eq!(shape.pyramid, Pyramid::EVERY_MIP);
    assert_eq!(shape.grids.map(|grid| grid.channels), [3, 5]);
}

#[test]
fn a_name_that_no_choice_has_is_refused_with_those_that_there_are() {
    let folder = folder();
    for (flag, allowed) in [
        ("--snap", "cell, stride"),
        ("--address", "wrap, mirror, clamp"),
        ("--pyramid", "single, ntc, every-mip"),
        ("--precision", "int8, fp16"),
    ] {
        let (code, said) = run(folder.path(), &encode("a.ntx", &[flag, "none"]));
        assert_eq!(code, Some(2), "{said}");
        let expected = format!(
            "{}: found \"none\"; allowed: {allowed}",
            flag.trim_start_matches('-')
        );
        assert!(said.contains(&expected), "{said}");
    }
}
