//! Every preset is a network that the unit runs: trained a little, compiled, decoded, and held to the
//! claims against the naive evaluation and the oracle.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
#![cfg(feature = "train")]

mod support;

use ntmu::conformance::claims::findings;
use ntmu::conformance::synthetic::{self, Spec, SpecPrecision};
use ntmu::isa::layer::Layer;
use ntmu::isa::layout::Layout;
use ntmu::isa::sampler::{Detail, SampleRequest, Sampler};
use ntmu::isa::{Asset, Program, image};
use ntmu::model::Request;
use ntmu::model::exec::Decoder;
use ntmu::trainer::{self, Precision, Preset, TrainConfig, TrainingDevice};
use std::sync::atomic::AtomicBool;

fn trained(preset: &Preset, precision: Precision) -> Asset {
    trained_as(&TrainConfig {
        precision,
        ..preset.config()
    })
}

fn trained_as(config: &TrainConfig) -> Asset {
    let config = TrainConfig {
        plan: Some(TrainConfig::default().usual_plan([0, 4, 2])),
        batch: 768,
        ..config.clone()
    };
    let stop = AtomicBool::new(false);
    let source = support::source::brick_wall(32);
    let trained = trainer::train(
        &source,
        &config,
        &TrainingDevice::flex(),
        None,
        false,
        &stop,
        &mut |_| (),
    );
    trained.unwrap().asset
}

fn some_texels(asset: &Asset) -> Vec<Request> {
    let mips = 0..asset.shape.mip_count;
    mips.flat_map(|mip| {
        let (width, height) = asset.shape.mip_size(mip);
        [(0, 0), (width / 2, height / 3), (width - 1, height - 1)]
            .map(|(x, y)| Request::new(&asset.shape, x, y, mip).unwrap())
    })
    .collect()
}

#[test]
fn every_preset_keeps_the_claims_in_bytes_and_in_halves() {
    for preset in Preset::ALL {
        for precision in [Precision::Int8, Precision::Fp16] {
            let asset = trained(&preset, precision);
            let found = findings(&asset, &some_texels(&asset));
            assert!(found.hold(), "{} {precision:?}: {found:#?}", preset.name);
            assert_eq!(found.overflowing, 0, "{} {precision:?}", preset.name);
        }
    }
}

#[test]
fn every_presets_programs_return_from_their_images_and_run_alike() {
    for preset in Preset::ALL {
        for precision in [Precision::Int8, Precision::Fp16] {
            let asset = trained(&preset, precision);
            let texel = Program::compile(&asset, Layout::TILED);
            let sample = Program::compile_sample(&asset, Layout::TILED);
            let [texel_again, sample_again] = [&texel, &sample].map(|program| {
                let bytes = image::write(program.layout(), program.instructions());
                let (layout, instructions) = image::read(&bytes).unwrap();
                let linked = Program::link(&asset, layout, instructions).unwrap();
                assert_eq!(linked, *program, "{} {precision:?}", preset.name);
                linked
            });
            let codes = |program: &Program| -> Vec<Vec<i32>> {
                let decoder = Decoder::new(&asset, program);
                let texels = some_texels(&asset).into_iter();
                texels.map(|texel| decoder.texel(texel, &mut ())).collect()
            };
            assert_eq!(codes(&texel), codes(&texel_again));
            let request = SampleRequest {
                place: [0.3_f32, 0.7].map(f32::to_bits),
                detail: Detail::Lod(0.5_f32.to_bits()),
                random: 0,
            };
            let filtered = |program: &Program| {
                let decoder = Decoder::new(&asset, program);
                decoder
                    .sample(&Sampler::default(), &request, &mut ())
                    .unwrap()
            };
            assert_eq!(filtered(&sample), filtered(&sample_again));
            // Its accumulators are wide enough, whatever the latents.
            assert_eq!(texel.overflows(&asset), [], "{} {precision:?}", preset.name);
        }
    }
}

#[test]
fn the_peers_networks_have_the_widths_that_they_are_known_for() {
    let widths = |name: &str| {
        let asset = trained(&Preset::by_name(name).unwrap(), Precision::Int8);
        let mut widths = vec![asset.shape.input_count() as u16];
        widths.extend(asset.layers.iter().map(|layer| layer.outputs));
        // The last is the set's channels.
        widths.pop();
        widths
    };
    assert_eq!(widths("rtxntc"), [48, 64, 48, 32]);
    assert_eq!(widths("tsnc"), [16, 64, 64]);
    for (name, inputs) in [
        ("ntc-0.2", 57),
        ("ntc-0.5", 81),
        ("ntc-1.0", 71),
        ("ntc-2.25", 89),
    ] {
        assert_eq!(widths(name), [inputs, 64, 64, 64], "{name}");
    }
    let macs = |name: &str| -> u32 {
        let asset = trained(&Preset::by_name(name).unwrap(), Precision::Int8);
        let hidden = &asset.layers[..asset.layers.len() - 1];
        hidden.iter().map(Layer::macs).sum()
    };
    // With the sixteen channels that both give, 8,192 and 6,144 in all.
    assert_eq!(macs("rtxntc") + 32 * 16, 8192);
    assert_eq!(macs("tsnc") + 64 * 16, 6144);
}

/// What the trainer calls a precision of a synthetic asset.
fn configured(preset: &Preset, precision: SpecPrecision) -> TrainConfig {
    let config = preset.config();
    let (precision, weight_bits) = match precision {
        SpecPrecision::Int8 => (vec![Precision::Int8; config.layer_count()], 8),
        SpecPrecision::Int4 => (vec![Precision::Int8; config.layer_count()], 4),
        SpecPrecision::Fp16 => (vec![Precision::Fp16; config.layer_count()], 8),
        SpecPrecision::Mixed => {
            let mut layers = vec![Precision::Int8; config.layer_count()];
            for index in [0, config.layer_count() - 1] {
                layers[index] = Precision::Fp16;
            }
            (layers, 8)
        }
    };
    TrainConfig {
        precision_per_layer: Some(precision),
        weight_bits,
        ..config
    }
}

#[test]
fn a_synthetic_asset_of_a_preset_asks_of_the_unit_what_a_trained_one_does() {
    for preset in Preset::ALL {
        for precision in SpecPrecision::ALL {
            let at = format!("{} {}", preset.name, precision.name());
            let trained = trained_as(&configured(&preset, precision));
            let spec = Spec {
                shape: trained.shape.clone(),
                ..Spec::of_preset(&preset, 1, 1, trained.shape.channel_count(), 1, precision)
            };
            let synthetic = synthetic::asset(&spec, 1).unwrap();
            let shape = &trained.shape;
            let outputs = shape.outputs.clone();
            assert_eq!(
                *shape,
                preset.shape(shape.width, shape.height, shape.mip_count, outputs),
                "{at}"
            );
            let program = |asset| Program::compile(asset, Layout::LINEAR);
            let (a, b) = (program(&trained), program(&synthetic));
            assert_eq!(a.instructions(), b.instructions(), "{at}");
            assert_eq!(trained.parameter_bits(), synthetic.parameter_bits(), "{at}");
            for (index, (a, b)) in trained.layers.iter().zip(&synthetic.layers).enumerate() {
                let bits = |layer: &Layer| layer.parameter_bits(trained.profile.bias_bits);
                assert_eq!(bits(a), bits(b), "{at} layer {index}");
            }
        }
    }
}
