//! The trainer's numbers are isa's.

use super::by_isa::{decode, inputs};
use super::{run, small, source, usual};
use crate::batch::all_texels;
use crate::model::Ground;
use crate::sampler::{Numbers, Texel, Window};
use crate::{
    ActivationKind, Address, GridSampling, Precision, Pyramid, Snap, Source, TrainConfig, WaveForm,
};
use ntmu_isa::Asset;

/// Configurations that between them use every kind of input.
fn embeddings() -> Vec<TrainConfig> {
    use GridSampling::{Corners, Interpolated};
    let of = |address, snap, sampling, wave, padding, input_bits| TrainConfig {
        address,
        snap,
        sampling,
        wave,
        padding,
        input_bits,
        ..small()
    };
    let (triangle, saw) = (WaveForm::Triangle, WaveForm::Saw);
    let with = |pyramid, address, snap| TrainConfig {
        pyramid,
        ..of(address, snap, [Corners, Interpolated], triangle, 0, 8)
    };
    vec![
        of(
            Address::Wrap,
            Snap::Stride,
            [Corners, Interpolated],
            triangle,
            0,
            8,
        ),
        of(
            Address::Mirror,
            Snap::Cell,
            [Interpolated, Corners],
            saw,
            3,
            8,
        ),
        of(Address::Clamp, Snap::Stride, [Interpolated; 2], saw, 15, 4),
        of(Address::Wrap, Snap::Cell, [Corners; 2], triangle, 1, 11),
        with(Pyramid::NTC, Address::Mirror, Snap::Stride),
        with(Pyramid::EVERY_MIP, Address::Wrap, Snap::Cell),
        with(Pyramid::new(2, 1).unwrap(), Address::Clamp, Snap::Stride),
        with(Pyramid::new(3, 3).unwrap(), Address::Clamp, Snap::Cell),
    ]
}

#[test]
fn the_sampler_gives_isas_integers_at_every_texel() {
    let plan = usual([0, 1, 1]);
    for config in embeddings() {
        let source = source(45, 70, 7);
        let config = TrainConfig {
            plan: Some(plan.clone()),
            ..config
        };
        let asset = run(&source, &config).unwrap().asset;
        let ground = Ground::new(&config, &source).unwrap();
        let embedding = ground.embedding(Numbers::Integer);
        let seen = [0, 1].map(|g: usize| -> Vec<f32> {
            let format = asset.shape.grids[g].format;
            asset.grids[g]
                .iter()
                .map(|&c| format.value(c) as f32)
                .collect()
        });
        let windows = Window::whole(&ground.positions);
        let mut row = vec![9.0; config.input_count()];
        let sizes: Vec<_> = (0..7).map(|m| asset.shape.mip_size(m)).collect();
        for texel in all_texels(&sizes) {
            let seen = [seen[0].as_slice(), &seen[1]];
            embedding.gather(&ground.positions, &windows, texel, seen, &mut row);
            let expected = inputs(&asset, texel.x, texel.y, texel.mip);
            let found: Vec<i16> = row.iter().map(|&v| v as i16).collect();
            assert_eq!(found, expected, "{texel:?} {config:?}");
        }
    }
}

/// The decibels of the codes that isa's functions decode from an asset.
pub(super) fn decibels_by_isa(source: &Source, asset: &Asset) -> f64 {
    let (mut sum, mut count) = (0.0, 0_u32);
    for (mip, reals) in source.mips.iter().enumerate() {
        let (channels, height, width) = reals.dim();
        for y in 0..height {
            for x in 0..width {
                let codes = decode(asset, x as u32, y as u32, mip as u8);
                for c in 0..channels {
                    let high = asset.shape.outputs[c].range().1 as f32;
                    let real = codes[c] as f32 / high;
                    sum += f64::from(real - reals[[c, y, x]]).powi(2);
                    count += 1;
                }
            }
        }
    }
    -10.0 * (sum / f64::from(count)).log10()
}

/// The error that the report states is that of the codes that isa's functions decode from the
/// exported numbers: the network that was trained is the network that was exported.
fn assert_the_export_is_what_was_trained(config: &TrainConfig) {
    let source = source(40, 24, 5);
    let trained = run(&source, config).unwrap();
    let difference =
        (decibels_by_isa(&source, &trained.asset) - trained.report.psnr_quantised).abs();
    // The same terms in another order of summation in doubles, and one f32 division that may
    // differ in its last place: one 8-bit code that differs would show at about 1e-5, one 16-bit
    // code at about 2e-7.
    assert!(difference < 1e-7, "{config:?}: {difference:e}");
}

const ACTIVATIONS: [ActivationKind; 4] = [
    ActivationKind::Relu,
    ActivationKind::Leaky { shift: 3 },
    ActivationKind::HardGelu,
    ActivationKind::ClampedHardGelu,
];

#[test]
fn the_trained_integers_are_those_of_the_asset() {
    for activation in ACTIVATIONS {
        for (weight_bits, layers_per_block, activation_bits) in [(8, 2, 8), (4, 1, 4), (2, 3, 12)] {
            assert_the_export_is_what_was_trained(&TrainConfig {
                activation,
                weight_bits,
                layers_per_block,
                activation_bits,
                ..small()
            });
        }
    }
}

#[test]
fn layers_of_different_weights_are_trained_as_they_are_decoded() {
    assert_the_export_is_what_was_trained(&TrainConfig {
        weight_bits_per_layer: Some(vec![8, 4, 3, 5, 2, 7, 6]),
        ..small()
    });
}

