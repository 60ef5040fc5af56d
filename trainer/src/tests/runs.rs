//! Runs: quality, determinism, refusals.

use super::{run, small, source, usual};
use crate::{ActivationKind, GridSampling, Precision, Preset, TrainConfig, WaveForm};
use ntmu_isa::shape::Shape;

#[test]
fn training_improves_and_the_numbers_of_the_decode_keep_the_quality() {
    let source = source(64, 64, 5);
    let quality = |n: u64, config: &TrainConfig| {
        let plan = usual([0, n, n / 2]);
        let config = TrainConfig {
            plan: Some(plan),
            ..config.clone()
        };
        run(&source, &config).unwrap().report
    };
    let (int8, fp16) = (Precision::Int8, Precision::Fp16);
    for config in [
        small(),
        TrainConfig {
            precision: fp16,
            ..small()
        },
        TrainConfig {
            precision_per_layer: Some(vec![fp16, fp16, int8, int8, int8, int8, fp16]),
            ..small()
        },
        TrainConfig {
            activation: ActivationKind::ClampedHardGelu,
            sampling: [GridSampling::Interpolated; 2],
            wave: WaveForm::Saw,
            padding: 3,
            ..small()
        },
    ] {
        let (short, long) = (quality(10, &config), quality(600, &config));
        assert!(
            long.psnr_quantised > short.psnr_quantised + 6.0,
            "{short:?} {long:?}"
        );
        assert!(long.psnr_quantised > long.psnr_float - 0.3, "{long:?}");
    }
}

#[test]
fn the_same_seed_gives_the_same_asset_and_another_seed_another() {
    let source = source(50, 33, 4);
    let config = small();
    let first = run(&source, &config).unwrap().asset;
    assert_eq!(first, run(&source, &config).unwrap().asset);
    assert_ne!(
        first,
        run(&source, &TrainConfig { seed: 1, ..config })
            .unwrap()
            .asset
    );
}

#[test]
fn sets_of_any_size_train() {
    for (width, height) in [(1, 1), (1, 40), (3, 2), (9, 65), (130, 70)] {
        let mips = usize::from(Shape::max_mip_count(width as u32, height as u32));
        let source = source(width, height, mips);
        let asset = run(&source, &small()).unwrap().asset;
        assert_eq!(
            (asset.shape.width, asset.shape.height),
            (width as u32, height as u32)
        );
    }
}

#[test]
fn every_preset_is_valid_and_makes_an_asset_of_its_sizes() {
    let source = source(24, 16, 3);
    for preset in Preset::ALL {
        let config = TrainConfig {
            batch: 768,
            plan: Some(usual([0, 2, 2])),
            ..preset.config()
        };
        let trained = run(&source, &config).unwrap();
        assert_eq!(
            trained.report.macs,
            u64::from(trained.asset.macs()),
            "{}",
            preset.name
        );
        let outputs = source.outputs.clone();
        let mip_count = source.mips.len() as u8;
        let asset = &trained.asset;
        let shape = Shape {
            pyramid: config.pyramid,
            ..preset.shape(asset.shape.width, asset.shape.height, mip_count, outputs)
        };
        assert_eq!(asset.shape, shape, "{}", preset.name);
        let layers = asset.layers.iter();
        let sizes: Vec<(u16, u16)> = layers.map(|l| (l.inputs, l.outputs)).collect();
        let channels = asset.shape.channel_count();
        assert_eq!(sizes, preset.layers(channels), "{}", preset.name);
        assert_eq!(asset.macs(), preset.macs(channels), "{}", preset.name);
        assert_eq!(Preset::by_name(preset.name).unwrap(), preset);
    }
    let error = Preset::by_name("cntc-17").unwrap_err().to_string();
    assert!(error.contains("cntc-16"), "{error}");
}

#[test]
fn configurations_out_of_range_are_refused_by_field() {
    type Change = fn(&mut TrainConfig);
    let cases: [(&str, Change); 15] = [
        ("grids[1].bits", |c| c.grids[1].bits = 9),
        ("hidden", |c| c.hidden.clear()),
        ("layers_per_block", |c| c.layers_per_block = 4),
        ("activation.shift", |c| {
            c.activation = ActivationKind::Leaky { shift: 0 }
        }),
        ("batch", |c| c.batch = 1000),
        ("crop", |c| c.crop = 100),
        ("uniform_mips", |c| c.uniform_mips = f64::NAN),
        ("padding", |c| c.padding = 16),
        ("input_bits: found 3; allowed: 4..=16", |c| c.input_bits = 3),
        ("input_bits: found 13; allowed: 4..=12", |c| {
            c.input_bits = 13;
            c.precision = Precision::Fp16;
        }),
        ("input_bits: found 14; allowed: 4..=12", |c| {
            c.input_bits = 14
        }),
        ("activation_bits: found 13; allowed: 4..=12", |c| {
            c.activation_bits = 13
        }),
        ("precision_per_layer: found 2 layers; allowed: 7", |c| {
            c.precision_per_layer = Some(vec![Precision::Int8; 2]);
        }),
        ("weight_bits_per_layer: found 3 layers; allowed: 7", |c| {
            c.weight_bits_per_layer = Some(vec![8; 3]);
        }),
        ("weight_bits_per_layer[1]: found 9; allowed: 2..=8", |c| {
            c.weight_bits_per_layer = Some(vec![8, 9, 8, 8, 8, 8, 8]);
        }),
    ];
    for (field, change) in cases {
        let mut config = small();
        change(&mut config);
        let error = config.validate().unwrap_err().to_string();
        assert!(error.contains(field), "{error}");
    }
}
