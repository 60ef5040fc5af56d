//! The three claims, on random assets: the model is the naive evaluation, every stage is within its
//! bound, and so is every texel.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use ntmu_conformance::bound::{float_error, worst};
use ntmu_conformance::claims::Claims;
use ntmu_conformance::synthetic::{self, Random, arbitrary_spec};
use ntmu_isa::layout::Layout;
use ntmu_isa::{Asset, Program};
use ntmu_model::Request;
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

/// Every claim of a texel; gives whether a sum overflowed.
fn check(claims: &Claims<'_>, request: Request) -> bool {
    let texel = claims.texel(request);
    assert_eq!(texel.naive, None, "{request:?}");
    for (stage, distance) in &texel.stages {
        assert!(distance.share() <= 1.0, "{request:?} {stage}: {distance:?}");
    }
    if let Some(distance) = texel.end_to_end {
        assert!(distance.share() <= 1.0, "{request:?}: {distance:?}");
    }
    let oracle = claims.oracle();
    let bounds = worst::texel(oracle, &oracle.taps(request));
    for (texel, anywhere) in bounds.iter().zip(worst::asset(oracle.asset())) {
        // Both are sums of the same terms in another order.
        assert!(
            *texel <= anywhere + float_error(anywhere) * 1024.0,
            "{texel} > {anywhere}"
        );
    }
    !texel.overflows.is_empty()
}

fn check_all(asset: &Asset, requests: impl Iterator<Item = Request>) -> (usize, usize) {
    let program = Program::compile(asset, Layout::LINEAR);
    let claims = Claims::new(asset, &program);
    requests.fold((0, 0), |(texels, overflowing), request| {
        (
            texels + 1,
            overflowing + usize::from(check(&claims, request)),
        )
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn every_claim_holds_for_any_texel_of_any_asset(
        spec in any::<u64>(), seed in any::<u64>(), texels in prop::collection::vec(any::<u64>(), 6),
    ) {
        let asset = synthetic::asset(&arbitrary_spec(spec), seed).unwrap();
        check_all(&asset, texels.iter().map(|&texel| any_texel(&asset, texel)));
    }
}

#[test]
fn every_claim_holds_for_texels_of_all_mips_of_three_hundred_assets() {
    let (mut texels, mut overflowing) = (0, 0);
    for seed in 0..300 {
        let asset = synthetic::asset(&arbitrary_spec(seed), seed).unwrap();
        let chain = (0..asset.shape.mip_count).flat_map(|mip| Request::blocks(&asset.shape, mip));
        let found = check_all(&asset, chain.step_by(61));
        (texels, overflowing) = (texels + found.0, overflowing + found.1);
    }
    // Overflows occur, and leave most texels to the second and third claim.
    assert!(
        overflowing > 0 && overflowing * 3 < texels,
        "{overflowing} of {texels}"
    );
}

/// A scale above one, and a real below one that the model can only hold as zero.
#[test]
fn a_value_that_can_only_be_zero_is_no_farther_off_than_its_radius() {
    let mut spec = synthetic::Spec::small(24, 24).with_bits(2, 8);
    spec.shape.grids = [
        synthetic::corners(1, 1, 3),
        synthetic::interpolated(1, 1, 3),
    ];
    (spec.shape.input_bits, spec.hidden) = (4, vec![3]);
    for seed in 0..8 {
        let asset = synthetic::asset(&spec, seed).unwrap();
        let chain = (0..asset.shape.mip_count).flat_map(|mip| Request::blocks(&asset.shape, mip));
        check_all(&asset, chain);
    }
}
