//! The oracle by hand: one texel whose every number is worked out in the comments.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use ntmu_conformance::bound::{typical, worst};
use ntmu_conformance::synthetic::{corners, interpolated};
use ntmu_conformance::{Device, ModelDevice, Oracle};
use ntmu_isa::Asset;
use ntmu_isa::activation::Activation;
use ntmu_isa::asset::{Encoding, Map, Metadata, Parts};
use ntmu_isa::half::Half;
use ntmu_isa::layer::{HalfParameters, IntegerParameters, Layer, Parameters, Quantize, Skip};
use ntmu_isa::profile::Profile;
use ntmu_isa::rescale::Multiplier;
use ntmu_isa::shape::{OutputFormat, Shape};
use ntmu_model::Request;

fn layer(inputs: u16, weights: &[i8], bias: &[i32], scale: Multiplier, zero_point: i16) -> Layer {
    Layer {
        inputs,
        outputs: bias.len() as u16,
        parameters: Parameters::Integer(IntegerParameters {
            weight_bits: 8,
            weights: weights.to_vec(),
            bias: bias.to_vec(),
            scales: vec![scale; bias.len()],
            output_bits: 8,
            zero_point,
            table: Vec::new(),
        }),
        activation: Activation::Identity,
        skip: None,
    }
}

/// 16×8 texels, two mips, grids of one channel and 2×1 cells, one octave.
fn by_hand() -> Asset {
    let half = Multiplier::power_of_two(1);
    // 3/8 = 3·2^29 / 2^32.
    let three_eighths = Multiplier::new(3 << 29, 32).expect("normalised");
    let mut first = layer(
        10,
        &[[1; 10], [-1; 10]].concat(),
        &[-4, 4],
        three_eighths,
        -128,
    );
    first.activation = Activation::Relu;
    let mut second = layer(2, &[1, 0, 0, 1], &[128, 128], half, 0);
    second.skip = Some(Skip {
        span: 1,
        scale: Multiplier::power_of_two(2),
    });
    let third = layer(2, &[2, 3], &[7], Multiplier::power_of_two(0), 0);
    Asset::new(Parts {
        shape: Shape {
            mip_count: 2,
            octaves: 1,
            ..Shape::whole_chain(
                16,
                8,
                [corners(1, 4, 3), interpolated(1, 4, 3)],
                vec![OutputFormat::Unorm8],
            )
        },
        profile: Profile::NORMATIVE,
        // Values 8 and −4 sixteenths; 0 and 8 sixteenths.
        grids: [vec![15, 3], vec![7, 15]],
        layers: vec![first, second, third],
        metadata: Metadata {
            name: "by hand".into(),
            maps: vec![Map {
                name: "grey".into(),
                first_channel: 0,
                channel_count: 1,
                encoding: Encoding::Linear,
                bit_depth: 8,
            }],
            record: vec![],
        },
    })
    .expect("a valid asset")
}

/// Texel (5, 0) of mip 0.
///
/// * x: g = 5.5/8 − ½ = 3/16: first corner 0, 3/16 in. y: g = 1/16 − ½ = −7/16: first corner −1,
///   which wraps to the only row, 9/16 in. So both rows are the same row.
/// * Grid 0: left 8/16 → 64/128, right −4/16 → −32/128.
/// * Grid 1: 13/16·0 + 3/16·½ = 3/32 → 12/128.
/// * Waves: x is 11/16 of a tile: 4·3/16 − 1 = −¼ → −32; a quarter on, 15/16: ¾ → 96. y is 1/16:
///   4·7/16 − 1 = ¾ → 96; a quarter on, 5/16: −¼ → −32. Level of mip 0: 0.
const INPUTS: [f64; 10] = [
    64.0, -32.0, 64.0, -32.0, 12.0, -32.0, 96.0, 96.0, -32.0, 0.0,
];

