//! An fp16 layer: its sums, whether they round, and whether a number saturates.

use super::range::RealRange;
use crate::bound::float::{HALF, Partial, SINGLE, gelu_error, half_ulp};
use crate::bound::stage;
use crate::oracle::number::{LARGEST_HALF, lane_range};
use crate::oracle::synthesizer::{hard_gelu, quantized, weights};
use ntmu_isa::Asset;
use ntmu_isa::activation::Activation;
use ntmu_isa::half::SumOrder;
use ntmu_isa::layer::{HalfParameters, Layer};
use ntmu_isa::shape::OutputFormat;
use serde::Serialize;

/// What is known of an fp16 layer's sums.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HalfSums {
    /// How the profile sums.
    pub order: SumOrder,
    /// The largest magnitude of a sum on its way, in the profile's order.
    pub largest: f64,
    /// A number may go beyond 65504 and saturate: a fused sum on its way, an output on its way to a
    /// register of halves, or a `Float16` channel.
    pub may_saturate: bool,
    /// No addition of any row can round: the order of the sums does not matter.
    pub is_exact: bool,
    /// What the additions of a row can be off by together, at most.
    pub sum_rounding: f64,
    /// Half the distance between fp16 neighbours at the largest output: what the rounding to the
    /// register can be off by. A `sum_rounding` far below says that the order hardly matters.
    pub register_rounding: f64,
    /// Row by row: the sum after all of its products.
    pub rows: Vec<RealRange>,
}

/// A layer that reads a register with these ranges, and the ranges of its outputs (none in the last
/// layer).
pub(super) fn layer(
    asset: &Asset,
    index: usize,
    registers: &[Vec<RealRange>],
) -> Option<(HalfSums, Vec<RealRange>)> {
    let layer = &asset.layers[index];
    let parameters = layer.half()?;
    let format = asset.input_format(index);
    let lanes: Vec<Partial> = registers[index]
        .iter()
        .map(|lane| stage::read(layer, format, (lane.low, lane.high), 0.0))
        .collect();
    let is_last = index + 1 == asset.layers.len();
    let mut known = HalfSums {
        order: asset.profile.sum,
        largest: 0.0,
        may_saturate: false,
        is_exact: true,
        sum_rounding: 0.0,
        register_rounding: 0.0,
        rows: Vec::new(),
    };
    let mut outputs = Vec::new();
    let source = asset.skip_source(index).map(|from| &registers[from + 1]);
    for row in 0..usize::from(layer.outputs) {
        let sum = stage::sum(asset, index, row, &weights(layer, row), &lanes);
        known.largest = known.largest.max(sum.largest);
        known.is_exact &= sum.error == 0.0;
        known.sum_rounding = known.sum_rounding.max(sum.error);
        let mut range = RealRange {
            low: sum.real.0 - sum.error,
            high: sum.real.1 + sum.error,
        };
        if known.order == SumOrder::Fused {
            known.may_saturate |= sum.largest > LARGEST_HALF;
            range = clamped(range, (-LARGEST_HALF, LARGEST_HALF));
        }
        known.rows.push(range);
        let result = skipped(activate(layer, range), source.map(|lanes| lanes[row]));
        let is_half = if is_last {
            asset.shape.outputs[row] == OutputFormat::Float16
        } else {
            parameters.quantize.is_none()
        };
        if is_half {
            known.may_saturate |= result.magnitude() > LARGEST_HALF;
            let rounding = half_ulp(result.magnitude().min(LARGEST_HALF), HALF);
            known.register_rounding = known.register_rounding.max(rounding);
        }
        if !is_last {
            let held = lane_range(layer.output_format());
            outputs.push(clamped(to_register(parameters, result), held));
        }
    }
    Some((known, outputs))
}

fn clamped(range: RealRange, (low, high): (f64, f64)) -> RealRange {
    RealRange {
        low: range.low.clamp(low, high),
        high: range.high.clamp(low, high),
    }
}

fn activate(layer: &Layer, sum: RealRange) -> RealRange {
    let rising = |function: &dyn Fn(f64) -> f64| RealRange {
        low: function(sum.low),
        high: function(sum.high),
    };
    match layer.activation {
        // A validated fp16 layer has no table.
        Activation::Identity | Activation::Table => sum,
        Activation::Relu => rising(&|x| x.max(0.0)),
        Activation::Leaky { shift } => {
            let slope = 2_f64.powi(-i32::from(shift));
            rising(&|x| if x < 0.0 { x * slope } else { x })
        }
        Activation::HardGelu { is_clamped, .. } => {
            let limit = |x: f64| if is_clamped { x.min(3.0) } else { x };
            let (low, high) = (limit(sum.low), limit(sum.high));
            // The product falls to −3/4 and rises from there.
            let lowest = (-0.75_f64).clamp(low, high);
            let error = gelu_error(low).max(gelu_error(high)).max(gelu_error(1.5));
            RealRange {
                low: hard_gelu(lowest) - error,
                high: hard_gelu(low).max(hard_gelu(high)) + error,
            }
        }
    }
}

fn skipped(range: RealRange, source: Option<RealRange>) -> RealRange {
    let Some(source) = source else {
        return range;
    };
    // A rounding never falls, so each end moves by its own.
    let (low, high) = (range.low + source.low, range.high + source.high);
    RealRange {
        low: low - half_ulp(low, SINGLE),
        high: high + half_ulp(high, SINGLE),
    }
}

/// What a register can hold, before it is clamped to its lanes: outwards by the rounding of each end.
fn to_register(parameters: &HalfParameters, range: RealRange) -> RealRange {
    match parameters.quantize {
        None => RealRange {
            low: range.low - half_ulp(range.low, HALF),
            high: range.high + half_ulp(range.high, HALF),
        },
        Some(quantize) => {
            let zero_point = f64::from(quantize.zero_point);
            RealRange {
                low: quantized(range.low, quantize).floor() + zero_point,
                high: quantized(range.high, quantize).ceil() + zero_point,
            }
        }
    }
}
