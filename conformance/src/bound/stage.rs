//! Stage by stage: the admissible |model − oracle|, given the stage's own input.
//!
//! Positions, corners, codes and the sums of integer layers are exact. Each bound is one number per
//! lane, in LSB of the lane, or in units of one for halves and the sums of fp16 layers.

use super::float::{self, HALF, Partial, SINGLE, half_ulp};
use super::{float_error, gate_error, interpolation, requantize, rounding, table};
use crate::oracle::number::{HALF_UNITS, channel_units};
use crate::oracle::synthesizer::{bias, output_multiplier, reading, scale, weights};
use ntmu_isa::Asset;
use ntmu_isa::activation::Activation;
use ntmu_isa::layer::{HalfParameters, IntegerParameters, Layer, Parameters};
use ntmu_isa::rescale::{Multiplier, Requantizer};
use ntmu_isa::shape::{LaneFormat, OutputFormat};

/// The synthesizer's inputs, in units of 1/2^(bits − 1).
///
/// * Latents: see the profile's interpolation rule.
/// * A wave is a whole number of units, and so is a zero: exact.
/// * The level is one rounding to the nearest, whatever the profile says.
#[must_use]
pub fn inputs(asset: &Asset) -> Vec<f64> {
    let shape = &asset.shape;
    let mut bounds = Vec::new();
    for grid in shape.grids {
        let bound = interpolation::bound(grid, &asset.profile, shape.input_bits);
        bounds.extend(vec![bound; usize::from(grid.input_count())]);
    }
    bounds.extend(vec![0.0; usize::from(shape.wave_count())]);
    bounds.push(if shape.mip_count > 1 {
        0.5 + float_error(2_f64.powi(i32::from(shape.input_bits)))
    } else {
        0.0
    });
    bounds.extend(vec![0.0; usize::from(shape.padding)]);
    bounds
}

/// The sums of a layer, given the register that it reads. Those of an integer layer are exact; those
/// of an fp16 layer are rounded where the terms need more bits than f32 (or fp16, if it is fused)
/// has, and where an integer of its input needs more than fp16 has.
#[must_use]
pub fn accumulators(asset: &Asset, layer: usize, input: &[f64]) -> Vec<f64> {
    let parameters = &asset.layers[layer];
    let rows = 0..usize::from(parameters.outputs);
    if parameters.half().is_none() {
        return vec![0.0; rows.len()];
    }
    let lanes: Vec<Partial> = input
        .iter()
        .map(|&value| read(parameters, asset.input_format(layer), (value, value), 0.0))
        .collect();
    rows.map(|row| sum(asset, layer, row, &weights(parameters, row), &lanes).error)
        .collect()
}

/// A lane as an fp16 layer reads it: reals in `low..=high` of the register, moved by at most
/// `radius` there.
#[must_use]
pub fn read(layer: &Layer, input: LaneFormat, (low, high): (f64, f64), radius: f64) -> Partial {
    let (zero_point, one) = reading(layer, input).unwrap_or((0.0, 1.0));
    let real = ((low - zero_point) / one, (high - zero_point) / one);
    let magnitude = real.0.abs().max(real.1.abs()) + radius / one;
    let is_known = low == high && radius == 0.0;
    let grain = match input {
        _ if is_known => float::grain(real.0),
        LaneFormat::Integer { .. } => 1.0 / one,
        LaneFormat::Half => 2_f64.powi(HALF.last),
    };
    let is_exact = input == LaneFormat::Half || magnitude <= grain * 2_f64.powi(HALF.bits);
    let rounding = if is_exact {
        0.0
    } else {
        half_ulp(magnitude, HALF)
    };
    Partial {
        real,
        error: radius / one + rounding,
        variance: rounding * rounding / 3.0,
        // A rounding only makes it coarser.
        grain,
        largest: magnitude + rounding,
    }
}

/// The sum of a row of an fp16 layer, with all that happens to it on the way.
#[must_use]
pub fn sum(asset: &Asset, layer: usize, row: usize, weights: &[f64], lanes: &[Partial]) -> Partial {
    let products = lanes.iter().zip(weights).map(|(lane, &w)| lane.times(w));
    let bias = bias(&asset.layers[layer], row);
    float::dot(asset.profile.sum, bias, products)
}

/// The activated accumulators of a layer, given its accumulators.
///
/// Identity and ReLU are exact, and so is the leak of an fp16 layer. That of an integer layer rounds
/// what is negative and drops n bits. A hard GELU of an integer layer rounds its argument; its product
/// then moves by as much as the gate does between the two arguments, and the gate itself is exact. A
/// table takes the entry of a rounded index.
#[must_use]
pub fn activated(asset: &Asset, layer: usize, accumulators: &[f64]) -> Vec<f64> {
    let parameters = &asset.layers[layer];
    let rows = accumulators.iter().enumerate();
    rows.map(|(row, &a)| match &parameters.parameters {
        Parameters::Integer(p) => activated_integer(asset, parameters, p, (row, a)),
        Parameters::Half(_) => match parameters.activation {
            Activation::Identity
            | Activation::Relu
            | Activation::Leaky { .. }
            | Activation::Table => 0.0,
            Activation::HardGelu { is_clamped, .. } => {
                float::gelu_error(if is_clamped { a.min(3.0) } else { a })
            }
        },
    })
    .collect()
}

