//! A pyramid is decoded by the model as it was trained.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
#![cfg(feature = "train")]

mod support;

use ntmu::decoded::Decoded;
use ntmu::isa::Asset;
use ntmu::trainer::{self, Precision, Preset, Pyramid, Source, TrainConfig, TrainingDevice};
use std::sync::atomic::AtomicBool;

/// The decibels of the model's codes, mip by mip.
fn decibels(asset: &Asset, source: &Source) -> Vec<f64> {
    let decoded = Decoded::of(asset, |_| ()).reals(&asset.shape);
    let mips = decoded.iter().zip(&source.mips);
    mips.map(|(found, expected)| {
        let squares = found.iter().zip(expected).map(|(a, b)| {
            let error = f64::from(a - b);
            error * error
        });
        -10.0 * (squares.sum::<f64>() / found.len() as f64).log10()
    })
    .collect()
}

fn assert_decoded_as_trained(config: &TrainConfig, levels: u8) {
    let source = support::source::brick_wall(256);
    let config = TrainConfig {
        batch: 768,
        plan: Some(config.usual_plan([0, 60, 30])),
        ..config.clone()
    };
    let stop = AtomicBool::new(false);
    let trained = trainer::train(
        &source,
        &config,
        &TrainingDevice::flex(),
        None,
        false,
        &stop,
        &mut |_| (),
    )
    .unwrap();
    let asset = trained.asset;
    assert_eq!(asset.shape.pyramid, config.pyramid);
    assert_eq!(asset.shape.level_count(), levels);
    // The file is the same asset.
    assert_eq!(Asset::from_bytes(&asset.to_bytes()).unwrap(), asset);
    for (mip, (model, trainer)) in decibels(&asset, &source)
        .into_iter()
        .zip(trained.report.psnr_mips)
        .enumerate()
    {
        // f64 sums of at most 2^16 equal terms in another order: off by 2^−37 of themselves. A code
        // that differs shows at 10⁻⁵.
        assert!(
            (model - trainer).abs() < 1e-9,
            "{config:?} mip {mip}: model {model}, trainer {trainer}"
        );
    }
}

#[test]
fn the_model_decodes_every_mip_of_the_ntc_profiles_as_the_trainer_measured_it() {
    for name in ["ntc-0.2", "ntc-0.5", "ntc-1.0", "ntc-2.25"] {
        for precision in [Precision::Int8, Precision::Fp16] {
            let config = Preset::by_name(name).unwrap().config();
            assert_eq!(config.pyramid, Pyramid::NTC);
            let config = TrainConfig {
                precision,
                ..config
            };
            assert_decoded_as_trained(&config, 3);
        }
    }
}

#[test]
fn the_model_decodes_every_mip_of_any_pyramid_as_the_trainer_measured_it() {
    for (pyramid, levels) in [
        (Pyramid::EVERY_MIP, 4),
        (Pyramid::new(1, 1).unwrap(), 7),
        (Pyramid::new(3, 2).unwrap(), 3),
    ] {
        let config = TrainConfig {
            pyramid,
            ..Preset::by_name("hw-16").unwrap().config()
        };
        assert_decoded_as_trained(&config, levels);
    }
}
