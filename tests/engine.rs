//! Every path of the engine gives the codes of the reference interpreter.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use ndarray::Array3;
use ntmu::conformance::synthetic::{self, Spec, SpecActivation, SpecKind};
use ntmu::isa::accumulate::{Accumulator, Overflow};
use ntmu::isa::half::SumOrder;
use ntmu::isa::layout::Layout;
use ntmu::isa::profile::{NamedProfile, Profile};
use ntmu::isa::rescale::Requantizer;
use ntmu::isa::round::Rounding;
use ntmu::isa::{Asset, Program};
use ntmu::model::engine::{Engine, Path};
use ntmu::model::exec::Decoder;
use ntmu::model::sampler::Decode;
use ntmu::model::{Place, Request};
use ntmu::precision::{in_halves, narrow, with_activations};

/// Places at and between texels, before and behind the mip, with the first, the last and other levels
/// of detail.
fn places(asset: &Asset) -> Vec<Place> {
    let shape = &asset.shape;
    let mut places = Vec::new();
    for mip in 0..shape.mip_count {
        let (width, height) = shape.mip_size(mip);
        for step in 0..13_i64 {
            let bits = 1 + (step % 12) as u8;
            let at = |size: u32, phase: i64| ((i64::from(size) * phase) << bits) / 8 - 3 + phase;
            let coordinates = [at(width, step - 2), at(height, 9 - step)];
            let lod_bits = (step % 9) as u8;
            let last = u32::from(shape.mip_count - 1) << lod_bits;
            let lod = last * step as u32 / 12;
            places.push(Place::new(shape, coordinates, bits, mip, lod, lod_bits).unwrap());
        }
    }
    places
}

/// All mips whole, by `mip` and by `bands`, single texels and blocks along their diagonal, and places.
fn assert_equal(asset: &Asset, what: &str) {
    let program = Program::compile(asset, Layout::LINEAR);
    let reference = Decoder::new(asset, &program);
    let places = places(asset);
    let expected_places = Decode::places(&reference, &places);
    let mips = 0..asset.shape.mip_count;
    let expected_mips: Vec<Array3<i32>> = mips.map(|mip| reference.mip(mip)).collect();
    for path in Path::available() {
        let engine = Engine::with_path(asset, path).unwrap();
        let mut scratch = engine.scratch();
        let mut codes = vec![0; asset.shape.outputs.len()];
        assert_eq!(
            engine.places(&places),
            expected_places,
            "{what}, {}",
            path.name()
        );
        assert_eq!(engine.place(&places[0]), expected_places[0], "{what}");
        for (mip, expected) in (0..).zip(&expected_mips) {
            let what = format!("{what}, {}, mip {mip}", path.name());
            assert_eq!(engine.mip(mip), *expected, "{what}");
            let mut rows = 0;
            engine.bands(mip, |first, codes| {
                assert_eq!(first as usize, rows, "{what}");
                for (channel, plane) in codes.outer_iter().enumerate() {
                    for (row, texels) in plane.outer_iter().enumerate() {
                        let place = ndarray::s![channel, rows + row, ..];
                        assert_eq!(texels, expected.slice(place), "{what}");
                    }
                }
                rows += codes.dim().1;
            });
            let (width, height) = asset.shape.mip_size(mip);
            assert_eq!(rows, height as usize, "{what}");
            let mut requests = Vec::new();
            for step in 0..16 {
                let (x, y) = (width * step / 16, height * (15 - step) / 16);
                let request = Request::new(&asset.shape, x, y, mip).unwrap();
                requests.push(request);
                engine.texel(&mut scratch, request, &mut codes);
                let place = ndarray::s![.., y as usize, x as usize];
                assert_eq!(codes, expected.slice(place).to_vec(), "{what}, {x} {y}");
                let block = engine.block(x / 4, y / 4, mip).unwrap();
                assert_eq!(block, reference.block(x / 4, y / 4, mip).unwrap(), "{what}");
            }
            assert_eq!(
                engine.texels(&requests),
                reference.texels(&requests),
                "{what}"
            );
        }
    }
}

#[test]
fn every_path_decodes_arbitrary_assets_like_the_reference() {
    for seed in 0..300 {
        let spec = synthetic::arbitrary_spec(seed);
        let asset = synthetic::asset(&spec, seed).unwrap();
        assert_equal(&asset, &format!("seed {seed}"));
    }
}

#[test]
fn every_path_decodes_the_built_in_asset_like_the_reference() {
    assert_equal(&ntmu::built_in::asset().unwrap(), "built-in");
}

/// Mips from 3 on: a sixty-fourth of the texels, at every position that a grid has.
fn without_large_mips(asset: &Asset) -> Asset {
    let mut parts = asset.clone().into_parts();
    let shape = &mut parts.shape;
    (shape.width, shape.height) = (shape.width / 8, shape.height / 8);
    shape.mip_count -= 3;
    for grid in 0..2 {
        let (width, height) = parts.shape.grid_size(grid);
        let latents = parts.shape.grid_latents(grid) as usize;
        assert!(width > 0 && height > 0);
        parts.grids[grid].truncate(latents);
    }
    Asset::new(parts).unwrap()
}

