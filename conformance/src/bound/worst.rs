//! End to end, sound: intervals propagated through the actual weights.
//!
//! Beside every real of the oracle goes a radius: the model's value lies within it, whatever the
//! roundings before did. A dense layer multiplies radii by |weights|; what follows maps the
//! interval through the stage's own function and adds the stage's own bound, taken at the worst
//! point of the interval. For an asset as a whole the reals are intervals too: all that any latents
//! and any texel can give.

use super::float::{Partial, SINGLE};
use super::range::Lane;
use super::{float, float_error, gate, gate_error, gate_high, requantize, rounding, stage, table};
use crate::oracle::number::{channel_range, channel_units, lane_range, signed};
use crate::oracle::synthesizer::{
    bias, gate_argument, hard_gelu, output_multiplier, quantized, rescale, scale, table_entry,
    table_index, weights,
};
use crate::oracle::{Oracle, RealTaps, number};
use ntmu_isa::Asset;
use ntmu_isa::activation::Activation;
use ntmu_isa::layer::{HalfParameters, IntegerParameters, Layer, Parameters};
use ntmu_isa::rescale::{Multiplier, Requantizer};
use ntmu_isa::shape::{LaneFormat, OutputFormat};

/// How far each channel of this texel may lie from the oracle's clamped channel, in the channel's
/// units. `taps` are the oracle's own for that texel.
#[must_use]
pub fn texel(oracle: &Oracle<'_>, taps: &RealTaps) -> Vec<f64> {
    let asset = oracle.asset();
    let bounds = stage::inputs(asset);
    let lanes = taps.inputs.iter().zip(bounds);
    let inputs = lanes.map(|(&real, bound)| Lane::point(real, bound));
    run(asset, inputs.collect(), Some(taps))
}

/// How far each channel of any texel of this asset may lie from the oracle, in the channel's units,
/// whatever its latents.
#[must_use]
pub fn asset(asset: &Asset) -> Vec<f64> {
    let range = lane_range(asset.shape.input_format());
    let bounds = stage::inputs(asset);
    let lanes = bounds.iter().map(|&radius| Lane {
        real: range,
        radius,
    });
    let mut lanes: Vec<Lane> = lanes.collect();
    let mut lane = 0;
    for grid in asset.shape.grids {
        // Latents reach half of the range.
        let half = 2_f64.powi(i32::from(asset.shape.input_bits) - 2);
        let low = half - super::interpolation::latent_span(grid, asset.shape.input_bits);
        for _ in 0..grid.input_count() {
            lanes[lane].real = (low, half);
            lane += 1;
        }
    }
    let padding = usize::from(asset.shape.padding);
    let used = lanes.len() - padding;
    lanes[used..].fill(Lane::point(0.0, 0.0));
    run(asset, lanes, None)
}

/// `taps` are the oracle's, where the texel is known: a difference of floats that were added up in
/// another order is no distance.
fn run(asset: &Asset, inputs: Vec<Lane>, taps: Option<&RealTaps>) -> Vec<f64> {
    // The inputs, then the outputs of every layer: those of layer n are at n + 1.
    let mut registers = vec![inputs];
    for (index, layer) in asset.layers.iter().enumerate() {
        let sums = accumulated(asset, index, &registers[index]);
        let real = taps.map(|taps| &taps.layers[index]);
        let activated = sums.into_iter().enumerate().map(|(row, sum)| {
            let sum = sum.known(real.map(|real| real.accumulators[row]));
            let result = match &layer.parameters {
                Parameters::Integer(p) => activate_integer(asset, layer, p, (row, sum)),
                Parameters::Half(_) => activate_half(layer, sum),
            };
            (row, result.known(real.map(|real| real.activated[row])))
        });
        if index + 1 == asset.layers.len() {
            return activated
                .map(|(row, lane)| {
                    let known = taps.map(|taps| taps.unclamped[row]);
                    channel(asset, layer, (row, lane), known)
                })
                .collect();
        }
        let range = lane_range(layer.output_format());
        let outputs = activated.map(|(row, lane)| {
            let source = asset.skip_source(index).map(|from| {
                let zero_point = match asset.layers[from].output_format() {
                    LaneFormat::Integer { zero_point, .. } => f64::from(zero_point),
                    LaneFormat::Half => 0.0,
                };
                registers[from + 1][row].plus(Lane::point(-zero_point, 0.0))
            });
            let output = match &layer.parameters {
                Parameters::Integer(p) => integer_output(asset, layer, p, (row, lane), source),
                Parameters::Half(p) => half_output(asset, p, lane, source),
            };
            output
                .clamped(range)
                .known(real.map(|real| real.outputs[row]))
        });
        registers.push(outputs.collect());
    }
    Vec::new()
}

