//! The synthesizer of an asset, layer by layer, from its definition: without a program, registers,
//! or the host's floats. Requantisers and the layers' own table of activations are `isa`'s, where
//! they have tests of their own.

pub(crate) mod float;

use float::Float;
use ntmu_isa::Asset;
use ntmu_isa::accumulate::{Accumulator, Overflow};
use ntmu_isa::activation::{Activation, gate, gate_argument, leak, table_index};
use ntmu_isa::half::SumOrder;
use ntmu_isa::layer::{HalfParameters, IntegerParameters, Parameters};
use ntmu_isa::shape::{LaneFormat, OutputFormat};

/// What a layer makes; as in the model's taps.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Made {
    pub(crate) accumulators: Vec<i32>,
    pub(crate) activated: Vec<i32>,
    pub(crate) outputs: Vec<i16>,
}

/// bias + Σ weight·input, in the accumulator's width after every product.
pub(crate) fn accumulate(
    accumulator: Accumulator,
    bias: i32,
    weights: &[i8],
    inputs: &[i16],
) -> i32 {
    let one = 1_i128 << accumulator.bits;
    let (low, high) = (-one / 2, one / 2 - 1);
    let mut sum = i128::from(bias);
    for (&weight, &input) in weights.iter().zip(inputs) {
        sum += i128::from(weight) * i128::from(input);
        sum = match accumulator.overflow {
            Overflow::Saturate => sum.clamp(low, high),
            Overflow::Wrap => (sum - low).rem_euclid(one) + low,
        };
    }
    sum as i32
}

/// bias + Σ weight·input of halves, by their bits, in an order: an f32.
pub(crate) fn sum(order: SumOrder, bias: u16, weights: &[u16], inputs: &[u16]) -> Float {
    let mut products: Vec<Float> = weights
        .iter()
        .zip(inputs)
        .map(|(&w, &x)| Float::of_half(w).times(Float::of_half(x)))
        .collect();
    let bias = Float::of_half(bias);
    let add = |a: Float, b: Float| a.plus(b).rounded();
    let group = match order {
        SumOrder::Sequential => 1,
        SumOrder::Fused => {
            let step = |sum: Float, product| Float::of_half(sum.plus(product).nearest_half());
            return products.into_iter().fold(bias, step);
        }
        SumOrder::Tree4 => 4,
        SumOrder::Tree8 => 8,
    };
    let zero = Float::of_half(0);
    products.resize(products.len().next_multiple_of(group), zero);
    products.chunks(group).fold(bias, |sum, group| {
        let mut level = group.to_vec();
        while level.len() > 1 {
            level = level.chunks(2).map(|pair| add(pair[0], pair[1])).collect();
        }
        add(sum, level[0])
    })
}

/// An activation of an fp16 layer.
pub(crate) fn activate(activation: Activation, x: Float) -> Float {
    match activation {
        Activation::Identity | Activation::Table => x,
        Activation::Relu if x.sign() > 0 => x,
        Activation::Relu => Float::of_half(0),
        Activation::Leaky { shift } if x.sign() < 0 => x.times_power(-i32::from(shift)),
        Activation::Leaky { .. } => x,
        Activation::HardGelu { is_clamped, .. } => {
            let whole = |value| Float::of_integer(value, 0);
            let exceeds = |a: Float, limit: i64| a.plus(whole(-limit)).sign() > 0;
            let x = if is_clamped && exceeds(x, 3) {
                whole(3)
            } else {
                x
            };
            let six_gates = x.times_power(1).plus(whole(3)).rounded();
            let six_gates = match (six_gates.sign() < 0, exceeds(six_gates, 6)) {
                (true, _) => whole(0),
                (false, true) => whole(6),
                (false, false) => six_gates,
            };
            // The f32 nearest to 1/6 is 0xaaaaab / 2^26.
            let sixth = Float::of_integer(0x00aa_aaab, 26);
            x.times(six_gates).rounded().times(sixth).rounded()
        }
    }
}

/// An integer as its nearest half.
fn half_of(value: i16, format: LaneFormat) -> u16 {
    match format {
        LaneFormat::Half => value as u16,
        LaneFormat::Integer { bits, zero_point } => {
            let difference = i64::from(value) - i64::from(zero_point);
            Float::of_integer(difference, i32::from(bits) - 1).nearest_half()
        }
    }
}

/// Every layer of an asset, from its inputs, and the channel codes.
pub(crate) fn run(asset: &Asset, inputs: &[i16]) -> (Vec<Made>, Vec<i32>) {
    let mut made: Vec<Made> = Vec::new();
    let mut codes = Vec::new();
    for (index, layer) in asset.layers.iter().enumerate() {
        let input = index.checked_sub(1).map_or(inputs, |i| &made[i].outputs);
        let is_last = index + 1 == asset.layers.len();
        let stage = Stage {
            asset,
            index,
            input: input.to_vec(),
            skip: asset.skip_source(index).map(|i| made[i].outputs.clone()),
        };
        let (layer_made, emitted) = match &layer.parameters {
            Parameters::Integer(p) => stage.integer(p, is_last),
            Parameters::Half(p) => stage.half(p, is_last),
        };
        made.push(layer_made);
        codes = emitted;
    }
    (made, codes)
}

