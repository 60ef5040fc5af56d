//! The whole decode on the device, against a decoder of a few lines in `support`.
#![allow(
    clippy::unwrap_used,
    reason = "a test stops at what it does not expect"
)]

mod support;

use ntmu_isa::Asset;
use ntmu_isa::limits;
use ntmu_isa::shape::OutputFormat;
use ntmu_shaders::{Gpu, Twin, TwinError};
use support::{Random, Recipe, gpu, reference, shape};

/// Every texel of a mip.
fn texels_of(asset: &Asset, mip: u8) -> Vec<(u32, u32, u8)> {
    let (width, height) = asset.shape.mip_size(mip);
    (0..height)
        .flat_map(|y| (0..width).map(move |x| (x, y, mip)))
        .collect()
}

/// Some texels of an asset, of any mip.
fn sample(asset: &Asset, random: &mut Random, count: usize) -> Vec<(u32, u32, u8)> {
    (0..count)
        .map(|_| {
            let mip = random.within(0, i64::from(asset.shape.mip_count) - 1) as u8;
            let (width, height) = asset.shape.mip_size(mip);
            let x = random.within(0, i64::from(width) - 1) as u32;
            (x, random.within(0, i64::from(height) - 1) as u32, mip)
        })
        .collect()
}

/// Compares the taps stage by stage, then the codes of the decode without taps.
fn assert_agrees(gpu: &Gpu, asset: &Asset, requests: &[(u32, u32, u8)]) {
    let twin = Twin::on(gpu, asset).unwrap();
    let taps = twin.taps(requests).unwrap();
    assert_eq!(taps.len(), requests.len());
    let mut codes = Vec::new();
    for (tap, &request) in taps.iter().zip(requests) {
        let expected = reference(asset, request);
        assert_eq!(tap.grids, expected.grids, "{request:?}");
        assert_eq!(tap.inputs, expected.inputs, "{request:?}");
        for (index, (found, layer)) in tap.layers.iter().zip(&expected.layers).enumerate() {
            assert!(found == layer, "{request:?}, layer {index}");
        }
        assert!(tap == &expected, "{request:?}");
        codes.extend(expected.codes);
    }
    assert_eq!(twin.texels(requests).unwrap(), codes);
}

#[test]
fn every_kind_of_small_asset_decodes_as_specified() {
    let Some(gpu) = gpu() else { return };
    for seed in 0..24 {
        let mut random = Random(seed);
        let recipe = Recipe::any(&mut random);
        let asset = recipe.asset(&mut random);
        let requests = sample(&asset, &mut random, 130);
        assert_agrees(&gpu, &asset, &requests);
    }
}

#[test]
fn every_texel_of_every_mip_of_an_odd_size_decodes_as_specified() {
    let Some(gpu) = gpu() else { return };
    let mut random = Random(7);
    let outputs = vec![OutputFormat::Unorm8; 9];
    let shape = shape((51, 37), [(6, 4, 3), (12, 4, 2)], outputs);
    let asset = Recipe::ordinary(shape, vec![20, 20, 20]).asset(&mut random);
    let twin = Twin::on(&gpu, &asset).unwrap();
    for mip in 0..asset.shape.mip_count {
        let expected: Vec<i32> = texels_of(&asset, mip)
            .into_iter()
            .flat_map(|request| reference(&asset, request).codes)
            .collect();
        assert_eq!(twin.mip(mip).unwrap(), expected, "mip {mip}");
    }
}

#[test]
fn one_texel_and_one_layer_decode_as_specified() {
    let Some(gpu) = gpu() else { return };
    let mut random = Random(8);
    let mut shape = shape((1, 1), [(1, 1, 1), (1, 8, 1)], vec![OutputFormat::Snorm8]);
    shape.octaves = 0;
    let asset = Recipe::ordinary(shape, Vec::new()).asset(&mut random);
    assert_agrees(&gpu, &asset, &[(0, 0, 0)]);
    let twin = Twin::on(&gpu, &asset).unwrap();
    assert_eq!(twin.mip(0).unwrap(), reference(&asset, (0, 0, 0)).codes);
    assert_eq!(twin.texels(&[]).unwrap(), []);
    assert_eq!(twin.taps(&[]).unwrap(), []);
}

#[test]
fn the_widest_and_deepest_synthesizers_decode_as_specified() {
    let Some(gpu) = gpu() else { return };
    let mut random = Random(9);
    // 4·128 + 128 + 12 + 1 inputs, 1024 lanes, 16 channels.
    let outputs = vec![OutputFormat::Unorm16; usize::from(limits::MAX_CHANNELS)];
    let widest = [limits::MAX_GRID_CHANNELS; 2].map(|channels| (channels, 8, 1));
    let mut recipe = Recipe::ordinary(shape((9, 7), widest, outputs), vec![limits::MAX_LANES; 7]);
    recipe.spans = vec![3];
    let asset = recipe.asset(&mut random);
    let requests = sample(&asset, &mut random, 9);
    assert_agrees(&gpu, &asset, &requests);

    let deep = vec![24; usize::from(limits::MAX_LAYERS) - 1];
    let small = shape(
        (19, 5),
        [(3, 3, 3), (5, 5, 2)],
        vec![OutputFormat::Unorm8; 3],
    );
    let mut recipe = Recipe::ordinary(small, deep);
    recipe.spans = vec![0, 1, 2, 3];
    let asset = recipe.asset(&mut random);
    let requests = sample(&asset, &mut random, 200);
    assert_agrees(&gpu, &asset, &requests);
}

#[test]
fn a_mip_of_several_dispatches_is_the_texels_in_order() {
    let Some(gpu) = gpu() else { return };
    let mut random = Random(10);
    // 2^20 texels fit one dispatch; this is a little more, and no multiple of a workgroup.
    let mut shape = shape(
        (1151, 937),
        [(1, 2, 3), (1, 2, 3)],
        vec![OutputFormat::Unorm8],
    );
    shape.octaves = 0;
    let asset = Recipe::ordinary(shape, Vec::new()).asset(&mut random);
    let twin = Twin::on(&gpu, &asset).unwrap();
    let codes = twin.mip(0).unwrap();
    let texels = texels_of(&asset, 0);
    assert_eq!(codes.len(), texels.len());
    for (code, request) in codes.into_iter().zip(texels) {
        assert_eq!(vec![code], reference(&asset, request).codes, "{request:?}");
    }
}

#[test]
fn a_texel_that_does_not_exist_is_refused() {
    let Some(gpu) = gpu() else { return };
    let mut random = Random(11);
    let shape = shape((20, 10), [(1, 2, 3), (1, 2, 3)], vec![OutputFormat::Unorm8]);
    let asset = Recipe::ordinary(shape, vec![4]).asset(&mut random);
    let twin = Twin::on(&gpu, &asset).unwrap();
    for found in [(20, 0, 0), (0, 10, 0), (10, 0, 1), (0, 0, 5)] {
        let requests = [(0, 0, 0), found];
        let refused = [
            twin.texels(&requests).map(|_| ()),
            twin.taps(&requests).map(|_| ()),
        ];
        for outcome in refused {
            match outcome {
                Err(TwinError::Request {
                    index,
                    found: stated,
                    ..
                }) => assert_eq!((index, stated), (1, found)),
                other => panic!("{other:?}"),
            }
        }
    }
    assert!(matches!(twin.mip(5), Err(TwinError::Request { .. })));
    assert!(twin.mip(4).is_ok());
}