/// The sums of a layer: Σ |weight| · radius, and an fp16 layer's own roundings.
fn accumulated(asset: &Asset, index: usize, input: &[Lane]) -> Vec<Lane> {
    let layer = &asset.layers[index];
    let format = asset.input_format(index);
    let rows = 0..usize::from(layer.outputs);
    // The oracle's own sums of reals: one rounding a term. Its real lies within that of the interval,
    // whose ends were added up in another order.
    let own = |largest: f64| float_error(largest) * f64::from(layer.inputs);
    if layer.half().is_some() {
        let lanes: Vec<Partial> = input
            .iter()
            .map(|lane| stage::read(layer, format, lane.real, lane.radius))
            .collect();
        return rows
            .map(|row| {
                let sum = stage::sum(asset, index, row, &weights(layer, row), &lanes);
                let lane = Lane {
                    real: sum.real,
                    radius: sum.error + own(sum.largest),
                };
                lane.loosened(own(sum.largest))
            })
            .collect();
    }
    rows.map(|row| {
        let start = bias(layer, row);
        let (mut low, mut high, mut radius, mut largest) = (start, start, 0.0, start.abs());
        for (lane, weight) in input.iter().zip(weights(layer, row)) {
            let ends = (lane.real.0 * weight, lane.real.1 * weight);
            low += ends.0.min(ends.1);
            high += ends.0.max(ends.1);
            radius += weight.abs() * lane.radius;
            largest += weight.abs() * lane.magnitude();
        }
        let lane = Lane {
            real: (low, high),
            radius: radius + own(largest),
        };
        lane.loosened(own(largest))
    })
    .collect()
}

fn activate_integer(
    asset: &Asset,
    layer: &Layer,
    parameters: &IntegerParameters,
    (row, sum): (usize, Lane),
) -> Lane {
    let profile = &asset.profile;
    let multiplier = parameters.scales[row];
    match layer.activation {
        Activation::Identity => sum,
        Activation::Relu => sum.rising(1.0, |a| a.max(0.0)),
        Activation::Leaky { shift } => {
            let rounded = if sum.real.0 - sum.radius < 0.0 {
                rounding(profile.leak, u32::from(shift))
            } else {
                0.0
            };
            leaky(sum, shift).widened(rounded)
        }
        Activation::HardGelu { is_clamped, .. } => {
            let moved = through(profile.requantize, sum, multiplier).radius;
            let argument = |a: f64| gate_argument(a, multiplier, is_clamped);
            let (low, high) = (argument(sum.real.0), argument(sum.real.1));
            let lowest = (-192.0_f64).clamp(low, high);
            let ends = [gate(low), gate(lowest), gate(high)];
            let radius = if sum.real.0 == sum.real.1 {
                gate_error(sum.real.0 * scale(multiplier), moved, is_clamped)
            } else {
                // The steepest place is at 3/2, and the product has a range.
                let top = gate(gate_high(is_clamped)) - gate(-192.0);
                (2304.0 * moved).min(top)
            };
            Lane {
                real: (ends[0].min(ends[1]), ends[0].max(ends[2])),
                radius: radius + float_error(2_f64.powi(26)),
            }
        }
        Activation::Table => {
            let moved = through(profile.requantize, sum, multiplier).radius;
            let ends = [sum.real.0, sum.real.1].map(|a| table_index(a, multiplier));
            let entries = &parameters.table;
            let inside = (ends[0].ceil() as i32..=ends[1].floor() as i32).map(f64::from);
            let reals = inside.chain(ends).map(|at| table_entry(entries, at));
            let real = reals.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), entry| {
                (low.min(entry), high.max(entry))
            });
            let steepest = (-128..127)
                .map(|index| table::slope(entries, f64::from(index)).abs())
                .fold(0.0, f64::max);
            let unclamped = (
                sum.real.0 * scale(multiplier),
                sum.real.1 * scale(multiplier),
            );
            let reach = table::error(entries, unclamped, moved);
            Lane {
                real,
                radius: reach.min(steepest * moved) + float_error(2_f64.powi(17)),
            }
        }
    }
}

fn leaky(sum: Lane, shift: u8) -> Lane {
    sum.rising(1.0, |a| {
        if a < 0.0 {
            a / 2_f64.powi(i32::from(shift))
        } else {
            a
        }
    })
}

