//! Layer: what happens to an integer layer's accumulators. Their sums are in `dense`.

use ntmu_isa::Asset;
use ntmu_isa::accumulate::signed_range;
use ntmu_isa::activation::{self, Activation};
use ntmu_isa::layer::{IntegerParameters, Layer};
use ntmu_isa::profile::Profile;
use ntmu_isa::rescale::Requantizer;
use ntmu_isa::round::{Rounding, saturate};
use ntmu_isa::shape::LaneFormat;

/// What the accumulators hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Held {
    /// Sums, or sums after a ReLU.
    Sums,
    /// Products of a hard GELU's gate.
    Gated,
    /// Entries of a table: on the scale of the layer's output already.
    LookedUp,
}

pub(super) fn relu(accumulators: &mut [i32]) {
    for accumulator in accumulators {
        *accumulator = (*accumulator).max(0);
    }
}

pub(super) fn leaky(accumulators: &mut [i32], shift: u16, rounding: Rounding) {
    for accumulator in accumulators {
        *accumulator = activation::leak(*accumulator, shift as u8, rounding);
    }
}

pub(super) fn gate(
    accumulators: &mut [i32],
    activation: Activation,
    parameters: &IntegerParameters,
    requantizer: Requantizer,
) {
    let is_clamped = match activation {
        Activation::HardGelu { is_clamped, .. } => is_clamped,
        Activation::Identity | Activation::Relu | Activation::Leaky { .. } | Activation::Table => {
            false
        }
    };
    for (accumulator, &scale) in accumulators.iter_mut().zip(&parameters.scales) {
        let argument = activation::gate_argument(*accumulator, scale, requantizer, is_clamped);
        *accumulator = activation::gate(argument);
    }
}

pub(super) fn table(
    accumulators: &mut [i32],
    parameters: &IntegerParameters,
    requantizer: Requantizer,
) {
    for (accumulator, &scale) in accumulators.iter_mut().zip(&parameters.scales) {
        let index = activation::table_index(*accumulator, scale, requantizer);
        *accumulator = i32::from(parameters.table[index]);
    }
}

/// Accumulators on the scale of the layer's output, zero point included, not yet saturated.
pub(super) fn rescale(
    accumulators: &[i32],
    held: Held,
    layer: &Layer,
    parameters: &IntegerParameters,
    requantizer: Requantizer,
) -> Vec<i64> {
    let rows = accumulators.iter().zip(&parameters.scales);
    rows.map(|(&accumulator, &scale)| {
        let value = match (held, layer.activation) {
            (Held::LookedUp, _) => accumulator,
            (Held::Gated, Activation::HardGelu { scale, .. }) => {
                requantizer.apply(accumulator, scale)
            }
            (Held::Sums | Held::Gated, _) => requantizer.apply(accumulator, scale),
        };
        i64::from(value) + i64::from(parameters.zero_point)
    })
    .collect()
}

/// Adds a skip path's source, less its own zero point, on the scale of the layer's output and
/// within the profile's residual bits.
pub(super) fn add_skip(asset: &Asset, layer: usize, source: &[i16], values: &mut [i64]) {
    let (Some(skip), Some(from)) = (asset.layers[layer].skip, asset.skip_source(layer)) else {
        return;
    };
    let zero_point = match asset.layers[from].output_format() {
        LaneFormat::Integer { zero_point, .. } => i32::from(zero_point),
        LaneFormat::Half => 0,
    };
    let Profile {
        skip: requantizer,
        residual_bits,
        ..
    } = asset.profile;
    let (low, high) = signed_range(residual_bits);
    for (value, &from) in values.iter_mut().zip(source) {
        let term = requantizer.apply(i32::from(from) - zero_point, skip.scale);
        *value += i64::from(saturate(i64::from(term), low, high));
    }
}

pub(super) fn saturate_to(values: Vec<i64>, bits: u8, lanes: &mut [i16]) {
    let (low, high) = signed_range(bits);
    for (lane, value) in lanes.iter_mut().zip(values) {
        *lane = saturate(value, low, high) as i16;
    }
}
