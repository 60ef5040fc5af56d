//! The model and the WGSL twin agree on every bit.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
#![cfg(feature = "gpu")]

mod support;

use ntmu::built_in;
use ntmu::conformance::synthetic;
use ntmu::conformance::{Device, ModelDevice, run, stage, suite};
use ntmu::decoded::Decoded;
use ntmu::isa::Asset;
use ntmu::model::Request;
use ntmu::shaders::{Gpu, Twin};
use ntmu::twin_device::TwinDevice;

fn gpu() -> Option<Gpu> {
    match Gpu::open() {
        Ok(gpu) => Some(gpu),
        Err(error) => {
            support::skip(&error.to_string());
            None
        }
    }
}

fn assert_equal_everywhere(gpu: &Gpu, asset: &Asset, what: &str) {
    let twin = Twin::on(gpu, asset).unwrap();
    let model = Decoded::of(asset, |_| ());
    for (mip, codes) in (0..).zip(&model.mips) {
        let theirs = twin.mip(mip).unwrap();
        let (channels, height, width) = codes.dim();
        assert_eq!(theirs.len(), channels * height * width, "{what}, mip {mip}");
        for (index, &code) in theirs.iter().enumerate() {
            let (texel, channel) = (index / channels, index % channels);
            let (row, column) = (texel / width, texel % width);
            assert_eq!(
                codes[[channel, row, column]],
                code,
                "{what}: mip {mip}, row {row}, column {column}, channel {channel}"
            );
        }
    }
}

#[test]
fn model_and_twin_agree_on_every_texel_of_the_built_in_asset() {
    let Some(gpu) = gpu() else { return };
    assert_equal_everywhere(&gpu, &built_in::asset().unwrap(), "built-in asset");
}

#[test]
fn model_and_twin_agree_on_random_assets_of_every_kind() {
    let Some(gpu) = gpu() else { return };
    for seed in 0..12 {
        let spec = synthetic::arbitrary_spec(seed);
        let asset = synthetic::asset(&spec, seed).unwrap();
        assert_equal_everywhere(&gpu, &asset, &format!("seed {seed}, {spec:?}"));
    }
}

#[test]
fn model_and_twin_agree_on_every_stage() {
    if gpu().is_none() {
        return;
    }
    let mut twin = TwinDevice::open().unwrap();
    for seed in 100..106 {
        let asset = synthetic::asset(&synthetic::arbitrary_spec(seed), seed).unwrap();
        for mip in 0..asset.shape.mip_count {
            let (width, height) = asset.shape.mip_size(mip);
            let request = Request::new(&asset.shape, width - 1, height / 2, mip).unwrap();
            let expected = ModelDevice.taps(&asset, request).unwrap();
            let found = twin.taps(&asset, request).unwrap();
            assert_eq!(
                expected.keys().collect::<Vec<_>>(),
                found.keys().collect::<Vec<_>>()
            );
            assert_eq!(
                stage::first_divergence(&expected, &found),
                None,
                "seed {seed} mip {mip}"
            );
        }
    }
}

#[test]
fn the_twin_passes_the_texel_vectors() {
    if gpu().is_none() {
        return;
    }
    let mut twin = TwinDevice::open().unwrap();
    let suites = suite::all().unwrap();
    let summary = run(&suites, &mut twin, &mut |_| ());
    assert!(summary.conforms(), "{summary:#?}");
    let texel = summary
        .suites
        .iter()
        .find(|suite| suite.suite == "texel")
        .unwrap();
    assert_eq!(texel.passed, texel.cases.len());
}