#[test]
fn every_kind_of_input_is_trained_as_it_is_decoded() {
    for config in embeddings() {
        for precision in [Precision::Int8, Precision::Fp16] {
            assert_the_export_is_what_was_trained(&TrainConfig {
                precision,
                ..config.clone()
            });
        }
    }
}

#[test]
fn the_trained_halves_are_those_of_the_asset() {
    for activation in ACTIVATIONS {
        for layers_per_block in [1, 2] {
            assert_the_export_is_what_was_trained(&TrainConfig {
                activation,
                layers_per_block,
                precision: Precision::Fp16,
                ..small()
            });
        }
    }
}

#[test]
fn layers_of_both_precisions_are_trained_as_they_are_decoded() {
    let (i, h) = (Precision::Int8, Precision::Fp16);
    // Layers 1 to 4 are two residual blocks of two; the skip paths start at layers 0, 2.. and each
    // keeps to one kind of register: that of the layer after its start.
    let lists: [&[Precision]; 5] = [
        &[h, i, i, i, i, h],
        &[i, h, h, h, h, i],
        &[h, h, h, h, h, i],
        &[i, i, i, i, i, h],
        &[h, i, i, i, i, i],
    ];
    for activation in ACTIVATIONS {
        for (list, activation_bits) in lists.into_iter().zip([8, 6, 8, 4, 11]) {
            let config = TrainConfig {
                activation,
                activation_bits,
                hidden: vec![20],
                precision_per_layer: Some(list.to_vec()),
                ..small()
            };
            if list == lists[1] {
                // The first path starts in an integer register that a half layer reads.
                let error = config.validate().unwrap_err().to_string();
                assert!(error.contains("precision_per_layer"), "{error}");
            } else {
                assert_the_export_is_what_was_trained(&config);
            }
        }
    }
}

#[test]
fn halves_exported_from_reals_keep_the_quality() {
    for activation in ACTIVATIONS {
        let source = source(64, 64, 5);
        let config = TrainConfig {
            activation,
            precision: Precision::Fp16,
            plan: Some(usual([0, 400, 0])),
            ..small()
        };
        let trained = run(&source, &config).unwrap();
        let difference = decibels_by_isa(&source, &trained.asset) - trained.report.psnr_float;
        assert!(difference.abs() < 0.05, "{activation:?}: {difference}");
    }
}

#[test]
fn constant_channels_are_reproduced_exactly_beside_others() {
    let mut source = source(16, 16, 3);
    for mip in &mut source.mips {
        mip.index_axis_mut(ndarray::Axis(0), 0).fill(51.0 / 255.0);
        mip.index_axis_mut(ndarray::Axis(0), 3).fill(1.0);
        mip.index_axis_mut(ndarray::Axis(0), 4).fill(-1.0);
    }
    for precision in [Precision::Int8, Precision::Fp16] {
        let config = TrainConfig {
            precision,
            plan: Some(usual([0, 20, 20])),
            ..small()
        };
        let asset = run(&source, &config).unwrap().asset;
        for texel in all_texels(&[(16, 16), (8, 8), (4, 4)]) {
            let codes = decode(&asset, texel.x, texel.y, texel.mip);
            // 0.25 of 255 is 63.75: the nearest code is 64.
            assert_eq!(
                [codes[0], codes[2], codes[3], codes[4]],
                [51, 64, 65_535, -127]
            );
        }
    }
}

#[test]
fn a_texel_is_seen_alike_through_a_crop_and_through_the_whole() {
    let source = source(128, 128, 3);
    let config = small();
    let ground = Ground::new(&config, &source).unwrap();
    let embedding = ground.embedding(Numbers::Real);
    let whole = Window::whole(&ground.positions)[0];
    // A crop of 8×8 encoder positions from (12, 14) on, which wraps: 16 positions an axis.
    let crop = Window {
        origin: [[24, 28], [12, 14]],
        size: [[16, 16], [8, 8]],
        period: [[32, 32], [16, 16]],
        base: [0, 0],
    };
    // Each latent holds its own cell's number, so that equal inputs mean equal cells.
    let fill = |window: &Window, g: usize, channels: usize| -> Vec<f32> {
        let [w, h] = window.size[g];
        let [ox, oy] = window.origin[g];
        let [pw, ph] = window.period[g];
        (0..h)
            .flat_map(|y| (0..w).map(move |x| (x, y)))
            .flat_map(|(x, y)| {
                let cell = ((oy + y) % ph * pw + (ox + x) % pw) as f32;
                vec![cell; channels]
            })
            .collect()
    };
    let [of_whole, of_crop] = [&whole, &crop].map(|w| [fill(w, 0, 3), fill(w, 1, 5)]);
    let mut rows = [
        vec![0.0; config.input_count()],
        vec![0.0; config.input_count()],
    ];
    // Texels whose corners lie inside the crop: one position away from its edges.
    for (x, y) in [(104, 120), (127, 127), (0, 5), (20, 30)] {
        let texel = Texel {
            x,
            y,
            mip: 0,
            window: 0,
        };
        let [a, b] = &mut rows;
        embedding.gather(
            &ground.positions,
            &[whole],
            texel,
            [&of_whole[0], &of_whole[1]],
            a,
        );
        embedding.gather(
            &ground.positions,
            &[crop],
            texel,
            [&of_crop[0], &of_crop[1]],
            b,
        );
        assert_eq!(a, b, "{texel:?}");
    }
}
