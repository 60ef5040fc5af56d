//! The whole decode on the device, against a decoder of a few lines in `support`.
#![allow(
    clippy::unwrap_used,
    reason = "a test stops at what it does not expect"
)]

mod support;

use ntmu_isa::accumulate::{Accumulator, Overflow};
use ntmu_isa::activation::Activation;
use ntmu_isa::filter::FilterRule;
use ntmu_isa::half::{Half, SumOrder};
use ntmu_isa::layer::{HalfParameters, IntegerParameters, Layer, Parameters};
use ntmu_isa::profile::{NamedProfile, Profile};
use ntmu_isa::pyramid::Pyramid;
use ntmu_isa::rescale::Multiplier;
use ntmu_isa::shape::{LaneFormat, OutputFormat, Sampling};
use ntmu_isa::{Asset, limits};
use ntmu_shaders::{Gpu, Twin, TwinError};
use std::collections::BTreeSet;
use support::{Halves, Random, Recipe, gpu, reference, shape};

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
fn assert_agrees(gpu: &Gpu, asset: &Asset, requests: &[(u32, u32, u8)], what: &str) {
    let twin = Twin::on(gpu, asset).unwrap();
    let taps = twin.taps(requests).unwrap();
    assert_eq!(taps.len(), requests.len());
    let mut codes = Vec::new();
    for (tap, &request) in taps.iter().zip(requests) {
        let expected = reference(asset, request);
        assert_eq!(tap.grids, expected.grids, "{what}, {request:?}");
        assert_eq!(tap.inputs, expected.inputs, "{what}, {request:?}");
        for (index, (found, layer)) in tap.layers.iter().zip(&expected.layers).enumerate() {
            let place = format!("{what}, {request:?}, layer {index}");
            assert!(found.accumulators == layer.accumulators, "{place}: sums");
            assert!(found.activated == layer.activated, "{place}: activation");
            assert!(found.outputs == layer.outputs, "{place}: outputs");
        }
        assert!(tap == &expected, "{what}, {request:?}");
        codes.extend(expected.codes);
    }
    assert_eq!(twin.texels(requests).unwrap(), codes, "{what}");
}

/// The small assets of every kind, each with the generator that goes on from it.
fn small_assets() -> impl Iterator<Item = (u64, Asset, Random)> {
    (0..40).map(|seed| {
        let mut random = Random(seed);
        let asset = Recipe::any(&mut random).asset(&mut random);
        (seed, asset, random)
    })
}

#[test]
fn the_small_assets_are_of_every_kind() {
    let mut seen = BTreeSet::new();
    for (_, asset, _) in small_assets() {
        let (shape, profile) = (&asset.shape, &asset.profile);
        seen.insert(format!("interpolate {}", profile.interpolate.name()));
        seen.insert(format!("wave {}", shape.wave.name()));
        let is_single = shape.pyramid == Pyramid::SINGLE;
        let levels = shape.level_count().min(3);
        seen.insert(format!("single {is_single}, levels {levels}"));
        for grid in [0, 1] {
            seen.insert(format!("grid {grid} {}", shape.grids[grid].sampling.name()));
        }
        for (index, layer) in asset.layers.iter().enumerate() {
            let input = match asset.input_format(index) {
                LaneFormat::Integer { bits: 4..=8, .. } => "bytes",
                LaneFormat::Integer { .. } => "words",
                LaneFormat::Half => "halves",
            };
            let (kind, sum) = match &layer.parameters {
                Parameters::Integer(_) => ("integer", profile.accumulator.overflow.name()),
                Parameters::Half(half) => {
                    if half.quantize.is_some() {
                        seen.insert("quantize".to_owned());
                    }
                    ("half", profile.sum.name())
                }
            };
            seen.insert(format!("{kind} of {input} {sum}"));
            seen.insert(format!("{kind} {}", layer.activation.name()));
            if layer.skip.is_some() {
                seen.insert(format!("{kind} skip"));
            }
        }
        let kind = if asset
            .layers
            .last()
            .is_some_and(|last| last.half().is_some())
        {
            "half"
        } else {
            "integer"
        };
        seen.extend(
            shape
                .outputs
                .iter()
                .map(|o| format!("{kind} to {}", o.name())),
        );
    }
    let both = |names: &[&str]| -> Vec<String> {
        let kinds = ["integer", "half"].iter();
        kinds
            .flat_map(|kind| names.iter().map(move |name| format!("{kind} {name}")))
            .collect()
    };
    let mut wanted = both(&[
        "identity",
        "relu",
        "leaky",
        "hard-gelu",
        "hard-gelu-3",
        "skip",
    ]);
    wanted.extend(both(&[
        "to unorm8",
        "to unorm16",
        "to snorm8",
        "to float16",
    ]));
    wanted.extend(["integer table", "quantize", "wave triangle", "wave saw"].map(str::to_owned));
    wanted.push("single true, levels 1".to_owned());
    wanted.extend((1..=3).map(|levels| format!("single false, levels {levels}")));
    wanted.extend(FilterRule::ALL.map(|rule| format!("interpolate {}", rule.name())));
    for input in ["bytes", "words"] {
        wanted.extend(Overflow::ALL.map(|o| format!("integer of {input} {}", o.name())));
        wanted.extend(SumOrder::ALL.map(|sum| format!("half of {input} {}", sum.name())));
    }
    wanted.extend(SumOrder::ALL.map(|sum| format!("half of halves {}", sum.name())));
    for grid in [0, 1] {
        wanted.extend(Sampling::ALL.map(|s| format!("grid {grid} {}", s.name())));
    }
    let missing: Vec<String> = wanted.into_iter().filter(|w| !seen.contains(w)).collect();
    assert!(missing.is_empty(), "{missing:?}");
}

