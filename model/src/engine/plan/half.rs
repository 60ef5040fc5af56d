//! The plan of an fp16 layer.

use crate::engine::kernel::{DenseHalf, HalfOrder, HalfStep, HalfToInteger};
use crate::engine::register::Held;
use ntmu_isa::Asset;
use ntmu_isa::accumulate::signed_range;
use ntmu_isa::activation::Activation;
use ntmu_isa::half::{Half, SumOrder};
use ntmu_isa::layer::{HalfParameters, Quantize};
use ntmu_isa::round::Rounding;
use ntmu_isa::shape::{LaneFormat, OutputFormat};

/// An fp16 layer, ready to run.
#[derive(Clone, Debug)]
pub(in crate::engine) struct HalfLayer {
    /// None where the specification sums lane by lane.
    pub(in crate::engine) dense: Option<DenseHalf>,
    pub(in crate::engine) inputs: usize,
    pub(in crate::engine) rows: usize,
    /// Where it reads integers: how they are held, their zero point, and the factor to reals.
    pub(in crate::engine) read: Option<(Held, i32, f32)>,
    pub(in crate::engine) step: HalfStep,
    pub(in crate::engine) result: HalfResult,
}

/// What becomes of the finished sums.
#[derive(Clone, Debug)]
pub(in crate::engine) enum HalfResult {
    /// fp16 values.
    Halves,
    /// Integers, by the kernels if their rounding is theirs.
    Integers(Held, Quantize, Option<HalfToInteger>),
    /// Channel codes, by the kernels where the rounding is theirs.
    Codes(Vec<Option<HalfToInteger>>),
}

impl HalfLayer {
    pub(super) fn new(asset: &Asset, index: usize, parameters: &HalfParameters) -> HalfLayer {
        let (layer, profile) = (&asset.layers[index], &asset.profile);
        let order = match profile.sum {
            SumOrder::Sequential => Some(HalfOrder::Sequential),
            SumOrder::Fused => None,
            SumOrder::Tree4 => Some(HalfOrder::Tree4),
            SumOrder::Tree8 => Some(HalfOrder::Tree8),
        };
        let numbers = |halves: &[Half]| halves.iter().map(|h| h.to_f32()).collect::<Vec<f32>>();
        let inputs = usize::from(layer.inputs);
        let (weights, bias) = (numbers(&parameters.weights), numbers(&parameters.bias));
        let format = asset.input_format(index);
        HalfLayer {
            dense: order.map(|order| DenseHalf::new(&weights, inputs, &bias, order)),
            inputs,
            rows: bias.len(),
            read: match format {
                LaneFormat::Integer { bits, zero_point } => {
                    let one = (1_u32 << (bits - 1)) as f32;
                    Some((Held::of(format), i32::from(zero_point), 1.0 / one))
                }
                LaneFormat::Half => None,
            },
            step: step(layer.activation),
            result: if index + 1 == asset.layers.len() {
                let formats = asset.shape.outputs.iter();
                HalfResult::Codes(formats.map(|&f| code_rule(f, profile.convert)).collect())
            } else {
                match parameters.quantize {
                    None => HalfResult::Halves,
                    Some(quantize) => {
                        let held = Held::of(layer.output_format());
                        let rule = quantize_rule(quantize, profile.convert);
                        HalfResult::Integers(held, quantize, rule)
                    }
                }
            },
        }
    }
}

fn step(activation: Activation) -> HalfStep {
    match activation {
        // A validated fp16 layer has no table.
        Activation::Identity | Activation::Table => HalfStep::Identity,
        Activation::Relu => HalfStep::Relu,
        Activation::Leaky { shift } => HalfStep::Leaky {
            slope: 1.0 / (1_u32 << shift) as f32,
        },
        Activation::HardGelu { is_clamped, .. } => HalfStep::Gate {
            limit: if is_clamped { 3.0 } else { f32::INFINITY },
        },
    }
}

/// The kernels round to the nearest, ties to even.
fn is_kernels(rounding: Rounding) -> bool {
    match rounding {
        Rounding::HalfEven => true,
        Rounding::HalfUp | Rounding::HalfAway | Rounding::Floor => false,
    }
}

fn quantize_rule(quantize: Quantize, rounding: Rounding) -> Option<HalfToInteger> {
    let (low, high) = signed_range(quantize.bits);
    is_kernels(rounding).then(|| HalfToInteger {
        factor: power_of_two(quantize.exponent),
        offset: i32::from(quantize.zero_point),
        low,
        high,
    })
}

fn code_rule(format: OutputFormat, rounding: Rounding) -> Option<HalfToInteger> {
    let (low, high) = format.range();
    let is_integer = match format {
        OutputFormat::Unorm8 | OutputFormat::Unorm16 | OutputFormat::Snorm8 => true,
        OutputFormat::Float16 => false,
    };
    (is_integer && is_kernels(rounding)).then(|| HalfToInteger {
        factor: f64::from(high),
        offset: 0,
        low,
        high,
    })
}

/// 2^`exponent`, exactly, which `exp2` does not promise.
fn power_of_two(exponent: i8) -> f64 {
    f64::from_bits(((1023 + i64::from(exponent)) as u64) << 52)
}