#[test]
fn every_path_decodes_the_built_in_asset_in_other_numbers_like_the_reference() {
    let asset = without_large_mips(&ntmu::built_in::asset().unwrap());
    for weight_bits in [2, 4, 6] {
        let narrowed = narrow(&asset, 3, weight_bits).unwrap();
        assert_equal(&narrowed, &format!("{weight_bits} bits of weights"));
    }
    for bits in 4..=16 {
        let widened = with_activations(&asset, bits).unwrap();
        assert_equal(&widened, &format!("{bits} bits of activations"));
    }
    for order in SumOrder::ALL {
        let mut parts = in_halves(&asset).unwrap().into_parts();
        parts.profile.sum = order;
        let halves = Asset::new(parts).unwrap();
        assert_equal(&halves, &format!("halves, {}", order.name()));
    }
}

#[test]
fn every_path_decodes_every_named_profile_like_the_reference() {
    let asset = without_large_mips(&ntmu::built_in::asset().unwrap());
    for named in NamedProfile::all().unwrap() {
        for variant in [asset.clone(), in_halves(&asset).unwrap()] {
            let mut parts = variant.into_parts();
            parts.profile = named.profile;
            let variant = Asset::new(parts).unwrap();
            assert_equal(&variant, &named.name);
        }
    }
}

#[test]
fn every_rounding_and_requantiser_decodes_like_the_reference() {
    let mut profiles = Vec::new();
    for rounding in Rounding::ALL {
        for requantizer in Requantizer::ALL {
            profiles.push(Profile {
                input: rounding,
                leak: rounding,
                convert: rounding,
                requantize: requantizer,
                ..Profile::NORMATIVE
            });
            profiles.push(Profile {
                skip: requantizer,
                output: requantizer,
                leak: rounding,
                ..Profile::NORMATIVE
            });
        }
    }
    let activations = [
        SpecActivation::Identity,
        SpecActivation::Relu,
        SpecActivation::Leaky(3),
        SpecActivation::HardGelu,
        SpecActivation::ClampedGelu,
        SpecActivation::Table,
    ];
    for (seed, profile) in profiles.into_iter().enumerate() {
        for activation in activations {
            let mut spec = Spec::small(21, 18);
            spec.profile = profile;
            spec.activation = activation;
            spec.hidden = vec![17, 33];
            let asset = synthetic::asset(&spec, seed as u64).unwrap();
            assert_equal(&asset, &format!("{profile:?} {activation:?}"));
        }
    }
}

#[test]
fn accumulators_that_overflow_decode_like_the_reference() {
    for (bits, overflow) in [16, 17, 18, 20]
        .into_iter()
        .flat_map(|b| Overflow::ALL.map(|o| (b, o)))
    {
        for (seed, output_bits) in [(1, 8), (2, 6), (3, 12), (4, 16)] {
            let mut spec = Spec::small(13, 9).with_bits(8, output_bits);
            spec.profile.accumulator = Accumulator { bits, overflow };
            spec.hidden = vec![17, 33];
            let asset = synthetic::asset(&spec, seed).unwrap();
            assert_equal(&asset, &format!("{bits} {overflow:?} {output_bits}"));
        }
    }
}

#[test]
fn layers_of_every_pair_of_kinds_follow_each_other_like_in_the_reference() {
    let kinds = [4, 8, 9, 16]
        .map(|output_bits| SpecKind::Integer {
            weight_bits: 8,
            output_bits,
        })
        .into_iter()
        .chain([None, Some(7), Some(13)].map(|quantize| SpecKind::Half { quantize }));
    let kinds: Vec<SpecKind> = kinds.collect();
    for (seed, (&first, &second)) in kinds
        .iter()
        .flat_map(|a| kinds.iter().map(move |b| (a, b)))
        .enumerate()
    {
        let mut spec = Spec::small(11, 10);
        spec.kinds = vec![first, second];
        spec.hidden = vec![9];
        spec.blocks = 2;
        spec.block_span = 1 + (seed % 3) as u8;
        let asset = synthetic::asset(&spec, seed as u64).unwrap();
        assert_equal(&asset, &format!("{first:?} {second:?}"));
    }
}

#[test]
fn the_synthesizer_alone_gives_the_codes_of_the_inputs_that_the_reference_saw() {
    for seed in 0..60 {
        let asset = synthetic::asset(&synthetic::arbitrary_spec(seed), seed).unwrap();
        let program = Program::compile(&asset, Layout::LINEAR);
        let reference = Decoder::new(&asset, &program);
        let (mut inputs, mut expected) = (Vec::new(), Vec::new());
        for request in Request::blocks(&asset.shape, 0).take(100) {
            let taps = reference.taps(request);
            inputs.extend(taps.inputs.iter().copied());
            expected.extend(taps.codes);
        }
        for path in Path::available() {
            let engine = Engine::with_path(&asset, path).unwrap();
            let mut codes = vec![0; expected.len()];
            engine.synthesize(&inputs, &mut codes);
            assert_eq!(codes, expected, "seed {seed}, {}", path.name());
            if asset.shape.input_bits <= 8 {
                let bytes: Vec<i8> = inputs.iter().map(|&input| input as i8).collect();
                codes.fill(0);
                engine.synthesize(&bytes, &mut codes);
                assert_eq!(codes, expected, "seed {seed}, {}", path.name());
            }
            let blocked = engine.block_inputs(&inputs);
            let mut planar = engine.planar(&blocked);
            engine.synthesize_blocked(&blocked, &mut planar);
            let channels = asset.shape.outputs.len();
            for (at, &code) in expected.iter().enumerate() {
                assert_eq!(
                    planar.code(at / channels, at % channels),
                    code,
                    "seed {seed}"
                );
            }
        }
    }
}
