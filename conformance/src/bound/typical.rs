//! End to end, expected: the variance of every rounding, propagated by derivatives.
//!
//! At a texel the channel is a function of all roundings on the way. To first order it moves by
//! Σ g·ε, with g its derivative with respect to the value that was rounded and ε the rounding. The
//! roundings are taken as independent and uniform over one LSB (variance 1/12); a rule that rounds
//! off centre (a floor, a narrow multiplier, the second rounding of `Double`) has a mean as well.
//! Then mean = Σ g·mean(ε), variance = Σ g²/12, and the expected square is mean² + variance.
//!
//! The derivatives are taken at the oracle's own values, backwards from the channel: they know which
//! ReLUs are shut and which lanes are saturated, and carry the correlation between lanes that
//! share a source, skip paths included. An input that is an integer in the oracle is not rounded, nor
//! is the rescaling of a zero. Not modelled: the tie rules' own mean (2^−k of an LSB for k dropped bits), and a ReLU
//! or a clamp that a rounding pushes over its corner.

use super::{double_offset, narrow_error};
use crate::oracle::synthesizer::{output_multiplier, outputs_unclamped, scale};
use crate::oracle::{Oracle, RealTaps};
use ntmu_isa::activation::Activation;
use ntmu_isa::rescale::{Multiplier, Requantizer};
use ntmu_isa::round::Rounding;
use ntmu_model::Request;

/// Variance of a rounding, uniform over one LSB.
const VARIANCE: f64 = 1.0 / 12.0;

/// The expected root mean square of `model − oracle` per channel over `requests`, in LSB of the
/// channel; zeros for no requests.
#[must_use]
pub fn rms(oracle: &Oracle<'_>, requests: &[Request]) -> Vec<f64> {
    let mut squares = vec![0.0; oracle.asset().shape.outputs.len()];
    for &request in requests {
        let taps = oracle.taps(request);
        for (square, expected) in squares.iter_mut().zip(texel(oracle, &taps)) {
            *square += expected;
        }
    }
    squares
        .iter()
        .map(|s| (s / requests.len().max(1) as f64).sqrt())
        .collect()
}

/// The expected square of `model − oracle` per channel of one texel, in LSB² of the channel.
#[must_use]
pub fn texel(oracle: &Oracle<'_>, taps: &RealTaps) -> Vec<f64> {
    (0..taps.unclamped.len())
        .map(|channel| channel_square(oracle, taps, channel))
        .collect()
}

/// Mean and variance of what the roundings add up to.
#[derive(Default)]
struct Sum {
    mean: f64,
    variance: f64,
}

impl Sum {
    /// A rounding to the nearest at a place where the channel's derivative is `g`.
    fn add(&mut self, g: f64, mean: f64) {
        self.mean += g * mean;
        self.variance += g * g * VARIANCE;
    }

    /// A rescaling of `value`, whose result the channel depends on by `g`.
    fn rescale(&mut self, g: f64, requantizer: Requantizer, value: f64, multiplier: Multiplier) {
        if value == 0.0 {
            return;
        }
        let mean = match requantizer {
            Requantizer::Single | Requantizer::HalfEven | Requantizer::HalfAway => 0.0,
            Requantizer::Double => double_offset(multiplier).copysign(value),
            Requantizer::Narrow => value * narrow_error(multiplier),
        };
        self.add(g, mean);
    }
}

