//! End to end, sound: intervals propagated through the actual weights.
//!
//! Beside every real of the oracle goes a radius: the model's value lies within it, whatever the
//! roundings before did. A dense layer multiplies radii by |weights|; what follows maps the
//! interval through the stage's own function and adds the stage's own bound, taken at the worst
//! point of the interval.

use super::{float_error, gate_error, requantize, rounding, stage};
use crate::oracle::synthesizer::{output_multiplier, outputs_unclamped, scale};
use crate::oracle::{Oracle, RealTaps};
use ntmu_isa::Asset;
use ntmu_isa::activation::Activation;
use ntmu_isa::rescale::{Multiplier, Requantizer};

/// How far each channel of this texel may lie from the oracle's clamped channel, in LSB of the
/// channel. `taps` are the oracle's own for that texel.
#[must_use]
pub fn texel(oracle: &Oracle<'_>, taps: &RealTaps) -> Vec<f64> {
    let asset = oracle.asset();
    let profile = &asset.profile;
    let mut radii: Vec<Vec<f64>> = vec![stage::inputs(asset)];
    for (index, real) in taps.layers.iter().enumerate() {
        let layer = &asset.layers[index];
        let accumulated = dense(asset, index, &radii[index]);
        let activated: Vec<f64> = (0..accumulated.len())
            .map(|row| activation(asset, index, row, real.accumulators[row], accumulated[row]))
            .collect();
        let is_last = index + 1 == taps.layers.len();
        let requantizer = if is_last {
            profile.output
        } else {
            profile.requantize
        };
        let mut rescaled: Vec<f64> = (0..activated.len())
            .map(|row| {
                let multiplier = output_multiplier(layer, row);
                through(requantizer, real.activated[row], activated[row], multiplier)
            })
            .collect();
        if is_last {
            let formats = asset.shape.outputs.iter().map(|format| format.range());
            let reals = taps.unclamped.iter().zip(&rescaled);
            return reals
                .zip(formats)
                .map(|((&r, &e), range)| clamped(r, e, range))
                .collect();
        }
        let source = oracle.skip_source(index);
        if let (Some(skip), Some(from)) = (layer.skip, source) {
            let zero_point = f64::from(asset.layers[from].zero_point);
            for (row, radius) in rescaled.iter_mut().enumerate() {
                let value = taps.layers[from].outputs[row] - zero_point;
                // radii[from + 1] are those of layer `from`'s outputs: the inputs come first.
                *radius += through(profile.skip, value, radii[from + 1][row], skip.scale);
            }
        }
        let source = source.map(|from| {
            (
                taps.layers[from].outputs.as_slice(),
                f64::from(asset.layers[from].zero_point),
            )
        });
        let unclamped = outputs_unclamped(layer, &real.activated, source);
        let pairs = unclamped.iter().zip(&rescaled);
        radii.push(pairs.map(|(&r, &e)| clamped(r, e, (-128, 127))).collect());
    }
    Vec::new()
}

