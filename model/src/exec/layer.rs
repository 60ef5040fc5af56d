//! Layer: multiply, activate, rescale.

use ntmu_isa::Asset;
use ntmu_isa::activation::{self, Activation};
use ntmu_isa::embed::ACTIVATION_RANGE;
use ntmu_isa::layer::Layer;
use ntmu_isa::rescale::Requantizer;
use ntmu_isa::round::{Rounding, saturate};

/// A layer's weights as the datapath multiplies them.
pub(super) struct LayerParameters {
    /// Rows of 16-bit weights: x86 and Arm multiply and add pairs of these in one instruction, and
    /// a product of two signed bytes cannot overflow there.
    weights: Vec<i16>,
}

impl LayerParameters {
    pub(super) fn new(layer: &Layer) -> LayerParameters {
        LayerParameters {
            weights: layer.weights.iter().map(|&w| i16::from(w)).collect(),
        }
    }

    /// Bias plus products. Integer sums that cannot overflow (see `isa::limits`) do not depend on
    /// their order, so the order that the compiler picks is the specified one.
    pub(super) fn dense(&self, layer: &Layer, input: &[i16], accumulators: &mut [i32]) {
        let rows = self.weights.chunks_exact(input.len());
        for ((accumulator, row), &bias) in accumulators.iter_mut().zip(rows).zip(&layer.bias) {
            let products = row
                .iter()
                .zip(input)
                .map(|(&w, &x)| i32::from(w) * i32::from(x));
            *accumulator = bias + products.sum::<i32>();
        }
    }
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

pub(super) fn gate(accumulators: &mut [i32], layer: &Layer, requantizer: Requantizer) {
    for (accumulator, &scale) in accumulators.iter_mut().zip(&layer.scales) {
        let argument = activation::gate_argument(*accumulator, scale, requantizer);
        *accumulator = activation::gate(argument);
    }
}

/// Accumulators on the scale of the layer's output, zero point included, not yet saturated.
pub(super) fn rescale(
    accumulators: &[i32],
    layer: &Layer,
    requantizer: Requantizer,
    is_gated: bool,
) -> Vec<i64> {
    let gate_scale = match layer.activation {
        Activation::HardGelu { scale } if is_gated => Some(scale),
        Activation::HardGelu { .. }
        | Activation::Identity
        | Activation::Relu
        | Activation::Leaky { .. } => None,
    };
    accumulators
        .iter()
        .zip(&layer.scales)
        .map(|(&accumulator, &scale)| {
            let value = requantizer.apply(accumulator, gate_scale.unwrap_or(scale));
            i64::from(value) + i64::from(layer.zero_point)
        })
        .collect()
}

/// Adds the skip path's source, less its own zero point, on the scale of the layer's output.
pub(super) fn add_skip(asset: &Asset, index: usize, source: &[i16], values: &mut [i64]) {
    let Some(skip) = asset.layers[index].skip else {
        return;
    };
    let zero_point = asset.layers[index - usize::from(skip.span)].zero_point;
    for (value, &from) in values.iter_mut().zip(source) {
        let real = i32::from(from) - i32::from(zero_point);
        *value += i64::from(asset.profile.skip.apply(real, skip.scale));
    }
}

pub(super) fn saturate_to(values: Vec<i64>, lanes: &mut [i16]) {
    let (low, high) = ACTIVATION_RANGE;
    for (lane, value) in lanes.iter_mut().zip(values) {
        *lane = saturate(value, low, high) as i16;
    }
}
