//! End to end, expected: the variance of every rounding, propagated by derivatives.
//!
//! At a texel the channel is a function of all roundings on the way. To first order it moves by
//! Σ g·ε, with g its derivative with respect to the value that was rounded and ε the rounding. The
//! roundings are taken as independent and uniform over one LSB (variance 1/12), or over the distance
//! between neighbours where a number is rounded to fp16 or f32; a rule that rounds
//! off centre (a floor, a narrow multiplier, the second rounding of `Double`) has a mean as well.
//! Then mean = Σ g·mean(ε), variance = Σ g²·var(ε), and the expected square is mean² + variance.
//!
//! The derivatives are taken at the oracle's own values, backwards from the channel: they know which
//! ReLUs are shut and which lanes are saturated, and carry the correlation between lanes that
//! share a source, skip paths included. An input that is an integer in the oracle is not rounded, nor
//! is the rescaling of a zero. Not modelled: the tie rules' own mean (2^−k of an LSB for k dropped
//! bits), a ReLU or a clamp that a rounding pushes over its corner, and a table whose neighbouring
//! slopes differ much.

use super::float::{HALF, SINGLE, half_ulp};
use super::interpolation::{self, rounding_mean};
use super::{double_offset, narrow_error, stage, table};
use crate::oracle::embed::Square;
use crate::oracle::number::{HALF_UNITS, LARGEST_HALF, channel_range, channel_units, lane_range};
use crate::oracle::synthesizer::{output_multiplier, outputs_unclamped, reading, rescale, scale};
use crate::oracle::{Oracle, RealTaps, Source};
use ntmu_isa::activation::Activation;
use ntmu_isa::filter::FilterRule;
use ntmu_isa::layer::{HalfParameters, IntegerParameters, Layer, Parameters};
use ntmu_isa::rescale::{Multiplier, Requantizer};
use ntmu_isa::shape::{OutputFormat, Sampling};
use ntmu_model::Request;

/// Variance of a rounding, uniform over one LSB.
const VARIANCE: f64 = 1.0 / 12.0;

/// The expected root mean square of `model − oracle` per channel over `requests`, in the channel's
/// units; zeros for no requests.
#[must_use]
pub fn rms(oracle: &Oracle<'_>, requests: &[Request]) -> Vec<f64> {
    let mut squares = vec![0.0; oracle.asset().shape.outputs.len()];
    for &request in requests {
        let taps = oracle.taps(request);
        for (square, expected) in squares.iter_mut().zip(texel(oracle, request, &taps)) {
            *square += expected;
        }
    }
    squares
        .iter()
        .map(|s| (s / requests.len().max(1) as f64).sqrt())
        .collect()
}

/// The expected square of `model − oracle` per channel of one texel, in squared units of the
/// channel.
#[must_use]
pub fn texel(oracle: &Oracle<'_>, request: Request, taps: &RealTaps) -> Vec<f64> {
    let point = Point {
        oracle,
        request,
        taps,
        sums: sum_variances(oracle, taps),
    };
    (0..taps.unclamped.len())
        .map(|channel| point.channel_square(channel))
        .collect()
}

/// Mean and variance of what the roundings add up to.
#[derive(Default)]
struct Sum {
    mean: f64,
    variance: f64,
}

impl Sum {
    /// A rounding to an integer at a place where the channel's derivative is `g`.
    fn add(&mut self, g: f64, mean: f64) {
        self.mean += g * mean;
        self.variance += g * g * VARIANCE;
    }