fn activate_half(layer: &Layer, sum: Lane) -> Lane {
    match layer.activation {
        // A validated fp16 layer has no table.
        Activation::Identity | Activation::Table => sum,
        Activation::Relu => sum.rising(1.0, |a| a.max(0.0)),
        Activation::Leaky { shift } => leaky(sum, shift),
        Activation::HardGelu { is_clamped, .. } => {
            let sum = if is_clamped {
                sum.rising(1.0, |a| a.min(3.0))
            } else {
                sum
            };
            let (low, high) = sum.real;
            // Below −3/4 the product falls, above it rises; it is steepest at 3/2.
            let lowest = (-0.75_f64).clamp(low, high);
            let ends = [low, lowest, high].map(hard_gelu);
            let moved = if low == high {
                let (from, to) = (low - sum.radius, low + sum.radius);
                let lowest = (-0.75_f64).clamp(from, to);
                [from, lowest, to]
                    .map(|at| (hard_gelu(at) - hard_gelu(low)).abs())
                    .into_iter()
                    .fold(0.0, f64::max)
            } else {
                1.5 * sum.radius
            };
            let own = [low - sum.radius, high + sum.radius].map(float::gelu_error);
            // Shut, half open and open places round differently; where the gate is open the rounding
            // grows with the argument, below it is largest at its edges.
            let own = own[0].max(own[1]).max(float::gelu_error(1.5));
            Lane {
                real: (ends[0].min(ends[1]), ends[0].max(ends[2])),
                radius: moved + own + float_error(sum.magnitude() * 2.0),
            }
        }
    }
}

fn integer_output(
    asset: &Asset,
    layer: &Layer,
    parameters: &IntegerParameters,
    (row, lane): (usize, Lane),
    source: Option<Lane>,
) -> Lane {
    let profile = &asset.profile;
    let value = match output_multiplier(layer, parameters, row) {
        Some(multiplier) => through(profile.requantize, lane, multiplier),
        None => lane,
    };
    let skip = layer.skip.zip(source).map(|(skip, source)| {
        through(profile.skip, source, skip.scale).clamped(signed(profile.residual_bits))
    });
    let zero_point = Lane::point(f64::from(parameters.zero_point), 0.0);
    let sum = value.plus(zero_point);
    skip.map_or(sum, |skip| sum.plus(skip))
}

fn half_output(
    asset: &Asset,
    parameters: &HalfParameters,
    lane: Lane,
    source: Option<Lane>,
) -> Lane {
    // Of sums on the way nothing is known of their last bits.
    let partial = |lane: Lane| Partial {
        real: lane.real,
        error: lane.radius,
        variance: 0.0,
        grain: 0.0,
        largest: lane.magnitude(),
    };
    let sum = source.map_or(partial(lane), |source| {
        partial(lane).plus(partial(source), SINGLE)
    });
    let to_lane = |real: f64| match parameters.quantize {
        None => real,
        Some(quantize) => quantized(real, quantize) + f64::from(quantize.zero_point),
    };
    Lane {
        real: (to_lane(sum.real.0), to_lane(sum.real.1)),
        radius: stage::to_register(asset, parameters, sum.magnitude(), sum.error),
    }
}

/// The radius of a channel, from its activated accumulator, and the oracle's real where it is known.
fn channel(asset: &Asset, layer: &Layer, (row, lane): (usize, Lane), known: Option<f64>) -> f64 {
    let format = asset.shape.outputs[row];
    let range = channel_range(format);
    let scaled = |units: f64| Lane {
        real: (lane.real.0 * units, lane.real.1 * units),
        radius: stage::channel(asset, (row, format), lane.magnitude(), lane.radius),
    };
    let channel = match (&layer.parameters, format) {
        (Parameters::Integer(p), OutputFormat::Float16) => {
            scaled(scale(p.scales[row]) * number::HALF_UNITS)
        }
        (
            Parameters::Integer(p),
            OutputFormat::Unorm8 | OutputFormat::Unorm16 | OutputFormat::Snorm8,
        ) => through(asset.profile.output, lane, p.scales[row]),
        (Parameters::Half(_), _) => scaled(channel_units(format)),
    };
    channel.known(known).clamped(range).radius
}

/// A lane after a rescaling.
fn through(requantizer: Requantizer, lane: Lane, multiplier: Multiplier) -> Lane {
    let largest = lane.magnitude();
    let real = (
        rescale(lane.real.0, multiplier),
        rescale(lane.real.1, multiplier),
    );
    if largest < 1.0 {
        // The model's value is an integer, therefore 0, which every requantiser rescales to 0: the
        // distance is that of the real, which lies within the radius of the model's 0.
        let real_magnitude = lane.real.0.abs().max(lane.real.1.abs());
        return Lane {
            real,
            radius: real_magnitude.min(lane.radius) * scale(multiplier),
        };
    }
    let result = (largest * scale(multiplier)).min(2_f64.powi(31));
    let rounded = requantize(requantizer, largest, multiplier) + float_error(result);
    let lane = Lane {
        real,
        radius: lane.radius * scale(multiplier) + rounded,
    };
    lane.loosened(float_error(result))
}