#[test]
fn the_oracle_gives_the_texel_worked_out_by_hand() {
    let asset = by_hand();
    let oracle = Oracle::new(&asset);
    let request = Request::new(&asset.shape, 5, 0, 0).unwrap();
    let taps = oracle.taps(request);
    assert_eq!(taps.inputs, INPUTS);
    // The inputs add up to 204.
    assert_eq!(taps.layers[0].accumulators, [200.0, -200.0]);
    assert_eq!(taps.layers[0].activated, [200.0, 0.0]);
    // 200·3/8 − 128 and 0 − 128.
    assert_eq!(taps.layers[0].outputs, [-53.0, -128.0]);
    assert_eq!(taps.layers[1].accumulators, [75.0, 0.0]);
    // 75/2 + (−53 + 128)/4 and 0 + 0.
    assert_eq!(taps.layers[1].outputs, [56.25, 0.0]);
    // 2·56.25 + 3·0 + 7.
    assert_eq!(taps.layers[2].accumulators, [119.5]);
    assert_eq!(taps.channels, [119.5]);
    assert_eq!(oracle.texel(request), [119.5]);
    assert_eq!(oracle.mip(0)[5], 119.5);
}

#[test]
fn the_model_rounds_the_same_texel_to_the_code_worked_out_by_hand() {
    let asset = by_hand();
    let request = Request::new(&asset.shape, 5, 0, 0).unwrap();
    // Ties up: 37.5 → 38, 18.75 → 19, so 57; 2·57 + 7 = 121.
    assert_eq!(
        ModelDevice.texel_codes(&asset, &[request]),
        Ok(vec![vec![121]])
    );
}

#[test]
fn the_level_of_the_last_mip_is_the_largest_input_and_texels_of_mip_1_cover_four() {
    let asset = by_hand();
    let oracle = Oracle::new(&asset);
    // Texel (2, 0) of mip 1: x is (2.5)·2/8 = 5/8 of a tile, g = 1/8: 2/16 in.
    let inputs = oracle.inputs(Request::new(&asset.shape, 2, 0, 1).unwrap());
    // 2/16·½·128 = 8; 4·1/8 − 1 = −½ → −64, 7/8: ½ → 64; y is 1/8: ½ → 64, 3/8: −½ → −64.
    assert_eq!(inputs[4..], [8.0, -64.0, 64.0, 64.0, -64.0, 127.0]);
}

/// What the float terms of a bound add: at most 10 inputs · 10·128 · 2^−51 = 5.7e-12 in the first
/// layer's sums, and less than that in all that follows.
const FLOAT: f64 = 1e-11;

#[test]
fn the_worst_case_of_the_texel_is_the_one_worked_out_by_hand() {
    let asset = by_hand();
    let oracle = Oracle::new(&asset);
    let taps = oracle.taps(Request::new(&asset.shape, 5, 0, 0).unwrap());
    // Latents of four bits drop five bits in an interpolation: ½ on lane 4. The level: ½.
    // Layer 0, row 0: (½ + ½)·3/8 + ½ = 7/8. Row 1 stays shut: −200 + 1 is below zero.
    // Layer 1, row 0: 7/8·½ + ½ and on the skip path 7/8·¼ + ½: 53/32. Row 1: exact.
    // Channel: 2·53/32 + ½ = 61/16.
    let bound = worst::texel(&oracle, &taps);
    assert!((bound[0] - 61.0 / 16.0).abs() < FLOAT, "{bound:?}");
    assert!(worst::asset(&asset)[0] >= bound[0]);
}

#[test]
fn the_typical_error_of_the_texel_is_the_one_worked_out_by_hand() {
    let asset = by_hand();
    let oracle = Oracle::new(&asset);
    let request = Request::new(&asset.shape, 5, 0, 0).unwrap();
    let taps = oracle.taps(request);
    // The inputs are integers here. Derivatives of the channel: 1 at its own rounding, 2 at each of
    // layer 1's two, 2·(½ + ¼) = 3/2 at layer 0's: (1 + 4 + 4 + 9/4) / 12.
    let square = typical::texel(&oracle, request, &taps);
    assert!((square[0] - 11.25 / 12.0).abs() < FLOAT, "{square:?}");
}

