//! Every preset's shape, in every precision, without the trainer: a valid asset, a program, codes.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use ntmu_conformance::synthetic::{self, Spec, SpecPrecision};
use ntmu_isa::activation::Activation;
use ntmu_isa::layer::{Layer, Parameters};
use ntmu_isa::layout::Layout;
use ntmu_isa::preset::{ActivationKind, Preset};
use ntmu_isa::shape::{LaneFormat, OutputFormat};
use ntmu_isa::{Asset, Program};
use ntmu_model::exec::Decoder;
use ntmu_model::{Place, Request};

const LAYOUTS: [Layout; 2] = [Layout::LINEAR, Layout::TILED];
const CHANNELS: u16 = 9;
const SIZE: (u32, u32) = (36, 20);
const MIP_COUNT: u8 = 6;

fn made(preset: &Preset, precision: SpecPrecision) -> Asset {
    let (width, height) = SIZE;
    let spec = Spec::of_preset(preset, width, height, CHANNELS, MIP_COUNT, precision);
    synthetic::asset(&spec, 1).unwrap()
}

/// Claims about every preset in every precision.
fn for_each(claim: impl Fn(&Preset, SpecPrecision, &Asset)) {
    for preset in Preset::ALL {
        for precision in SpecPrecision::ALL {
            claim(&preset, precision, &made(&preset, precision));
        }
    }
}

fn sizes(asset: &Asset) -> Vec<(u16, u16)> {
    let layers = asset.layers.iter();
    layers.map(|layer| (layer.inputs, layer.outputs)).collect()
}

#[test]
fn the_asset_has_the_presets_sizes() {
    for_each(|preset, precision, asset| {
        let at = format!("{} {}", preset.name, precision.name());
        let outputs = vec![OutputFormat::Unorm8; usize::from(CHANNELS)];
        let shape = preset.shape(SIZE.0, SIZE.1, MIP_COUNT, outputs);
        assert_eq!(asset.shape, shape, "{at}");
        assert_eq!(sizes(asset), preset.layers(CHANNELS), "{at}");
        assert_eq!(asset.macs(), preset.macs(CHANNELS), "{at}");
        assert_eq!(asset.shape.input_count(), preset.input_count(), "{at}");
    });
}

#[test]
fn the_asset_has_the_precisions_numbers() {
    for_each(|preset, precision, asset| {
        let last = asset.layers.len() - 1;
        for (index, layer) in asset.layers.iter().enumerate() {
            let at = format!("{} {} layer {index}", preset.name, precision.name());
            let is_outer = index == 0 || index == last;
            let weight_bits = match precision {
                SpecPrecision::Int8 => Some(8),
                SpecPrecision::Int4 => Some(4),
                SpecPrecision::Fp16 => None,
                SpecPrecision::Mixed => (!is_outer).then_some(8),
            };
            let found = match &layer.parameters {
                Parameters::Integer(parameters) => Some(parameters.weight_bits),
                Parameters::Half(_) => None,
            };
            assert_eq!(found, weight_bits, "{at}");
            // Between two layers, halves where all layers are halves and bytes elsewhere.
            if index < last {
                let is_bytes = matches!(layer.output_format(), LaneFormat::Integer { bits: 8, .. });
                assert_eq!(is_bytes, precision != SpecPrecision::Fp16, "{at}");
            }
        }
    });
}

