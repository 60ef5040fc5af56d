//! Claims about the sums of both kinds of layers: their order, and what narrow ones do.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
#![allow(dead_code, reason = "the fixture serves several tests")]

mod fixture;
mod naive;

use fixture::{PLAIN, Random, asset, half, integer, power, taps};
use ntmu_isa::accumulate::{Accumulator, Overflow};
use ntmu_isa::activation::Activation;
use ntmu_isa::half::{Half, SumOrder};
use ntmu_isa::layer::{HalfParameters, Layer, Parameters};
use ntmu_isa::profile::Profile;
use ntmu_isa::shape::OutputFormat;

/// The sum of an fp16 layer of one row whose register holds `inputs`, as the bits of an f32: the
/// biases of a layer before it put them there.
fn half_sum(order: SumOrder, bias: Half, weights: Vec<Half>, inputs: Vec<Half>) -> u32 {
    let count = inputs.len() as u16;
    let layer = |inputs, weights, bias: Vec<Half>| Layer {
        inputs,
        outputs: bias.len() as u16,
        parameters: Parameters::Half(HalfParameters {
            weights,
            bias,
            quantize: None,
        }),
        activation: Activation::Identity,
        skip: None,
    };
    let first = layer(3, vec![Half::ZERO; 3 * usize::from(count)], inputs);
    let second = layer(count, weights, vec![bias]);
    let profile = Profile {
        sum: order,
        ..Profile::NORMATIVE
    };
    let asset = asset(
        &[0, 0],
        PLAIN,
        profile,
        vec![first, second],
        &[OutputFormat::Float16],
    );
    taps(&asset).layers[1].accumulators[0] as u32
}

#[test]
fn f32_additions_are_ieee_and_in_the_order_of_the_profile() {
    let mut random = Random(2);
    // Every length up to three groups of eight, and the longest.
    for length in (1..=24).chain([100, 1023, 1024]) {
        for _ in 0..8 {
            let mut halves = |count| (0..count).map(|_| random.half()).collect::<Vec<Half>>();
            // A register never holds −0 here: 0·weight + −0 is +0 in the layer before.
            let inputs = halves(length).into_iter();
            let inputs: Vec<Half> = inputs
                .map(|x| if x.bits() == 0x8000 { Half::ZERO } else { x })
                .collect();
            let (weights, bias) = (halves(length), halves(1)[0]);
            let bits = |halves: &[Half]| halves.iter().map(|h| h.bits()).collect::<Vec<u16>>();
            for order in SumOrder::ALL {
                let expected = naive::sum(order, bias.bits(), &bits(&weights), &bits(&inputs));
                let found = half_sum(order, bias, weights.clone(), inputs.clone());
                assert_eq!(found, expected.bits(), "{} of {length}", order.name());
            }
        }
    }
}

#[test]
fn orders_give_the_sums_worked_out_by_hand() {
    // 2^24 + 1 + 1 + 1 + 1. One by one each 1 is a tie that goes back to 2^24. In fours:
    // (2^24 + 1 → 2^24) + (1 + 1) = 2^24 + 2, then + 1 is a tie that goes to 2^24 + 4. In eights the
    // last 1 meets three zeros first: the same. In fp16 the first product saturates.
    let halves: Vec<Half> = [4096.0, 1.0, 1.0, 1.0, 1.0].map(Half::round).to_vec();
    let sums =
        SumOrder::ALL.map(|order| half_sum(order, Half::ZERO, halves.clone(), halves.clone()));
    let expected = [16_777_216.0_f32, 65_504.0, 16_777_220.0, 16_777_220.0];
    assert_eq!(sums, expected.map(f32::to_bits));
    // 2048 + 1 + 1: in fp16 each 1 is a tie that goes back to 2048; in f32 nothing is lost.
    let inputs: Vec<Half> = [2048.0, 1.0, 1.0].map(Half::round).to_vec();
    let sums =
        SumOrder::ALL.map(|order| half_sum(order, Half::ZERO, vec![Half::ONE; 3], inputs.clone()));
    assert_eq!(sums, [2050.0_f32, 2048.0, 2050.0, 2050.0].map(f32::to_bits));
}

