//! Claims about whole synthesizers: integer and fp16 layers, mixed.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
#![allow(dead_code, reason = "the fixture serves several tests")]

mod fixture;
mod naive;

use fixture::{
    PLAIN, Random, asset, half, integer, power, quantized, taps, with_integer, with_skip,
};
use ntmu_isa::accumulate::{Accumulator, Overflow};
use ntmu_isa::activation::Activation;
use ntmu_isa::half::SumOrder;
use ntmu_isa::layer::Quantize;
use ntmu_isa::profile::{NamedProfile, Profile};
use ntmu_isa::rescale::Requantizer;
use ntmu_isa::round::Rounding;
use ntmu_isa::shape::OutputFormat;
use std::collections::BTreeSet;

/// A profile of random choices, where a decode of layers makes one.
fn any_profile(random: &mut Random) -> Profile {
    let mut requantizer = || Requantizer::ALL[random.below(5) as usize];
    let (requantize, skip, output) = (requantizer(), requantizer(), requantizer());
    let mut rounding = || Rounding::ALL[random.below(4) as usize];
    let (input, leak, convert) = (rounding(), rounding(), rounding());
    Profile {
        input,
        accumulator: Accumulator {
            bits: random.within(16, 32) as u8,
            overflow: Overflow::ALL[random.below(2) as usize],
        },
        bias_bits: random.within(8, 32) as u8,
        leak,
        requantize,
        skip,
        residual_bits: random.within(8, 32) as u8,
        output,
        sum: SumOrder::ALL[random.below(4) as usize],
        convert,
        ..Profile::NORMATIVE
    }
}

#[test]
fn every_stage_of_random_assets_is_its_naive_evaluation() {
    let named = NamedProfile::all().unwrap();
    let mut random = Random(1);
    let mut seen = BTreeSet::new();
    for round in 0..4000 {
        let profile = match named.get(round % (2 * named.len())) {
            Some(named) => named.profile,
            None => any_profile(&mut random),
        };
        let asset = random.asset(profile);
        let found = taps(&asset);
        let (made, codes) = naive::run(&asset, &found.inputs);
        for (index, (tap, made)) in found.layers.iter().zip(&made).enumerate() {
            let at = format!(
                "asset {round}, layer {index}: {:?}",
                asset.layers[index].activation
            );
            assert_eq!(tap.accumulators, made.accumulators, "sums of {at}");
            assert_eq!(tap.activated, made.activated, "activation of {at}");
            assert_eq!(tap.outputs, made.outputs, "outputs of {at}");
            let layer = &asset.layers[index];
            seen.insert((
                layer.activation.name(),
                layer.half().is_some(),
                layer.skip.is_some(),
            ));
        }
        assert_eq!(found.layers.len(), made.len());
        assert_eq!(found.codes, codes, "asset {round}");
    }
    // Six activations of integer layers and five of fp16 layers, each with and without a skip path.
    assert_eq!(seen.len(), 2 * (6 + 5));
}

#[test]
fn int8_then_fp16_then_int16_then_int8_gives_the_numbers_worked_out_by_hand() {
    // Inputs: 100, −50, 0 (the level), real = value / 256.
    // l0, int8:  2·100 + 1·(−50) + 7 = 157, −3·100 + 4·(−50) + 0 = −500; ReLU 157, 0;
    //            / 2: 78.5 → 79 (ties up), 0; zero point −20: 59, −20.
    let first = with_integer(
        integer(
            &[&[2, 1, 5], &[-3, 4, 5]],
            &[7, 0],
            power(1),
            Activation::Relu,
        ),
        |p| p.zero_point = -20,
    );
    // l1, fp16: reads 79/128 and 0: 0.6171875 and 0. Sums: 2·0.6171875 − 3.25 = −2.015625,
    //            0.5·0.6171875 + 1 = 1.30859375. Leaky / 4: −0.50390625. To integers of 16 bits,
    //            · 2^10 and ties to even: −516, 1340; about −5: −521, 1335.
    let second = quantized(
        half(
            &[&[2.0, 1.0], &[0.5, -8.0]],
            &[-3.25, 1.0],
            Activation::Leaky { shift: 2 },
        ),
        Quantize {
            bits: 16,
            exponent: 10,
            zero_point: -5,
        },
    );
    // l2, int16: 100·(−521) + 127·1335 + 3 = 117448, −128·(−521) − 1·1335 + 0 = 65353.
    //            / 8: 14681, 8169.125 → 8169. Skip from l1, · ½: (−521 + 5)/2 = −258,
    //            (1335 + 5)/2 = 670. Zero point 11: 14434, 8850.
    let third = with_skip(
        with_integer(
            integer(
                &[&[100, 127], &[-128, -1]],
                &[3, 0],
                power(3),
                Activation::Identity,
            ),
            |p| {
                p.output_bits = 16;
                p.zero_point = 11;
            },
        ),
        1,
        power(1),
    );
    // l3: 1·14434 − 2·8850 + 4000 = 734, 3·14434 + 0·8850 − 40000 = 3302. / 4: 183.5 → 184;
    //            825.5 → 826, which saturates at 255.
    let last = integer(
        &[&[1, -2], &[3, 0]],
        &[4000, -40_000],
        power(2),
        Activation::Identity,
    );
    let asset = asset(
        &[100, -50],
        PLAIN,
        Profile::NORMATIVE,
        vec![first, second, third, last],
        &[OutputFormat::Unorm8; 2],
    );
    let found = taps(&asset);
    assert_eq!(found.inputs, [100, -50, 0]);
    let bits = |numbers: [f32; 2]| numbers.map(|x| x.to_bits() as i32).to_vec();
    let expected = [
        (vec![157, -500], vec![157, 0], vec![59, -20]),
        (
            bits([-2064.0 / 1024.0, 1340.0 / 1024.0]),
            bits([-516.0 / 1024.0, 1340.0 / 1024.0]),
            vec![-521, 1335],
        ),
        (
            vec![117_448, 65_353],
            vec![117_448, 65_353],
            vec![14_434, 8850],
        ),
        (vec![734, 3302], vec![734, 3302], vec![]),
    ];
    for (tap, (accumulators, activated, outputs)) in found.layers.iter().zip(expected) {
        assert_eq!(tap.accumulators, accumulators);
        assert_eq!(tap.activated, activated);
        assert_eq!(tap.outputs, outputs);
    }
    assert_eq!(found.codes, [184, 255]);
}