/// The same grids and texel, an fp16 layer that reads the inputs, one that gives integers, and an
/// integer layer with a table.
fn by_hand_mixed() -> Asset {
    let halves = |numbers: &[f32]| numbers.iter().map(|&n| Half::round(n)).collect::<Vec<_>>();
    let half = |inputs: u16, weights: &[f32], bias: &[f32], quantize| Layer {
        inputs,
        outputs: bias.len() as u16,
        parameters: Parameters::Half(HalfParameters {
            weights: halves(weights),
            bias: halves(bias),
            quantize,
        }),
        activation: Activation::Identity,
        skip: None,
    };
    let mut parts = by_hand().into_parts();
    let (mut up, mut down) = ([0.0; 10], [0.0; 10]);
    (up[0], up[1], down[6]) = (1.0, -2.0, 0.5);
    let mut first = half(10, &[up, down].concat(), &[0.25, -1.0], None);
    first.activation = Activation::Leaky { shift: 1 };
    let quantize = Quantize {
        bits: 6,
        exponent: 4,
        zero_point: 3,
    };
    let mut second = half(2, &[1.0, 0.0, 0.0, 1.0], &[0.0, 0.0], Some(quantize));
    second.skip = Some(Skip {
        span: 1,
        scale: Multiplier::power_of_two(0),
    });
    let mut third = layer(2, &[1, 0, 0, 2], &[0, 0], Multiplier::power_of_two(1), -1);
    third.activation = Activation::Table;
    if let Parameters::Integer(p) = &mut third.parameters {
        p.table = (0..256)
            .map(|index| (index - 128) * (index - 128) / 4)
            .collect();
    }
    let fourth = layer(2, &[1, 1], &[0], Multiplier::power_of_two(2), 0);
    parts.layers = vec![first, second, third, fourth];
    parts.shape.outputs = vec![OutputFormat::Float16];
    Asset::new(parts).expect("a valid asset")
}

#[test]
fn halves_tables_and_fp16_channels_are_those_worked_out_by_hand() {
    let asset = by_hand_mixed();
    let oracle = Oracle::new(&asset);
    let request = Request::new(&asset.shape, 5, 0, 0).unwrap();
    let taps = oracle.taps(request);
    // ½ + 2·¼ + ¼ and ¾/2 − 1; leaky, 2^−1.
    assert_eq!(taps.layers[0].accumulators, [1.25, -0.625]);
    assert_eq!(taps.layers[0].outputs, [1.25, -0.3125]);
    // Twice that with the skip path; 2.5·16 + 3 is above 31, −0.625·16 + 3 = −7.
    assert_eq!(taps.layers[1].outputs, [31.0, -7.0]);
    // Indices 15½ and −7: between 15²/4 = 56 and 16²/4 = 64; 12 and a zero point of −1.
    assert_eq!(taps.layers[2].activated, [60.0, 12.0]);
    assert_eq!(taps.layers[2].outputs, [59.0, 11.0]);
    // 70/4 = 17.5, in steps of 2^−10.
    assert_eq!(taps.channels, [17.5 * 1024.0]);
    // The model takes the entry of 16: (63 + 11)/4 = 18.5 = 0x4ca0.
    let codes = ModelDevice.texel_codes(&asset, &[request]);
    assert_eq!(codes, Ok(vec![vec![0x4ca0]]));
    let bound = worst::texel(&oracle, &taps)[0];
    // Row 0: 31 is saturated and exact, its index one of 15 and 16: 4 off. Row 1: half a step of fp16
    // at 0.3125, twice, times 16, and the rounding to an integer: 0.504 off; its index, with its own
    // rounding, one of −8 to −6: 4 off. So 8/4, and half a step of fp16 around 19.5, 2^−7.
    let expected = 1024.0 * (2.0 + 2_f64.powi(-7));
    assert!((bound - expected).abs() < 1e-6, "{bound}");
}