#[test]
fn a_narrow_accumulator_saturates_in_order_and_wraps_in_any() {
    let sum = |overflow, values: [i32; 3]| {
        let profile = Profile {
            accumulator: Accumulator { bits: 16, overflow },
            ..Profile::NORMATIVE
        };
        let last = integer(
            &[&[127, 127, 127, 0]],
            &[32_000],
            power(0),
            Activation::Identity,
        );
        let asset = asset(&values, PLAIN, profile, vec![last], &[OutputFormat::Unorm8]);
        taps(&asset).layers[0].accumulators[0]
    };
    // 32000 + 12700 stays at 32767; − 12700 + 635.
    assert_eq!(sum(Overflow::Saturate, [100, -100, 5]), 20_702);
    assert_eq!(sum(Overflow::Saturate, [-100, 100, 5]), 32_635);
    assert_eq!(sum(Overflow::Wrap, [100, -100, 5]), 32_635);
    // 32000 + 635 + 12700 is 45335, 65536 more than −20201.
    assert_eq!(sum(Overflow::Wrap, [5, 100, 0]), -20_201);
    assert_eq!(sum(Overflow::Saturate, [5, 100, 0]), 32_767);
}

#[test]
fn accumulators_of_every_width_are_summed_product_by_product() {
    let mut random = Random(3);
    for (bits, overflow) in (16..=32).flat_map(|bits| Overflow::ALL.map(|o| (bits, o))) {
        let accumulator = Accumulator { bits, overflow };
        let profile = Profile {
            accumulator,
            ..Profile::NORMATIVE
        };
        for _ in 0..20 {
            let values: Vec<i32> = (0..120).map(|_| random.within(-127, 128)).collect();
            let rows: Vec<Vec<i8>> = (0..8)
                .map(|_| (0..121).map(|_| random.signed(8) as i8).collect())
                .collect();
            let rows: Vec<&[i8]> = rows.iter().map(Vec::as_slice).collect();
            let bias: Vec<i32> = (0..8).map(|_| random.signed(bits)).collect();
            let last = integer(&rows, &bias, power(0), Activation::Identity);
            // Inputs of 16 bits fill 31 bits of an accumulator.
            let asset = asset(&values, 16, profile, vec![last], &[OutputFormat::Unorm8; 8]);
            let found = taps(&asset);
            for (row, weights) in rows.iter().enumerate() {
                let expected = naive::accumulate(accumulator, bias[row], weights, &found.inputs);
                assert_eq!(
                    found.layers[0].accumulators[row],
                    expected,
                    "{bits} {}",
                    overflow.name()
                );
            }
        }
    }
}

#[test]
fn a_rescaled_skip_term_saturates_at_the_residual_bits() {
    // l0: the latent; l1: 0 · l0, plus 8 · l0 limited to 8 bits.
    for value in -127..=128 {
        let layers = || {
            let plain = |p: &mut ntmu_isa::layer::IntegerParameters| p.output_bits = 16;
            let first = integer(&[&[1, 0, 0]], &[0], power(0), Activation::Identity);
            let second = integer(&[&[0]], &[0], power(0), Activation::Identity);
            let eight = ntmu_isa::rescale::Multiplier::nearest(8, 0).unwrap();
            let second = fixture::with_skip(fixture::with_integer(second, plain), 1, eight);
            let last = integer(&[&[1]], &[0], power(0), Activation::Identity);
            vec![fixture::with_integer(first, plain), second, last]
        };
        for residual_bits in [8, 9, 16, 32] {
            let profile = Profile {
                residual_bits,
                ..Profile::NORMATIVE
            };
            let asset = asset(
                &[value, 0],
                PLAIN,
                profile,
                layers(),
                &[OutputFormat::Unorm8],
            );
            let high = (1_i64 << (residual_bits - 1)) - 1;
            let expected = i64::from(8 * value).clamp(-high - 1, high) as i16;
            assert_eq!(taps(&asset).layers[1].outputs, [expected]);
        }
    }
}

#[test]
fn an_fp16_layer_reads_the_weights_that_its_row_holds() {
    // Powers of two show which weight met which input: Σ 2^(row − k) · (k + 1).
    let rows = [[1.0, 0.5, 0.25], [2.0, 1.0, 0.5]];
    let first = half(
        &[&[0.0; 3], &[0.0; 3], &[0.0; 3]],
        &[1.0, 2.0, 3.0],
        Activation::Identity,
    );
    let second = half(&[&rows[0], &rows[1]], &[0.0, 0.125], Activation::Identity);
    let asset = asset(
        &[0, 0],
        PLAIN,
        Profile::NORMATIVE,
        vec![first, second],
        &[OutputFormat::Float16; 2],
    );
    let expected = [2.75_f32, 5.625].map(|x| x.to_bits() as i32);
    assert_eq!(taps(&asset).layers[1].accumulators, expected);
}