struct Stage<'a> {
    asset: &'a Asset,
    index: usize,
    input: Vec<i16>,
    skip: Option<Vec<i16>>,
}

impl Stage<'_> {
    fn integer(&self, p: &IntegerParameters, is_last: bool) -> (Made, Vec<i32>) {
        let (asset, profile) = (self.asset, &self.asset.profile);
        let layer = &asset.layers[self.index];
        let limits = |bits: u8| (-(1_i64 << (bits - 1)), (1_i64 << (bits - 1)) - 1);
        let (mut made, mut codes) = (Made::default(), Vec::new());
        for row in 0..usize::from(layer.outputs) {
            let weights = p.row(row, layer.inputs);
            let sum = accumulate(profile.accumulator, p.bias[row], weights, &self.input);
            let scale = p.scales[row];
            let rescale = |value| i64::from(profile.requantize.apply(value, scale));
            let (activated, value) = match layer.activation {
                Activation::Identity => (sum, rescale(sum)),
                Activation::Relu => (sum.max(0), rescale(sum.max(0))),
                Activation::Leaky { shift } => {
                    let leaked = leak(sum, shift, profile.leak);
                    (leaked, rescale(leaked))
                }
                Activation::HardGelu {
                    scale: out,
                    is_clamped,
                } => {
                    let product = gate(gate_argument(sum, scale, profile.requantize, is_clamped));
                    (product, i64::from(profile.requantize.apply(product, out)))
                }
                Activation::Table => {
                    let entry = p.table[table_index(sum, scale, profile.requantize)];
                    (i32::from(entry), i64::from(entry))
                }
            };
            made.accumulators.push(sum);
            made.activated.push(activated);
            if is_last {
                let format = asset.shape.outputs[row];
                let (low, high) = format.range();
                codes.push(match format {
                    OutputFormat::Float16 => {
                        let real = Float::of_integer(i64::from(sum), i32::from(scale.shift()));
                        let mantissa = Float::of_integer(i64::from(scale.mantissa()), 0);
                        i32::from(real.times(mantissa).nearest_half())
                    }
                    OutputFormat::Unorm8 | OutputFormat::Unorm16 | OutputFormat::Snorm8 => {
                        profile.output.apply(sum, scale).clamp(low, high)
                    }
                });
                continue;
            }
            let term = self.skip.as_ref().map_or(0, |source| {
                let from = asset.skip_source(self.index).unwrap();
                let LaneFormat::Integer { zero_point, .. } = asset.layers[from].output_format()
                else {
                    panic!("halves into integers")
                };
                let real = i32::from(source[row]) - i32::from(zero_point);
                let (low, high) = limits(profile.residual_bits);
                let scale = layer.skip.unwrap().scale;
                i64::from(profile.skip.apply(real, scale)).clamp(low, high)
            });
            let (low, high) = limits(p.output_bits);
            let output = value + term + i64::from(p.zero_point);
            made.outputs.push(output.clamp(low, high) as i16);
        }
        (made, codes)
    }

    fn half(&self, p: &HalfParameters, is_last: bool) -> (Made, Vec<i32>) {
        let (asset, profile) = (self.asset, &self.asset.profile);
        let layer = &asset.layers[self.index];
        let format = asset.input_format(self.index);
        let input: Vec<u16> = self.input.iter().map(|&x| half_of(x, format)).collect();
        let (mut made, mut codes) = (Made::default(), Vec::new());
        for row in 0..usize::from(layer.outputs) {
            let weights: Vec<u16> = p.row(row, layer.inputs).iter().map(|w| w.bits()).collect();
            let sum = sum(profile.sum, p.bias[row].bits(), &weights, &input);
            let activated = activate(layer.activation, sum);
            made.accumulators.push(sum.bits() as i32);
            made.activated.push(activated.bits() as i32);
            if is_last {
                let format = asset.shape.outputs[row];
                let (low, high) = format.range();
                codes.push(match format {
                    OutputFormat::Float16 => i32::from(activated.nearest_half()),
                    OutputFormat::Unorm8 | OutputFormat::Unorm16 | OutputFormat::Snorm8 => {
                        let code = activated.integer(high, profile.convert);
                        code.clamp(i64::from(low), i64::from(high)) as i32
                    }
                });
                continue;
            }
            let total = match &self.skip {
                None => activated,
                Some(source) => activated.plus(Float::of_half(source[row] as u16)).rounded(),
            };
            made.outputs.push(match p.quantize {
                None => total.nearest_half() as i16,
                Some(quantize) => {
                    let scaled = total.times_power(i32::from(quantize.exponent));
                    let value = scaled.integer(1, profile.convert) + i64::from(quantize.zero_point);
                    let high = (1_i64 << (quantize.bits - 1)) - 1;
                    value.clamp(-high - 1, high) as i16
                }
            });
        }
        (made, codes)
    }
}