#[test]
fn every_hidden_layer_but_a_blocks_last_has_the_presets_activation_and_that_one_the_skip_path() {
    let is_kind = |layer: &Layer, kind| match kind {
        ActivationKind::Relu => layer.activation == Activation::Relu,
        ActivationKind::Leaky { shift } => layer.activation == Activation::Leaky { shift },
        ActivationKind::HardGelu => {
            matches!(layer.activation, Activation::HardGelu { is_clamped, .. } if !is_clamped)
        }
        ActivationKind::ClampedHardGelu => {
            matches!(layer.activation, Activation::HardGelu { is_clamped, .. } if is_clamped)
        }
    };
    for_each(|preset, precision, asset| {
        let (_, hidden) = asset.layers.split_last().unwrap();
        let (plain, blocks) = hidden.split_at(preset.hidden.len());
        let at = format!("{} {}", preset.name, precision.name());
        assert!(plain.iter().all(|l| is_kind(l, preset.activation)), "{at}");
        assert!(plain.iter().all(|l| l.skip.is_none()), "{at}");
        let span = usize::from(Preset::LAYERS_PER_BLOCK);
        let blocks = blocks.chunks_exact(span);
        assert!(blocks.remainder().is_empty());
        assert_eq!(blocks.len(), usize::from(preset.residual_blocks), "{at}");
        for block in blocks {
            let (last, before) = block.split_last().unwrap();
            assert!(before.iter().all(|l| is_kind(l, preset.activation)), "{at}");
            assert!(before.iter().all(|l| l.skip.is_none()), "{at}");
            assert_eq!(last.activation, Activation::Identity, "{at}");
            let found = last.skip.map(|skip| skip.span);
            assert_eq!(found, Some(Preset::LAYERS_PER_BLOCK), "{at}");
        }
    });
}

#[test]
fn the_program_decodes_places_all_over_the_chain_and_beyond_to_codes_in_range() {
    for_each(|preset, precision, asset| {
        let at = format!("{} {}", preset.name, precision.name());
        for layout in LAYOUTS {
            let program = Program::compile(asset, layout);
            let decoder = Decoder::new(asset, &program);
            let requests = (0..MIP_COUNT).flat_map(|mip| Request::blocks(&asset.shape, mip));
            let mut places: Vec<Place> = requests.step_by(7).map(Place::of).collect();
            for (mip, xy) in (0..MIP_COUNT).zip([-700, -1, 0, 123, 9000, 70_000]) {
                let lod = u32::from(mip) << 4;
                places.push(Place::new(&asset.shape, [xy, 77 - xy], 4, mip, lod, 4).unwrap());
            }
            let (mut low, mut high) = (i32::MAX, i32::MIN);
            for place in &places {
                let codes = decoder.place(place, &mut ());
                assert_eq!(codes.len(), usize::from(CHANNELS), "{at}");
                low = codes.iter().copied().fold(low, i32::min);
                high = codes.iter().copied().fold(high, i32::max);
            }
            assert!(
                low >= 0 && high <= 255 && low < high,
                "{at}: {low}..={high}"
            );
        }
    });
}

#[test]
fn the_bytes_of_the_asset_read_back() {
    for_each(|preset, precision, asset| {
        let back = Asset::from_bytes(&asset.to_bytes()).unwrap();
        assert_eq!(back, *asset, "{} {}", preset.name, precision.name());
    });
}

#[test]
fn the_same_sizes_make_the_same_program_whatever_the_seed() {
    let program = |spec: &Spec, seed| {
        let asset = synthetic::asset(spec, seed).unwrap();
        Program::compile(&asset, LAYOUTS[0])
    };
    for preset in Preset::ALL {
        for precision in SpecPrecision::ALL {
            let spec = Spec::of_preset(&preset, 8, 8, 3, 1, precision);
            assert_eq!(program(&spec, 1), program(&spec, 2), "{}", preset.name);
        }
    }
}

#[test]
fn a_size_outside_the_limits_is_refused_by_name() {
    let refused = |width, channels, mip_count| {
        let [preset, ..] = Preset::ALL;
        let precision = SpecPrecision::Mixed;
        let spec = Spec::of_preset(&preset, width, 8, channels, mip_count, precision);
        synthetic::asset(&spec, 1).unwrap_err().to_string()
    };
    assert!(refused(0, 3, 1).starts_with("shape.width"));
    assert!(refused(8, 0, 1).starts_with("shape.channels"));
    assert!(refused(8, 17, 1).starts_with("shape.channels"));
    assert!(refused(8, 3, 5).starts_with("shape.mip_count"));
}