fn channel_square(oracle: &Oracle<'_>, taps: &RealTaps, channel: usize) -> f64 {
    let asset = oracle.asset();
    let last = asset.layers.len() - 1;
    let (low, high) = asset.shape.outputs[channel].range();
    let code = taps.unclamped[channel];
    if code <= f64::from(low) || code >= f64::from(high) {
        return 0.0;
    }
    let mut sum = Sum::default();
    // Derivatives with respect to the outputs of every layer, filled from the back.
    let mut to_outputs: Vec<Vec<f64>> = asset
        .layers
        .iter()
        .map(|layer| vec![0.0; usize::from(layer.outputs)])
        .collect();
    to_outputs[last][channel] = 1.0;
    let mut to_inputs = Vec::new();
    for index in (0..=last).rev() {
        let layer = &asset.layers[index];
        let real = &taps.layers[index];
        let source = oracle.skip_source(index);
        let values = source.map(|from| {
            (
                taps.layers[from].outputs.as_slice(),
                f64::from(asset.layers[from].zero_point),
            )
        });
        let unclamped = outputs_unclamped(layer, &real.activated, values);
        let mut to_input = vec![0.0; usize::from(layer.inputs)];
        for row in 0..usize::from(layer.outputs) {
            let g = to_outputs[index][row];
            let is_saturated = index != last && !(-128.0..=127.0).contains(&unclamped[row]);
            if g == 0.0 || is_saturated {
                continue;
            }
            let profile = &asset.profile;
            let requantizer = if index == last {
                profile.output
            } else {
                profile.requantize
            };
            let multiplier = output_multiplier(layer, row);
            sum.rescale(g, requantizer, real.activated[row], multiplier);
            if let (Some(skip), Some((source, zero_point)), Some(from)) =
                (layer.skip, values, oracle.skip_source(index))
            {
                sum.rescale(g, profile.skip, source[row] - zero_point, skip.scale);
                to_outputs[from][row] += g * scale(skip.scale);
            }
            let g = g * scale(multiplier);
            let g = activation(oracle, &mut sum, (index, row), real.accumulators[row], g);
            if g != 0.0 {
                for (to, &weight) in to_input.iter_mut().zip(layer.row(row)) {
                    *to += g * f64::from(weight);
                }
            }
        }
        match index.checked_sub(1) {
            Some(before) => {
                for (to, more) in to_outputs[before].iter_mut().zip(&to_input) {
                    *to += more;
                }
            }
            None => to_inputs = to_input,
        }
    }
    inputs(oracle, taps, &to_inputs, &mut sum);
    sum.mean * sum.mean + sum.variance
}

/// The derivative with respect to the accumulator, given that with respect to its activation; adds
/// the activation's own rounding.
fn activation(
    oracle: &Oracle<'_>,
    sum: &mut Sum,
    (layer, row): (usize, usize),
    a: f64,
    g: f64,
) -> f64 {
    let asset = oracle.asset();
    let parameters = &asset.layers[layer];
    match parameters.activation {
        Activation::Identity => g,
        Activation::Relu => {
            if a > 0.0 {
                g
            } else {
                0.0
            }
        }
        Activation::Leaky { shift } if a < 0.0 => {
            let slope = 2_f64.powi(-i32::from(shift));
            sum.add(g, rounding_mean(asset.profile.leak, u32::from(shift)));
            g * slope
        }
        Activation::Leaky { .. } => g,
        Activation::HardGelu { .. } => {
            let multiplier = parameters.scales[row];
            let x = a * scale(multiplier);
            let slope = if x <= -384.0 || !(-32_768.0..=32_767.0).contains(&x) {
                0.0
            } else if x < 384.0 {
                4.0 * x + 768.0
            } else {
                1536.0
            };
            sum.rescale(g * slope, asset.profile.requantize, a, multiplier);
            g * slope * scale(multiplier)
        }
    }
}

/// Adds the input quantiser and the level's rounding.
fn inputs(oracle: &Oracle<'_>, taps: &RealTaps, to_inputs: &[f64], sum: &mut Sum) {
    let shape = &oracle.asset().shape;
    let mode = oracle.asset().profile.input;
    let corners = 4 * usize::from(shape.grids[0].channels);
    for (lane, (&real, &g)) in taps.inputs.iter().zip(to_inputs).enumerate() {
        if real.fract() == 0.0 {
            continue;
        }
        if lane + 1 == taps.inputs.len() {
            // The level is no random number: its rounding is known.
            sum.mean += g * ((real + 0.5).floor() - real);
        } else {
            // The same bits as in `stage::inputs`: a corner drops B − 7, an interpolation B + 1.
            let dropped = if lane < corners {
                u32::from(shape.grids[0].format.bits()).saturating_sub(7)
            } else {
                u32::from(shape.grids[1].format.bits()) + 1
            };
            sum.add(g, rounding_mean(mode, dropped));
        }
    }
}

/// The mean of a rounding that drops this many bits.
fn rounding_mean(mode: Rounding, dropped_bits: u32) -> f64 {
    match mode {
        Rounding::HalfUp | Rounding::HalfEven | Rounding::HalfAway => 0.0,
        Rounding::Floor => -0.5 * (1.0 - 2_f64.powi(-(dropped_bits as i32))),
    }
}