/// How far each channel of any texel of this asset may lie from the oracle, in LSB of the channel.
///
/// Without a texel there is no point to take an interval at: activations count with their largest
/// slope (1; 2304 for a gate's product, at 3/2), values with their largest magnitude.
#[must_use]
pub fn asset(asset: &Asset) -> Vec<f64> {
    let profile = &asset.profile;
    let mut radii: Vec<Vec<f64>> = vec![stage::inputs(asset)];
    for (index, layer) in asset.layers.iter().enumerate() {
        let is_last = index + 1 == asset.layers.len();
        let accumulated = dense(asset, index, &radii[index]);
        let requantizer = if is_last {
            profile.output
        } else {
            profile.requantize
        };
        let mut rescaled: Vec<f64> = (0..accumulated.len())
            .map(|row| {
                // An input is at most 128 in magnitude.
                let products: f64 = layer
                    .row(row)
                    .iter()
                    .map(|&w| f64::from(w).abs() * 128.0)
                    .sum();
                let largest = f64::from(layer.bias[row]).abs() + products;
                let radius = accumulated[row];
                let (largest, radius) = match layer.activation {
                    Activation::Identity | Activation::Relu => (largest, radius),
                    Activation::Leaky { shift } => {
                        (largest, radius + rounding(profile.leak, u32::from(shift)))
                    }
                    Activation::HardGelu { .. } => {
                        let argument = through(requantizer, largest, radius, layer.scales[row]);
                        (32_768.0 * 1536.0, 2304.0 * argument)
                    }
                };
                through(requantizer, largest, radius, output_multiplier(layer, row))
            })
            .collect();
        if is_last {
            let widths = asset.shape.outputs.iter().map(|format| format.range());
            let widths = widths.map(|(low, high)| f64::from(high - low));
            return rescaled
                .iter()
                .zip(widths)
                .map(|(&radius, width)| radius.min(width))
                .collect();
        }
        if let Some(skip) = layer.skip {
            let from = index - usize::from(skip.span);
            for (row, radius) in rescaled.iter_mut().enumerate() {
                // A value less its zero point is at most 255 in magnitude.
                *radius += through(profile.skip, 255.0, radii[from + 1][row], skip.scale);
            }
        }
        radii.push(rescaled.iter().map(|&radius| radius.min(255.0)).collect());
    }
    Vec::new()
}

/// Radii of accumulators: Σ |weight| · radius.
fn dense(asset: &Asset, layer: usize, radii: &[f64]) -> Vec<f64> {
    let parameters = &asset.layers[layer];
    (0..usize::from(parameters.outputs))
        .map(|row| {
            let terms = parameters.row(row).iter().zip(radii);
            let magnitude: f64 = parameters
                .row(row)
                .iter()
                .map(|&w| f64::from(w).abs())
                .sum();
            // The oracle's own sums of reals: one rounding per term, of a sum below 2^31.
            let float = float_error(magnitude * 128.0) * f64::from(parameters.inputs);
            terms
                .map(|(&w, radius)| f64::from(w).abs() * radius)
                .sum::<f64>()
                + float
        })
        .collect()
}

/// The radius after the activation of an accumulator `a` with a radius.
fn activation(asset: &Asset, layer: usize, row: usize, a: f64, radius: f64) -> f64 {
    let parameters = &asset.layers[layer];
    match parameters.activation {
        Activation::Identity => radius,
        Activation::Relu => {
            let ends = [a - radius, a + radius].map(|end| (end.max(0.0) - a.max(0.0)).abs());
            ends[0].max(ends[1])
        }
        Activation::Leaky { shift } => {
            let leak = |x: f64| {
                if x < 0.0 {
                    x / 2_f64.powi(i32::from(shift))
                } else {
                    x
                }
            };
            let ends = [a - radius, a + radius].map(|end| (leak(end) - leak(a)).abs());
            let rounded = rounding(asset.profile.leak, u32::from(shift));
            ends[0].max(ends[1]) + if a - radius < 0.0 { rounded } else { 0.0 }
        }
        Activation::HardGelu { .. } => {
            let multiplier = parameters.scales[row];
            let moved = through(asset.profile.requantize, a, radius, multiplier);
            gate_error(a * scale(multiplier), moved) + float_error(2_f64.powi(26))
        }
    }
}

/// The radius after a rescaling of a value with a radius.
fn through(requantizer: Requantizer, value: f64, radius: f64, multiplier: Multiplier) -> f64 {
    let largest = value.abs() + radius;
    if largest < 1.0 {
        // The model's value is an integer, therefore 0, which every requantiser rescales to 0: the
        // distance is that of the real, which lies within the radius of the model's 0.
        return value.abs().min(radius) * scale(multiplier);
    }
    let result = (largest * scale(multiplier)).min(2_f64.powi(31));
    radius * scale(multiplier) + requantize(requantizer, largest, multiplier) + float_error(result)
}

/// The radius after a clamp of a real with a radius.
fn clamped(real: f64, radius: f64, range: (i32, i32)) -> f64 {
    let (low, high) = (f64::from(range.0), f64::from(range.1));
    let to = real.clamp(low, high);
    let ends = [real - radius, real + radius].map(|end| (end.clamp(low, high) - to).abs());
    ends[0].max(ends[1])
}
