//! General: what follows the sums of a layer, lane by lane, by the rules of the specification.
//!
//! For profiles and scales that the fused kernels do not compute.

use ntmu_isa::Asset;
use ntmu_isa::accumulate::signed_range;
use ntmu_isa::activation::{self, Activation};
use ntmu_isa::half::{Half, to_integer};
use ntmu_isa::layer::{IntegerParameters, Layer, Quantize};
use ntmu_isa::profile::Profile;
use ntmu_isa::round::{Rounding, saturate};
use ntmu_isa::shape::{LaneFormat, OutputFormat};

/// One row of a hidden integer layer, from its accumulator and, where a skip path ends here, the
/// value that it starts from.
pub(super) fn hidden(
    asset: &Asset,
    index: usize,
    parameters: &IntegerParameters,
    row: usize,
    accumulator: i32,
    source: i32,
) -> i32 {
    let (layer, profile) = (&asset.layers[index], &asset.profile);
    let (scale, requantizer) = (parameters.scales[row], profile.requantize);
    let rescaled = match layer.activation {
        Activation::Identity => requantizer.apply(accumulator, scale),
        Activation::Relu => requantizer.apply(accumulator.max(0), scale),
        Activation::Leaky { shift } => {
            requantizer.apply(activation::leak(accumulator, shift, profile.leak), scale)
        }
        Activation::HardGelu {
            scale: after,
            is_clamped,
        } => {
            let argument = activation::gate_argument(accumulator, scale, requantizer, is_clamped);
            requantizer.apply(activation::gate(argument), after)
        }
        Activation::Table => {
            i32::from(parameters.table[activation::table_index(accumulator, scale, requantizer)])
        }
    };
    let mut value = i64::from(rescaled) + i64::from(parameters.zero_point);
    if let Some(skip) = layer.skip {
        let real = source - skip_zero(asset, index);
        let (low, high) = signed_range(profile.residual_bits);
        let term = profile.skip.apply(real, skip.scale);
        value += i64::from(saturate(i64::from(term), low, high));
    }
    let (low, high) = signed_range(parameters.output_bits);
    saturate(value, low, high)
}

/// The zero point of the register that a layer's skip path starts from.
pub(super) fn skip_zero(asset: &Asset, index: usize) -> i32 {
    let format = asset
        .skip_source(index)
        .map(|from| asset.layers[from].output_format());
    match format {
        Some(LaneFormat::Integer { zero_point, .. }) => i32::from(zero_point),
        Some(LaneFormat::Half) | None => 0,
    }
}

/// The channel code of one row of an integer layer, from its accumulator.
pub(super) fn output(
    profile: &Profile,
    parameters: &IntegerParameters,
    format: OutputFormat,
    row: usize,
    accumulator: i32,
) -> i32 {
    let scale = parameters.scales[row];
    let (low, high) = format.range();
    match format {
        OutputFormat::Unorm8 | OutputFormat::Unorm16 | OutputFormat::Snorm8 => {
            let code = profile.output.apply(accumulator, scale);
            saturate(i64::from(code), low, high)
        }
        OutputFormat::Float16 => {
            let product = i128::from(accumulator) * i128::from(scale.mantissa());
            i32::from(Half::from_fixed(product, u32::from(scale.shift())).bits())
        }
    }
}

/// A finished sum of an fp16 layer as an integer.
pub(super) fn quantize(rule: Quantize, rounding: Rounding, sum: f32) -> i32 {
    let (low, high) = signed_range(rule.bits);
    let value = to_integer(sum, 1, i32::from(rule.exponent), rounding);
    saturate(value + i64::from(rule.zero_point), low, high)
}

/// The channel code of one row of an fp16 layer, from its sum.
pub(super) fn half_output(format: OutputFormat, rounding: Rounding, sum: f32) -> i32 {
    let (low, high) = format.range();
    match format {
        OutputFormat::Unorm8 | OutputFormat::Unorm16 | OutputFormat::Snorm8 => {
            saturate(to_integer(sum, high as u16, 0, rounding), low, high)
        }
        OutputFormat::Float16 => i32::from(Half::round(sum).bits()),
    }
}

/// The weights and biases of an fp16 layer as the specification sums them.
pub(super) fn fused_row(layer: &Layer, row: usize, input: &[Half]) -> f32 {
    layer.half().map_or(0.0, |numbers| {
        let weights = numbers.row(row, layer.inputs);
        ntmu_isa::half::SumOrder::Fused.dot(numbers.bias[row], weights, input)
    })
}
