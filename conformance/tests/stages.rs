//! The model against the oracle, stage by stage, each stage on its own integer input.

use ntmu_conformance::Oracle;
use ntmu_conformance::bound::{float_error, stage, worst};
use ntmu_conformance::oracle::position::RealAxis;
use ntmu_conformance::oracle::reals;
use ntmu_conformance::synthetic::{self, Random, arbitrary_spec};
use ntmu_isa::layout::Layout;
use ntmu_isa::{Asset, Program};
use ntmu_model::Request;
use ntmu_model::exec::{Decoder, Taps};
use proptest::prelude::*;

/// A texel from anywhere in the chain.
fn any_texel(asset: &Asset, seed: u64) -> Request {
    let mut random = Random::new(seed);
    let mip = random.within(0, i32::from(asset.shape.mip_count) - 1) as u8;
    let (width, height) = asset.shape.mip_size(mip);
    let x = random.within(0, width as i32 - 1) as u32;
    let y = random.within(0, height as i32 - 1) as u32;
    Request::new(&asset.shape, x, y, mip).expect("within the mip")
}

fn within(what: &str, model: &[f64], oracle: &[f64], bounds: &[f64]) {
    assert_eq!(
        (model.len(), oracle.len()),
        (bounds.len(), bounds.len()),
        "{what}"
    );
    for (lane, ((m, o), bound)) in model.iter().zip(oracle).zip(bounds).enumerate() {
        let distance = (m - o).abs();
        assert!(
            distance <= *bound,
            "{what}[{lane}]: {m} − {o} is beyond {bound}"
        );
    }
}

fn check_grids(asset: &Asset, taps: &Taps) {
    let shape = &asset.shape;
    for (grid, tap) in taps.grids.iter().enumerate() {
        let scale = shape.grids[grid].scale_log2;
        let (width, height) = shape.grid_size(grid);
        let (request, mode) = (taps.request, shape.address_mode);
        for (texel, size, axis, cells) in [
            (request.x(), width, tap.corners.x, tap.corners.columns),
            (request.y(), height, tap.corners.y, tap.corners.rows),
        ] {
            let real = RealAxis::of(texel, request.mip(), scale, shape.snap);
            let found = (
                f64::from(axis.first),
                f64::from(axis.stride),
                f64::from(axis.phase) / 16.0,
            );
            assert_eq!(found, (real.first, real.stride, real.fraction));
            assert_eq!(cells, real.cells(size, mode));
        }
        let cells = tap.corners.cells().into_iter();
        let codes: Vec<u8> = cells
            .flat_map(|(x, y)| asset.cell(grid, x, y).to_vec())
            .collect();
        assert_eq!(tap.codes, codes);
    }
}

/// Every stage of a texel, then the whole of it.
fn check(asset: &Asset, request: Request) {
    let program = Program::compile(asset, Layout::Linear);
    let taps = Decoder::new(asset, &program).taps(request);
    let oracle = Oracle::new(asset);
    check_grids(asset, &taps);
    let inputs = reals(&taps.inputs);
    within(
        "inputs",
        &inputs,
        &oracle.inputs(request),
        &stage::inputs(asset),
    );
    let outputs: Vec<Vec<f64>> = taps.layers.iter().map(|tap| reals(&tap.outputs)).collect();
    for (index, tap) in taps.layers.iter().enumerate() {
        let input = index
            .checked_sub(1)
            .map_or(&inputs, |before| &outputs[before]);
        let accumulators = reals(&tap.accumulators);
        assert_eq!(
            accumulators,
            oracle.accumulators(index, input),
            "layer {index}"
        );
        let activated = reals(&tap.activated);
        let real = oracle.activated(index, &accumulators);
        within(
            "activated",
            &activated,
            &real,
            &stage::activated(asset, index, &accumulators),
        );
        if index + 1 == taps.layers.len() {
            let bounds = stage::channels(asset, &activated);
            let real = oracle.clamp_channels(&oracle.channels(&activated));
            within("channels", &reals(&taps.codes), &real, &bounds);
        } else {
            let source = oracle
                .skip_source(index)
                .map(|from| outputs[from].as_slice());
            let bounds = stage::outputs(asset, index, &activated, source);
            let real = oracle.outputs(index, &activated, source);
            within("outputs", &outputs[index], &real, &bounds);
        }
    }
    let real = oracle.taps(request);
    let worst = worst::texel(&oracle, &real);
    within("texel", &reals(&taps.codes), &real.channels, &worst);
    for (texel, anywhere) in worst.iter().zip(worst::asset(asset)) {
        // Both are sums of the same terms in another order.
        assert!(
            *texel <= anywhere + float_error(anywhere) * 1024.0,
            "{texel} > {anywhere}"
        );
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn every_stage_of_any_texel_of_any_asset_is_within_its_bound(
        spec in any::<u64>(), seed in any::<u64>(), texels in prop::collection::vec(any::<u64>(), 6),
    ) {
        let asset = synthetic::asset(&arbitrary_spec(spec), seed).unwrap();
        for texel in texels {
            check(&asset, any_texel(&asset, texel));
        }
    }
}

#[test]
fn every_texel_of_some_assets_is_within_its_bound() {
    for seed in 0..24 {
        let asset = synthetic::asset(&arbitrary_spec(seed), seed).unwrap();
        for mip in 0..asset.shape.mip_count {
            for request in Request::blocks(&asset.shape, mip).step_by(7) {
                check(&asset, request);
            }
        }
    }
}

/// A scale above one, and a real below one that the model can only hold as zero.
#[test]
fn a_value_that_can_only_be_zero_is_no_farther_off_than_its_radius() {
    let asset = synthetic::asset(
        &arbitrary_spec(12_366_899_866_830_642_526),
        9_167_981_353_273_155_287,
    )
    .unwrap();
    for mip in 0..asset.shape.mip_count {
        let (width, height) = asset.shape.mip_size(mip);
        for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
            check(&asset, Request::new(&asset.shape, x, y, mip).unwrap());
        }
    }
}
