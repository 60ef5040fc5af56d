//! The three claims: the model is the specification, each stage lies within what its roundings imply,
//! and the end within what follows from them.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use ntmu::conformance::claims::{Claims, findings};
use ntmu::conformance::synthetic;
use ntmu::isa::layout::Layout;
use ntmu::isa::profile::NamedProfile;
use ntmu::isa::{Asset, Program};
use ntmu::model::Request;
use ntmu::precision;
use proptest::prelude::*;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    #[test]
    fn every_texel_keeps_the_claims(seed: u64, x: u32, y: u32, mip: u8) {
        let asset = synthetic::asset(&synthetic::arbitrary_spec(seed), seed).unwrap();
        let mip = mip % asset.shape.mip_count;
        let (width, height) = asset.shape.mip_size(mip);
        let request = Request::new(&asset.shape, x % width, y % height, mip).unwrap();
        let program = Program::compile(&asset, Layout::TILED);
        let found = Claims::new(&asset, &program).texel(request);
        prop_assert!(found.holds(), "{found:#?}");
    }
}

fn some_texels(asset: &Asset) -> Vec<Request> {
    let places = (0..asset.shape.mip_count).flat_map(|mip| {
        let (width, height) = asset.shape.mip_size(mip);
        (0..8).map(move |step| (width * step / 8, height * (7 - step) / 8, mip))
    });
    places
        .map(|(x, y, mip)| Request::new(&asset.shape, x, y, mip).unwrap())
        .collect()
}

fn assert_claims(what: &str, asset: &Asset) {
    let found = findings(asset, &some_texels(asset));
    assert!(found.hold(), "{what}: {found:#?}");
    let mean = |square: &dyn Fn(usize) -> f64| {
        let channels = found.channels.len();
        ((0..channels).map(square).sum::<f64>() / channels as f64).sqrt()
    };
    let observed = mean(&|c| found.channels[c].observed_rms.powi(2));
    let predicted = mean(&|c| found.channels[c].predicted_rms.powi(2));
    assert!(
        observed <= 2.0 * predicted && predicted <= 2.0 * observed,
        "{what}: observed rms {observed}, predicted {predicted}"
    );
}

#[test]
fn the_built_in_asset_keeps_the_claims_in_all_numbers() {
    let asset = ntmu::built_in::asset().unwrap();
    assert_claims("as it is", &asset);
    assert_claims("fp16", &precision::in_halves(&asset).unwrap());
    for bits in [6, 12, 16] {
        let wide = precision::with_activations(&asset, bits).unwrap();
        assert_claims(&format!("activations of {bits} bits"), &wide);
    }
    assert_claims(
        "weights of 5 bits",
        &precision::narrow(&asset, 4, 5).unwrap(),
    );
}

#[test]
fn the_built_in_asset_keeps_the_claims_under_every_named_profile() {
    let asset = ntmu::built_in::asset().unwrap();
    for named in NamedProfile::all().unwrap() {
        let mut parts = asset.clone().into_parts();
        parts.profile = named.profile;
        assert_claims(&named.name, &Asset::new(parts).unwrap());
    }
}