    /// A rounding of a float, by `half_ulp` at most.
    fn float(&mut self, g: f64, half_ulp: f64) {
        self.variance += g * g * half_ulp * half_ulp / 3.0;
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

/// A texel, and the reals on its way.
struct Point<'a> {
    oracle: &'a Oracle<'a>,
    request: Request,
    taps: &'a RealTaps,
    /// Per layer and row: the variance of the sum's own roundings; none for integer layers.
    sums: Vec<Vec<f64>>,
}

fn sum_variances(oracle: &Oracle<'_>, taps: &RealTaps) -> Vec<Vec<f64>> {
    let asset = oracle.asset();
    let mut input = &taps.inputs;
    let mut variances = Vec::new();
    for (index, (layer, real)) in asset.layers.iter().zip(&taps.layers).enumerate() {
        variances.push(match &layer.parameters {
            Parameters::Integer(_) => Vec::new(),
            Parameters::Half(_) => {
                let format = asset.input_format(index);
                let lanes = input.iter();
                let lanes: Vec<_> = lanes
                    .map(|&value| stage::read(layer, format, (value, value), 0.0))
                    .collect();
                (0..usize::from(layer.outputs))
                    .map(|row| stage::sum(asset, index, row, oracle.row(index, row), &lanes))
                    .map(|sum| sum.variance)
                    .collect()
            }
        });
        input = &real.outputs;
    }
    variances
}

/// A row of a layer, and the derivative of the channel with respect to what the row gives.
#[derive(Clone, Copy)]
struct Row {
    layer: usize,
    row: usize,
    g: f64,
}

impl Point<'_> {
    fn channel_square(&self, channel: usize) -> f64 {
        let asset = self.oracle.asset();
        let last = asset.layers.len() - 1;
        let (low, high) = channel_range(asset.shape.outputs[channel]);
        let code = self.taps.unclamped[channel];
        if code <= low || code >= high {
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
            let to_input = self.layer(index, &mut to_outputs, &mut sum);
            match index.checked_sub(1) {
                Some(before) => {
                    for (to, more) in to_outputs[before].iter_mut().zip(&to_input) {
                        *to += more;
                    }
                }
                None => to_inputs = to_input,
            }
        }
        self.inputs(&to_inputs, &mut sum);
        sum.mean * sum.mean + sum.variance
    }

    /// Adds the roundings of a layer; gives the derivatives with respect to the register that it
    /// reads.
    fn layer(&self, index: usize, to_outputs: &mut [Vec<f64>], sum: &mut Sum) -> Vec<f64> {
        let asset = self.oracle.asset();
        let layer = &asset.layers[index];
        let real = &self.taps.layers[index];
        let is_last = index + 1 == asset.layers.len();
        let source = self.source(index);
        let unclamped = outputs_unclamped(layer, &asset.profile, &real.activated, source);
        let range = lane_range(layer.output_format());
        let mut to_input = vec![0.0; usize::from(layer.inputs)];
        for row in 0..usize::from(layer.outputs) {
            let g = to_outputs[index][row];
            let is_saturated = !is_last && (unclamped[row] < range.0 || unclamped[row] > range.1);
            if g == 0.0 || is_saturated {
                continue;
            }
            let at = Row {
                layer: index,
                row,
                g,
            };
            let (g, to_source) = match &layer.parameters {
                Parameters::Integer(p) => self.integer_row(p, at, sum),
                Parameters::Half(p) => {
                    let (g, to_source) = self.half_row(p, at, unclamped[row], sum);
                    sum.variance += g * g * self.sums[index][row];
                    // From the register's own units to the reals that are multiplied.
                    let units = reading(layer, asset.input_format(index)).map_or(1.0, |(_, u)| u);
                    (g / units, to_source)
                }
            };
            if let Some(from) = asset.skip_source(index) {
                to_outputs[from][row] += to_source;
            }
            if g != 0.0 {
                for (to, weight) in to_input.iter_mut().zip(self.oracle.row(index, row)) {
                    *to += g * weight;
                }
            }
        }
        to_input
    }

