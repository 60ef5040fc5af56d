//! Stage by stage, the model lies within the bound that the stage's roundings imply.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use ntmu::conformance::bound::{stage, worst};
use ntmu::conformance::oracle::{Oracle, reals};
use ntmu::conformance::synthetic;
use ntmu::isa::layout::Layout;
use ntmu::isa::{Asset, Program};
use ntmu::model::Request;
use ntmu::model::exec::Decoder;
use proptest::prelude::*;

fn assert_within(what: &str, model: &[f64], oracle: &[f64], bound: &[f64]) {
    assert_eq!(model.len(), oracle.len(), "{what}");
    for (lane, ((m, o), b)) in model.iter().zip(oracle).zip(bound).enumerate() {
        assert!(
            (m - o).abs() <= *b,
            "{what} lane {lane}: model {m}, oracle {o}, bound {b}"
        );
    }
}

/// Hands each stage of the oracle the model's own input of that stage.
fn check_stages(asset: &Asset, request: Request) {
    let program = Program::compile(asset, Layout::Tiled);
    let taps = Decoder::new(asset, &program).taps(request);
    let oracle = Oracle::new(asset);
    assert_within(
        "inputs",
        &reals(&taps.inputs),
        &oracle.inputs(request),
        &stage::inputs(asset),
    );
    let mut input = reals(&taps.inputs);
    for (index, tap) in taps.layers.iter().enumerate() {
        let accumulators = reals(&tap.accumulators);
        assert_eq!(
            accumulators,
            oracle.accumulators(index, &input),
            "layer {index}: exact sums"
        );
        let activated = reals(&tap.activated);
        let bound = stage::activated(asset, index, &accumulators);
        let real = oracle.activated(index, &accumulators);
        assert_within(
            &format!("layer {index} activated"),
            &activated,
            &real,
            &bound,
        );
        if index + 1 == taps.layers.len() {
            let real = oracle.clamp_channels(&oracle.channels(&activated));
            let bound = stage::channels(asset, &activated);
            assert_within("channels", &reals(&taps.codes), &real, &bound);
            break;
        }
        let source = oracle
            .skip_source(index)
            .map(|from| reals(&taps.layers[from].outputs));
        let real = oracle.outputs(index, &activated, source.as_deref());
        let bound = stage::outputs(asset, index, &activated, source.as_deref());
        let outputs = reals(&tap.outputs);
        assert_within(&format!("layer {index} outputs"), &outputs, &real, &bound);
        input = outputs;
    }
    let end = oracle.taps(request);
    let bound = worst::texel(&oracle, &end);
    assert_within("end to end", &reals(&taps.codes), &end.channels, &bound);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    #[test]
    fn every_stage_is_within_its_bound(seed: u64, x: u32, y: u32, mip: u8) {
        let asset = synthetic::asset(&synthetic::arbitrary_spec(seed), seed).unwrap();
        let mip = mip % asset.shape.mip_count;
        let (width, height) = asset.shape.mip_size(mip);
        check_stages(&asset, Request::new(&asset.shape, x % width, y % height, mip).unwrap());
    }
}

#[test]
fn the_built_in_asset_is_within_every_bound() {
    let asset = ntmu::built_in::asset().unwrap();
    for mip in 0..asset.shape.mip_count {
        let (width, height) = asset.shape.mip_size(mip);
        for step in 0..8 {
            let (x, y) = (width * step / 8, height * (7 - step) / 8);
            check_stages(&asset, Request::new(&asset.shape, x, y, mip).unwrap());
        }
    }
}