fn activated_integer(
    asset: &Asset,
    layer: &Layer,
    parameters: &IntegerParameters,
    (row, a): (usize, f64),
) -> f64 {
    let multiplier = parameters.scales[row];
    let requantizer = asset.profile.requantize;
    match layer.activation {
        Activation::Identity | Activation::Relu => 0.0,
        Activation::Leaky { shift } if a < 0.0 => rounding(asset.profile.leak, u32::from(shift)),
        Activation::Leaky { .. } => 0.0,
        Activation::HardGelu { is_clamped, .. } => {
            let argument = a * scale(multiplier);
            let moved = one(requantizer, a, multiplier) + float_error(argument);
            // A product is at most 32768·1536 < 2^26.
            gate_error(argument, moved, is_clamped) + float_error(2_f64.powi(26))
        }
        Activation::Table => {
            let index = a * scale(multiplier);
            let moved = one(requantizer, a, multiplier);
            table::error(&parameters.table, (index, index), moved) + float_error(2_f64.powi(17))
        }
    }
}

/// The output of a hidden layer, given its activated accumulators and the values at the start of
/// its skip path. An integer layer: one rescaling, unless it has a table, and a second one on the skip path. An
/// fp16 layer: the addition of the skip path in f32, then the rounding to its register. What is
/// exactly zero stays so.
#[must_use]
pub fn outputs(asset: &Asset, layer: usize, activated: &[f64], source: Option<&[f64]>) -> Vec<f64> {
    let parameters = &asset.layers[layer];
    let source = source.filter(|_| parameters.skip.is_some());
    let zero_point =
        asset
            .skip_source(layer)
            .map_or(0.0, |from| match asset.layers[from].output_format() {
                LaneFormat::Integer { zero_point, .. } => f64::from(zero_point),
                LaneFormat::Half => 0.0,
            });
    let rows = activated.iter().enumerate();
    rows.map(|(row, &a)| {
        let from = source.map(|source| source[row] - zero_point);
        match &parameters.parameters {
            Parameters::Integer(p) => {
                let own = output_multiplier(parameters, p, row);
                let own = own.map_or(0.0, |m| one(asset.profile.requantize, a, m));
                let skip = parameters.skip.zip(from);
                own + skip.map_or(0.0, |(skip, from)| {
                    one(asset.profile.skip, from, skip.scale)
                })
            }
            Parameters::Half(p) => half_output(asset, p, a, from),
        }
    })
    .collect()
}

fn half_output(asset: &Asset, parameters: &HalfParameters, a: f64, from: Option<f64>) -> f64 {
    let a = Partial::exact(a);
    let sum = from.map_or(a, |from| a.plus(Partial::exact(from), SINGLE));
    to_register(asset, parameters, sum.magnitude(), sum.error)
}

/// The distance after the rounding to a register of a sum that is at most `magnitude` and off by
/// `error`.
#[must_use]
pub fn to_register(asset: &Asset, parameters: &HalfParameters, magnitude: f64, error: f64) -> f64 {
    match parameters.quantize {
        // A magnitude beyond the largest half saturates, on both sides.
        None => error + half_ulp(magnitude.min(65_504.0), HALF),
        Some(quantize) => {
            let steps = 2_f64.powi(i32::from(quantize.exponent));
            let result = (magnitude * steps).min(2_f64.powi(31));
            // 24 bits of a float, however small: a floor may drop nearly a whole.
            error * steps + whole(asset, magnitude) + float_error(result)
        }
    }
}

/// The rounding of a float to an integer: nothing for a zero.
fn whole(asset: &Asset, magnitude: f64) -> f64 {
    if magnitude == 0.0 {
        0.0
    } else {
        rounding(asset.profile.convert, 62)
    }
}

/// The channel codes, given the last layer's activated accumulators: one rounding, in the units of
/// the oracle's channels.
#[must_use]
pub fn channels(asset: &Asset, activated: &[f64]) -> Vec<f64> {
    let formats = asset.shape.outputs.iter().enumerate();
    formats
        .zip(activated)
        .map(|((row, &format), &a)| channel(asset, (row, format), a.abs(), 0.0))
        .collect()
}

/// The distance of a channel whose activated accumulator is at most `magnitude` and off by `error`.
#[must_use]
pub fn channel(
    asset: &Asset,
    (row, format): (usize, OutputFormat),
    magnitude: f64,
    error: f64,
) -> f64 {
    let Some(last) = asset.layers.last() else {
        return 0.0;
    };
    let is_half = format == OutputFormat::Float16;
    match &last.parameters {
        Parameters::Integer(p) if is_half => {
            let to_real = scale(p.scales[row]);
            let result = (magnitude * to_real).min(65_504.0);
            let rounded = half_ulp(result, HALF) + float_error(result);
            (error * to_real + rounded) * HALF_UNITS
        }
        Parameters::Integer(p) => {
            error * scale(p.scales[row]) + one(asset.profile.output, magnitude, p.scales[row])
        }
        Parameters::Half(_) if is_half => {
            (error + half_ulp(magnitude.min(65_504.0), HALF)) * HALF_UNITS
        }
        Parameters::Half(_) => {
            let units = channel_units(format);
            let result = (magnitude * units).min(2_f64.powi(31));
            error * units + whole(asset, magnitude) + float_error(result)
        }
    }
}

/// One rescaling of one value; zero is rescaled to zero by every requantiser.
pub(super) fn one(requantizer: Requantizer, value: f64, multiplier: Multiplier) -> f64 {
    if value == 0.0 {
        0.0
    } else {
        let result = (value * scale(multiplier)).abs().min(2_f64.powi(31));
        requantize(requantizer, value, multiplier) + float_error(result)
    }
}