    fn source(&self, layer: usize) -> Option<Source<'_>> {
        let from = self.oracle.asset().skip_source(layer)?;
        let values = self.taps.layers[from].outputs.as_slice();
        self.oracle.source(layer, Some(values))
    }

    /// The derivatives with respect to a row's accumulator and its skip path's source.
    fn integer_row(&self, p: &IntegerParameters, at: Row, sum: &mut Sum) -> (f64, f64) {
        let asset = self.oracle.asset();
        let profile = &asset.profile;
        let layer = &asset.layers[at.layer];
        let real = &self.taps.layers[at.layer];
        let (row, a) = (at.row, real.activated[at.row]);
        let mut to_source = 0.0;
        if let (Some(skip), Some(source)) = (layer.skip, self.source(at.layer)) {
            let value = source.values[row] - source.zero_point;
            let limit = 2_f64.powi(i32::from(profile.residual_bits) - 1);
            if (-limit..limit).contains(&rescale(value, skip.scale)) {
                sum.rescale(at.g, profile.skip, value, skip.scale);
                to_source = at.g * scale(skip.scale);
            }
        }
        let is_last = at.layer + 1 == asset.layers.len();
        let to_activated = if is_last && asset.shape.outputs[row] == OutputFormat::Float16 {
            let to_real = scale(p.scales[row]);
            sum.float(at.g * HALF_UNITS, half_ulp(a * to_real, HALF));
            at.g * HALF_UNITS * to_real
        } else {
            let requantizer = if is_last {
                profile.output
            } else {
                profile.requantize
            };
            output_multiplier(layer, p, row).map_or(at.g, |multiplier| {
                sum.rescale(at.g, requantizer, a, multiplier);
                at.g * scale(multiplier)
            })
        };
        let g = self.activation(layer, p, (row, real.accumulators[row], to_activated), sum);
        (g, to_source)
    }

    /// The derivative with respect to an integer layer's accumulator, given that with respect to its
    /// activation; adds the activation's own rounding.
    fn activation(
        &self,
        layer: &Layer,
        p: &IntegerParameters,
        (row, a, g): (usize, f64, f64),
        sum: &mut Sum,
    ) -> f64 {
        let profile = &self.oracle.asset().profile;
        let multiplier = p.scales[row];
        match layer.activation {
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
                sum.add(g, rounding_mean(profile.leak, u32::from(shift)));
                g * slope
            }
            Activation::Leaky { .. } => g,
            Activation::HardGelu { is_clamped, .. } => {
                let x = a * scale(multiplier);
                let high = if is_clamped { 768.0 } else { 32_767.0 };
                let slope = if x <= -384.0 || x > high {
                    0.0
                } else if x < 384.0 {
                    4.0 * x + 768.0
                } else {
                    1536.0
                };
                sum.rescale(g * slope, profile.requantize, a, multiplier);
                g * slope * scale(multiplier)
            }
            Activation::Table => {
                let index = a * scale(multiplier);
                let slope = if (-128.0..=127.0).contains(&index) {
                    table::slope(&p.table, index)
                } else {
                    0.0
                };
                sum.rescale(g * slope, profile.requantize, a, multiplier);
                g * slope * scale(multiplier)
            }
        }
    }

    /// The derivatives with respect to a row's sum and its skip path's source; `output` is what the
    /// row gives before its clamp.
    fn half_row(&self, p: &HalfParameters, at: Row, output: f64, sum: &mut Sum) -> (f64, f64) {
        let asset = self.oracle.asset();
        let layer = &asset.layers[at.layer];
        let real = &self.taps.layers[at.layer];
        let convert = rounding_mean(asset.profile.convert, 62);
        let is_last = at.layer + 1 == asset.layers.len();
        let (activated, a) = (real.activated[at.row], real.accumulators[at.row]);
        let g = if is_last {
            let format = asset.shape.outputs[at.row];
            let units = channel_units(format);
            if format == OutputFormat::Float16 {
                sum.float(at.g * units, half_ulp(activated, HALF));
            } else if activated != 0.0 {
                sum.add(at.g, convert);
            }
            at.g * units
        } else if let Some(quantize) = p.quantize {
            let is_zero = output == f64::from(quantize.zero_point);
            if !is_zero {
                sum.add(at.g, convert);
            }
            at.g * 2_f64.powi(i32::from(quantize.exponent))
        } else {
            sum.float(at.g, half_ulp(output.abs().min(LARGEST_HALF), HALF));
            at.g
        };
        let to_source = if layer.skip.is_some() {
            sum.float(g, half_ulp(activated, SINGLE));
            g
        } else {
            0.0
        };
        let slope = match layer.activation {
            // A validated fp16 layer has no table.
            Activation::Identity | Activation::Table => 1.0,
            Activation::Relu => f64::from(u8::from(a > 0.0)),
            Activation::Leaky { shift } if a < 0.0 => 2_f64.powi(-i32::from(shift)),
            Activation::Leaky { .. } => 1.0,
            Activation::HardGelu { is_clamped, .. } => {
                // Its own roundings are to f32: three of the result's last place.
                sum.float(g, 2.0 * half_ulp(activated, SINGLE));
                if a <= -1.5 || (is_clamped && a > 3.0) {
                    0.0
                } else if a < 1.5 {
                    2.0 * a / 3.0 + 0.5
                } else {
                    1.0
                }
            }
        };
        (g * slope, to_source)
    }

    /// Adds the roundings of the inputs: the interpolation's and the level's.
    fn inputs(&self, to_inputs: &[f64], sum: &mut Sum) {
        let asset = self.oracle.asset();
        let shape = &asset.shape;
        let mut lane = 0;
        for (index, grid) in shape.grids.iter().enumerate() {
            let square = Square::of(shape, &asset.grids, index, self.request);
            let (corner, axes) = interpolation::parts(*grid, &asset.profile, shape.input_bits);
            let mean = |dropped: bool| {
                if dropped {
                    rounding_mean(asset.profile.input, 62)
                } else {
                    0.0
                }
            };
            for channel in 0..usize::from(grid.input_count()) {
                let g = to_inputs[lane];
                let real = self.taps.inputs[lane];
                lane += 1;
                if grid.sampling == Sampling::Corners {
                    if real.fract() != 0.0 {
                        sum.add(g, mean(corner > 0.0));
                    }
                    continue;
                }
                let [x, y] = square.fractions;
                if corner > 0.0 {
                    // Four roundings, weighted: between one and a quarter of one.
                    let share = (1.0 - 2.0 * x * (1.0 - x)) * (1.0 - 2.0 * y * (1.0 - y));
                    sum.mean += g * mean(true);
                    sum.variance += g * g * VARIANCE * share;
                }
                match axes.roundings[..] {
                    // Along u for both rows, then along v.
                    [along_u, along_v] => {
                        if x != 0.0 {
                            sum.mean += g * along_u.mean;
                            sum.variance += g * g * VARIANCE * (1.0 - 2.0 * y * (1.0 - y));
                        }
                        if y != 0.0 {
                            sum.add(g, along_v.mean);
                        }
                    }
                    _ if real.fract() != 0.0 => {
                        let mean = axes.roundings.first().map_or(0.0, |step| step.mean);
                        sum.add(g, mean);
                    }
                    _ => {}
                }
                if axes.weights > 0.0 && asset.profile.interpolate == FilterRule::Factored {
                    let c = square.corners.each_ref().map(|corner| corner[channel]);
                    let twist = (c[0] - c[1] - c[2] + c[3]).abs();
                    let step = 2_f64.powi(-i32::from(asset.profile.subtexel_bits));
                    let units = 2_f64.powi(i32::from(shape.input_bits) - 1);
                    sum.float(g * twist * units, step / 2.0);
                }
            }
        }
        lane += usize::from(shape.wave_count());
        // The level is no random number: its rounding is known.
        let real = self.taps.inputs[lane];
        sum.mean += to_inputs[lane] * ((real + 0.5).floor() - real);
    }
}
