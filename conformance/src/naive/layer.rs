//! One layer, by its definition.

use super::float::Number;
use super::number::{divide, fits, limited, power, rescale, wrapped};
use super::{Overflow, Place};
use ntmu_isa::accumulate::Overflow as Rule;
use ntmu_isa::activation::Activation;
use ntmu_isa::half::SumOrder;
use ntmu_isa::layer::{HalfParameters, IntegerParameters, Layer};
use ntmu_isa::profile::Profile;
use ntmu_isa::rescale::Multiplier;
use ntmu_isa::shape::OutputFormat;

/// The accumulator of a row, and every width that it went beyond.
pub(super) fn accumulate(
    profile: &Profile,
    bias: i32,
    weights: &[i8],
    input: &[i128],
    place: Place,
    overflows: &mut Vec<Overflow>,
) -> i128 {
    let bits = profile.accumulator.bits;
    let mut sum = i128::from(bias);
    for (step, (&weight, &x)) in weights.iter().zip(input).enumerate() {
        let exact = sum + i128::from(weight) * x;
        if !fits(exact, bits) {
            overflows.push(Overflow::Accumulator { place, step });
        }
        sum = match profile.accumulator.overflow {
            Rule::Wrap => wrapped(exact, bits),
            Rule::Saturate => limited(exact, bits),
        };
    }
    sum
}

/// An integer layer's accumulator after its activation.
pub(super) fn activate(
    profile: &Profile,
    layer: &Layer,
    parameters: &IntegerParameters,
    row: usize,
    a: i128,
) -> i128 {
    let to_argument = || rescale(profile.requantize, a, parameters.scales[row]);
    match layer.activation {
        Activation::Identity => a,
        Activation::Relu => a.max(0),
        Activation::Leaky { shift } if a < 0 => divide(a, power(u32::from(shift)), profile.leak),
        Activation::Leaky { .. } => a,
        Activation::HardGelu { is_clamped, .. } => {
            let high = if is_clamped { 3 * 256 } else { 32_767 };
            let x = to_argument().clamp(-32_768, high);
            // Six times the gate: 6·(x/3 + ½), in 1/256.
            x * (2 * x + 3 * 256).clamp(0, 6 * 256)
        }
        Activation::Table => {
            let index = to_argument().clamp(-128, 127) + 128;
            let entry = parameters.table.get(index as usize);
            entry.map_or(0, |&entry| i128::from(entry))
        }
    }
}

/// The value that an integer layer writes to its register.
pub(super) fn output(
    profile: &Profile,
    layer: &Layer,
    parameters: &IntegerParameters,
    (row, a): (usize, i128),
    from: Option<i128>,
) -> i128 {
    let value = match layer.activation {
        Activation::Table => a,
        Activation::HardGelu { scale, .. } => rescale(profile.requantize, a, scale),
        Activation::Identity | Activation::Relu | Activation::Leaky { .. } => {
            rescale(profile.requantize, a, parameters.scales[row])
        }
    };
    let skip = layer.skip.zip(from).map_or(0, |(skip, from)| {
        limited(
            rescale(profile.skip, from, skip.scale),
            profile.residual_bits,
        )
    });
    let sum = value + skip + i128::from(parameters.zero_point);
    limited(sum, parameters.output_bits)
}

/// The code of an integer layer's channel.
pub(super) fn code(profile: &Profile, format: OutputFormat, scale: Multiplier, a: i128) -> i128 {
    match range(format) {
        Some((low, high)) => rescale(profile.output, a, scale).clamp(low, high),
        None => {
            let real = Number::integer(a).times(Number {
                magnitude: i128::from(scale.mantissa()),
                exponent: -i32::from(scale.shift()),
                ..Number::ZERO
            });
            i128::from(real.to_half().0.half_bits())
        }
    }
}

/// The codes of a format of integers.
fn range(format: OutputFormat) -> Option<(i128, i128)> {
    match format {
        OutputFormat::Unorm8 => Some((0, 255)),
        OutputFormat::Unorm16 => Some((0, 65_535)),
        OutputFormat::Snorm8 => Some((-127, 127)),
        OutputFormat::Float16 => None,
    }
}

/// The sum of a row of an fp16 layer.
pub(super) fn sum(
    profile: &Profile,
    bias: Number,
    products: &[Number],
    place: Place,
    overflows: &mut Vec<Overflow>,
) -> Number {
    match profile.sum {
        SumOrder::Sequential => products
            .iter()
            .fold(bias, |sum, &product| sum.plus(product).to_single()),
        SumOrder::Fused => {
            let mut sum = bias;
            for (step, &product) in products.iter().enumerate() {
                let (rounded, is_beyond) = sum.plus(product).to_half();
                if is_beyond {
                    overflows.push(Overflow::Half { place, step });
                }
                sum = rounded;
            }
            sum
        }
        SumOrder::Tree4 => trees(bias, products, 4),
        SumOrder::Tree8 => trees(bias, products, 8),
    }
}

/// Groups of products as balanced trees, filled with +0, added to the bias one after the other.
fn trees(bias: Number, products: &[Number], width: usize) -> Number {
    products.chunks(width).fold(bias, |sum, group| {
        let mut level = group.to_vec();
        level.resize(width, Number::ZERO);
        while level.len() > 1 {
            let pairs = level.chunks(2);
            level = pairs
                .map(|pair| pair[0].plus(pair[1]).to_single())
                .collect();
        }
        sum.plus(level[0]).to_single()
    })
}

/// An fp16 layer's sum after its activation.
pub(super) fn activate_half(layer: &Layer, sum: Number) -> Number {
    match layer.activation {
        Activation::Identity | Activation::Table => sum,
        Activation::Relu if sum.is_positive() => sum,
        Activation::Relu => Number::ZERO,
        Activation::Leaky { shift } if sum.is_below_zero() => Number {
            exponent: sum.exponent - i32::from(shift),
            ..sum
        },
        Activation::Leaky { .. } => sum,
        Activation::HardGelu { is_clamped, .. } => sum.hard_gelu(is_clamped),
    }
}

/// The value that an fp16 layer writes to its register: an integer, or the bits of a half, signed.
pub(super) fn output_half(
    profile: &Profile,
    parameters: &HalfParameters,
    activated: Number,
    from: Option<Number>,
) -> i128 {
    let sum = from.map_or(activated, |from| activated.plus(from).to_single());
    match parameters.quantize {
        None => wrapped(i128::from(sum.to_half().0.half_bits()), 16),
        Some(quantize) => {
            let value = sum.to_integer(1, i32::from(quantize.exponent), profile.convert);
            limited(value + i128::from(quantize.zero_point), quantize.bits)
        }
    }
}

/// The code of an fp16 layer's channel.
pub(super) fn code_half(profile: &Profile, format: OutputFormat, activated: Number) -> i128 {
    match range(format) {
        Some((low, high)) => activated
            .to_integer(high, 0, profile.convert)
            .clamp(low, high),
        None => i128::from(activated.to_half().0.half_bits()),
    }
}