#[test]
fn every_kind_of_small_asset_decodes_as_specified() {
    let Some(gpu) = gpu() else { return };
    for (seed, asset, mut random) in small_assets() {
        let requests = sample(&asset, &mut random, 70);
        assert_agrees(&gpu, &asset, &requests, &format!("seed {seed}"));
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
    assert_agrees(&gpu, &asset, &[(0, 0, 0)], "one texel");
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
    assert_agrees(&gpu, &asset, &requests, "widest");

    let deep = vec![24; usize::from(limits::MAX_LAYERS) - 1];
    let small = shape(
        (19, 5),
        [(3, 3, 3), (5, 5, 2)],
        vec![OutputFormat::Unorm8; 3],
    );
    let mut recipe = Recipe::ordinary(small, deep);
    recipe.spans = vec![0, 1, 2, 3];
    for halves in [Halves::None, Halves::Some, Halves::All] {
        recipe.halves = halves;
        let asset = recipe.asset(&mut random);
        let requests = sample(&asset, &mut random, 100);
        assert_agrees(&gpu, &asset, &requests, &format!("deepest, {halves:?}"));
    }
}

#[test]
fn layers_of_several_passes_decode_as_specified() {
    let Some(gpu) = gpu() else { return };
    let mut random = Random(12);
    // One lane an iteration: a layer of 1024 × 1024 takes a quarter of a million of them.
    let small = shape(
        (6, 5),
        [(2, 4, 3), (3, 4, 3)],
        vec![OutputFormat::Float16; 3],
    );
    let mut recipe = Recipe::ordinary(small, vec![30, limits::MAX_LANES, limits::MAX_LANES, 999]);
    let saturating = Accumulator {
        bits: 24,
        overflow: Overflow::Saturate,
    };
    for (halves, sum, accumulator) in [
        (
            Halves::All,
            SumOrder::Sequential,
            Profile::NORMATIVE.accumulator,
        ),
        (Halves::All, SumOrder::Tree8, Profile::NORMATIVE.accumulator),
        (Halves::None, SumOrder::Sequential, saturating),
    ] {
        recipe.halves = halves;
        recipe.profile = Profile {
            sum,
            accumulator,
            ..Profile::NORMATIVE
        };
        let asset = recipe.asset(&mut random);
        let requests = sample(&asset, &mut random, 8);
        assert_agrees(&gpu, &asset, &requests, &format!("{halves:?}, {sum:?}"));
    }
}

#[test]
fn every_named_profile_decodes_as_specified() {
    let Some(gpu) = gpu() else { return };
    let mut random = Random(13);
    for named in NamedProfile::all().unwrap() {
        let outputs = OutputFormat::ALL.to_vec();
        let small = shape((33, 20), [(4, 8, 3), (6, 4, 2)], outputs);
        let mut recipe = Recipe::ordinary(small, vec![24, 24, 24, 24]);
        recipe.profile = named.profile;
        recipe.halves = Halves::Some;
        recipe.lane_bits = (4, 16);
        let asset = recipe.asset(&mut random);
        let requests = sample(&asset, &mut random, 70);
        assert_agrees(&gpu, &asset, &requests, &named.profile.identity());
    }
}

/// One texel whose grids have one cell: the inputs are these latents, one more of value zero, and
/// the level, which is 0 too. One layer makes the channels.
fn one_layer(
    latents: &[i32],
    profile: Profile,
    outputs: Vec<OutputFormat>,
    parameters: Parameters,
) -> Asset {
    let channels = latents.len() as u16;
    let mut shape = shape((1, 1), [(channels, 8, 3), (1, 8, 3)], outputs);
    shape.octaves = 0;
    // A value of an 8-bit latent is an input of nine bits.
    shape.input_bits = 9;
    shape.grids[0].sampling = Sampling::Interpolated;
    let format = shape.grids[0].format;
    let rows = shape.channel_count();
    let mut parts = Recipe::ordinary(shape.clone(), Vec::new())
        .asset(&mut Random(0))
        .into_parts();
    parts.grids = [
        latents.iter().map(|&value| format.code(value)).collect(),
        vec![format.code(0)],
    ];
    parts.profile = profile;
    parts.layers = vec![Layer {
        inputs: shape.input_count() as u16,
        outputs: rows,
        parameters,
        activation: Activation::Identity,
        skip: None,
    }];
    Asset::new(parts).unwrap()
}

#[test]
fn narrow_accumulators_give_the_sums_worked_out_by_hand() {
    let Some(gpu) = gpu() else { return };
    // 32000 + 127·100 − 127·100 + 127·5 in 16 bits.
    for (overflow, latents, expected) in [
        (Overflow::Saturate, [100, -100, 5], 32_767 - 12_700 + 635),
        (Overflow::Saturate, [-100, 100, 5], 32_635),
        (Overflow::Wrap, [100, -100, 5], 32_635),
        // 32000 + 12700 + 12700 − 65536 is negative: code 0.
        (Overflow::Wrap, [100, 100, 0], 0),
        (Overflow::Saturate, [100, 100, 0], 32_767),
    ] {
        let profile = Profile {
            accumulator: Accumulator { bits: 16, overflow },
            ..Profile::NORMATIVE
        };
        let parameters = Parameters::Integer(IntegerParameters {
            weight_bits: 8,
            weights: vec![127; 5],
            bias: vec![32_000],
            scales: vec![Multiplier::power_of_two(0)],
            output_bits: 8,
            zero_point: 0,
            table: Vec::new(),
        });
        let asset = one_layer(&latents, profile, vec![OutputFormat::Unorm16], parameters);
        let codes = Twin::on(&gpu, &asset).unwrap().mip(0).unwrap();
        assert_eq!(codes, [expected], "{overflow:?} {latents:?}");
    }
}

#[test]
fn fp16_sums_give_the_codes_worked_out_by_hand() {
    let Some(gpu) = gpu() else { return };
    let formats = OutputFormat::ALL.to_vec();
    // Two inputs of one half: latents of 128 are 128 / 2^8.
    let latents = [128, 128];
    // Bias, both weights; the codes as unorm8, unorm16, snorm8, float16.
    let cases = [
        // 1.
        (0x3c00, [0x0000; 2], [255, 65_535, 127, 0x3c00]),
        // 1/2: 127.5, 32767.5 and 63.5 are ties, and go to the even neighbour.
        (0x3800, [0x0000; 2], [128, 32_768, 64, 0x3800]),
        // −2 + 1/2 + 1/2.
        (0xc000, [0x3c00; 2], [0, 0, -127, 0xbc00]),
        // 65504 + 65504: the sum is exact in binary32, the half saturates.
        (0x7bff, [0x7bff; 2], [255, 65_535, 127, 0x7bff]),
        // 1/2 of the smallest half, twice: 2^-25 + 2^-25 is the smallest half again.
        (0x0000, [0x0001; 2], [0, 0, 0, 0x0001]),
        // −0 and products of −0 with a zero sum of +0 at the third input: the sum is +0.
        (0x8000, [0x8000; 2], [0, 0, 0, 0x0000]),
    ];
    for (bias, weights, expected) in cases {
        let weights = [weights[0], weights[1], 0, 0].map(Half::from_bits);
        let parameters = Parameters::Half(HalfParameters {
            weights: [weights; 4].concat(),
            bias: vec![Half::from_bits(bias); 4],
            quantize: None,
        });
        for sum in SumOrder::ALL {
            let profile = Profile {
                sum,
                ..Profile::NORMATIVE
            };
            let asset = one_layer(&latents, profile, formats.clone(), parameters.clone());
            let codes = Twin::on(&gpu, &asset).unwrap().mip(0).unwrap();
            // A fused step rounds to fp16: of two ties at half the smallest half the first goes to
            // zero, and so does the second.
            let is_tie = sum == SumOrder::Fused && weights[0].bits() == 1;
            let expected = if is_tie { [0; 4] } else { expected };
            assert_eq!(codes, expected, "{sum:?}, bias {bias:04x}");
        }
    }
}

#[test]
fn zeros_have_the_sign_that_the_order_of_the_sum_gives_them() {
    let Some(gpu) = gpu() else { return };
    // A bias of −0 and products of −0 and +0: every sum is −0, unless a short tree is filled with +0.
    for (latents, plus) in [
        // Four inputs and five, with the other grid's and the level.
        (vec![0; 2], vec![SumOrder::Tree8]),
        (vec![0; 3], vec![SumOrder::Tree4, SumOrder::Tree8]),
        (vec![0; 6], vec![]),
    ] {
        for sum in SumOrder::ALL {
            let minus_zero = Half::from_bits(0x8000);
            let parameters = Parameters::Half(HalfParameters {
                weights: vec![minus_zero; latents.len() + 2],
                bias: vec![minus_zero],
                quantize: None,
            });
            let profile = Profile {
                sum,
                ..Profile::NORMATIVE
            };
            let asset = one_layer(&latents, profile, vec![OutputFormat::Float16], parameters);
            let codes = Twin::on(&gpu, &asset).unwrap().mip(0).unwrap();
            let expected = if plus.contains(&sum) { 0 } else { 0x8000 };
            assert_eq!(codes, [expected], "{sum:?}, {} latents", latents.len());
        }
    }
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
