//! Dense: the sums of an integer layer.

use ntmu_isa::accumulate::{Accumulator, Overflow, wrap};
use ntmu_isa::layer::{IntegerParameters, Layer, Parameters};
use ntmu_isa::shape::LaneFormat;

/// A layer's weights as the datapath multiplies them. An fp16 layer has none here.
pub(super) struct Weights {
    /// Rows of 16-bit weights: x86 and Arm multiply and add pairs of these in one instruction.
    wide: Vec<i16>,
    /// Per row, whether its sum can be made in any order.
    is_free: Vec<bool>,
}

impl Weights {
    /// The weights of a layer that reads a register of `input`.
    pub(super) fn new(layer: &Layer, input: LaneFormat, accumulator: Accumulator) -> Weights {
        let (Parameters::Integer(parameters), LaneFormat::Integer { bits, .. }) =
            (&layer.parameters, input)
        else {
            return Weights {
                wide: Vec::new(),
                is_free: Vec::new(),
            };
        };
        let largest_input = 1_i64 << (bits - 1);
        let is_free = parameters
            .weights
            .chunks_exact(usize::from(layer.inputs))
            .zip(&parameters.bias)
            .map(|(row, &bias)| is_free(row, bias, largest_input, accumulator))
            .collect();
        Weights {
            wide: parameters.weights.iter().map(|&w| i16::from(w)).collect(),
            is_free,
        }
    }

    /// Bias plus products, k ascending.
    ///
    /// A free sum is made in the order that the compiler picks, which gives the same number.
    pub(super) fn dense(
        &self,
        parameters: &IntegerParameters,
        accumulator: Accumulator,
        input: &[i16],
        sums: &mut [i32],
    ) {
        let rows = self.wide.chunks_exact(input.len());
        for (row, ((sum, wide), &bias)) in
            sums.iter_mut().zip(rows).zip(&parameters.bias).enumerate()
        {
            *sum = if self.is_free[row] {
                let products = wide.iter().zip(input);
                let products = products.map(|(&w, &x)| i32::from(w) * i32::from(x));
                let sum = products.fold(bias, i32::wrapping_add);
                wrap(i64::from(sum), accumulator.bits)
            } else {
                let weights = parameters.row(row, input.len() as u16);
                accumulator.dot(bias, weights, input)
            };
        }
    }
}

/// Whether a row's sum does not depend on the order of its products.
///
/// Wrapping keeps a sum modulo 2^bits, where order never matters. A saturating accumulator is free
/// where even the largest inputs cannot fill it.
fn is_free(row: &[i8], bias: i32, largest_input: i64, accumulator: Accumulator) -> bool {
    match accumulator.overflow {
        Overflow::Wrap => true,
        Overflow::Saturate => {
            let weights: i64 = row.iter().map(|&w| i64::from(w).abs()).sum();
            let largest = i64::from(bias).abs() + weights * largest_input;
            largest <= i64::from(accumulator.range().1)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ntmu_isa::activation::Activation;
    use ntmu_isa::rescale::Multiplier;
    use proptest::prelude::*;

    fn layer(weights: Vec<i8>, bias: i32) -> Layer {
        Layer {
            inputs: weights.len() as u16,
            outputs: 1,
            parameters: Parameters::Integer(IntegerParameters {
                weight_bits: 8,
                weights,
                bias: vec![bias],
                scales: vec![Multiplier::power_of_two(0)],
                output_bits: 8,
                zero_point: 0,
                table: Vec::new(),
            }),
            activation: Activation::Identity,
            skip: None,
        }
    }

    fn sum(layer: &Layer, bits: u8, accumulator: Accumulator, input: &[i16]) -> (i32, bool) {
        let format = LaneFormat::Integer {
            bits,
            zero_point: 0,
        };
        let weights = Weights::new(layer, format, accumulator);
        let mut sums = [0];
        weights.dense(layer.integer().unwrap(), accumulator, input, &mut sums);
        (sums[0], weights.is_free[0])
    }

    #[test]
    fn a_saturating_row_is_free_exactly_up_to_the_end_of_its_accumulator() {
        let accumulator = Accumulator {
            bits: 16,
            overflow: Overflow::Saturate,
        };
        // 255·128 = 32640 leaves 127 for the bias.
        for (bias, expected) in [(127, true), (-127, true), (128, false), (-128, false)] {
            let layer = layer(vec![127, -128], bias);
            let (_, is_free) = sum(&layer, 8, accumulator, &[0, 0]);
            assert_eq!(is_free, expected, "bias {bias}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(2000) })]

        #[test]
        fn every_sum_is_the_sequential_one(
            weights in prop::collection::vec(any::<i8>(), 1..70),
            bits in 16..=32_u8,
            lane_bits in 4..=16_u8,
            bias: i32,
            seed: u64,
        ) {
            let bias = wrap(i64::from(bias), bits);
            let input: Vec<i16> = (0..weights.len() as u64)
                .map(|k| {
                    let random = (seed ^ k).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 20;
                    wrap(random as i64, lane_bits) as i16
                })
                .collect();
            for overflow in Overflow::ALL {
                let accumulator = Accumulator { bits, overflow };
                let layer = layer(weights.clone(), bias);
                let (found, _) = sum(&layer, lane_bits, accumulator, &input);
                prop_assert_eq!(found, accumulator.dot(bias, &weights, &input));
            }
        }
    }
}
