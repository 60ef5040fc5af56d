//! Loss: weights and masks do what they say.

use super::{run, small, source, usual};
use crate::{Source, TrainConfig};
use ndarray::{Array2, Axis};
use ntmu_isa::asset::Map;

/// The set with its channels as maps of their own, so that they can be weighted.
fn split(width: usize, height: usize) -> Source {
    let mut source = source(width, height, 4);
    let whole = source.maps.remove(0);
    source.maps = (0..5)
        .map(|channel| Map {
            name: format!("map{channel}"),
            first_channel: channel,
            channel_count: 1,
            ..whole.clone()
        })
        .collect();
    source
}

#[test]
fn a_map_that_counts_more_comes_out_better_and_the_others_worse() {
    let source = split(64, 64);
    let channels = |weights: &[(&str, f64)]| {
        let config = TrainConfig {
            plan: Some(usual([0, 300, 100])),
            weights: weights
                .iter()
                .map(|(map, w)| ((*map).to_owned(), *w))
                .collect(),
            ..small()
        };
        run(&source, &config).unwrap().report.psnr_channels
    };
    let (even, weighted) = (channels(&[]), channels(&[("map4", 20.0)]));
    assert!(weighted[4] > even[4] + 1.0, "{weighted:?} {even:?}");
    let others = |psnr: &[f64]| psnr[0] + psnr[1] + psnr[3];
    assert!(others(&weighted) < others(&even), "{weighted:?} {even:?}");
}

#[test]
fn equal_weights_change_nothing_and_a_weight_of_zero_leaves_a_map_out() {
    let source = split(32, 32);
    let with = |weights: &[(&str, f64)]| TrainConfig {
        weights: weights
            .iter()
            .map(|(map, w)| ((*map).to_owned(), *w))
            .collect(),
        ..small()
    };
    let plain = run(&source, &with(&[])).unwrap().asset;
    let all: Vec<(String, f64)> = (0..5).map(|c| (format!("map{c}"), 3.0)).collect();
    let all: Vec<(&str, f64)> = all.iter().map(|(map, w)| (map.as_str(), *w)).collect();
    let even = run(&source, &with(&all)).unwrap().asset;
    assert_eq!(even.grids, plain.grids);
    assert_eq!(even.layers, plain.layers);

    // What does not count may hold anything: only an encoder looks at it.
    let mut other = source.clone();
    for mip in &mut other.mips {
        mip.index_axis_mut(Axis(0), 1)
            .mapv_inplace(|v| 0.9 - 0.8 * v);
    }
    let without = TrainConfig {
        plan: Some(usual([0, 30, 30])),
        ..with(&[("map1", 0.0)])
    };
    let [a, b] = [&source, &other].map(|s| run(s, &without).unwrap().asset);
    assert_eq!(a.grids, b.grids);

    let error = run(&source, &with(&[("map7", 1.0)]))
        .unwrap_err()
        .to_string();
    assert!(error.contains("map7") && error.contains("map4"), "{error}");
    let none: Vec<(&str, f64)> = all.iter().map(|(map, _)| (*map, 0.0)).collect();
    assert!(run(&source, &with(&none)).is_err());
}

#[test]
fn masked_texels_count_neither_in_the_loss_nor_in_the_figures_on_the_whole_and_on_crops() {
    let mut plain = source(80, 64, 4);
    plain.mask = Some(Array2::from_shape_fn((64, 80), |(y, x)| x < 24 && y >= 16));
    // What is masked out in every mip may hold anything: only the encoder looks at it.
    let mut other = plain.clone();
    for (m, mip) in other.mips.iter_mut().enumerate() {
        let (_, h, w) = mip.dim();
        for (y, x) in (0..h).flat_map(|y| (0..w).map(move |x| (y, x))) {
            if (x << m) >= 24 || ((y + 1) << m) <= 16 {
                mip[[1, y, x]] = 1.0 - mip[[1, y, x]];
            }
        }
    }
    let config = TrainConfig {
        plan: Some(usual([0, 200, 100])),
        ..small()
    };
    let [a, b] = [&plain, &other].map(|s| run(s, &config).unwrap());
    assert_eq!(a.asset.grids, b.asset.grids);
    assert_eq!(a.report.psnr_channels, b.report.psnr_channels);
    assert_eq!(a.report.psnr_mips, b.report.psnr_mips);
    let mut whole = plain.clone();
    whole.mask = None;
    let whole = run(&whole, &config).unwrap();
    assert!(
        a.report.psnr_quantised > whole.report.psnr_quantised + 1.0,
        "{} {}",
        a.report.psnr_quantised,
        whole.report.psnr_quantised
    );
    let crops = TrainConfig {
        plan: Some(usual([3, 3, 3])),
        ..small()
    };
    assert!(
        run(&plain, &crops)
            .unwrap()
            .report
            .psnr_quantised
            .is_finite()
    );
}
