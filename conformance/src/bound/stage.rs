//! Stage by stage: the admissible |model − oracle|, given the stage's own integer input.
//!
//! Positions, corners, codes and dense layers are exact: their bound is 0 and they have no
//! function here. Each bound is one number per lane, in LSB of the lane.

use super::{float_error, gate_error, requantize, rounding};
use crate::oracle::synthesizer::{output_multiplier, scale};
use ntmu_isa::Asset;
use ntmu_isa::activation::Activation;

/// Fractional bits of an input.
const INPUT_BITS: u32 = 7;
/// Fractional bits of the product of two axis weights.
const WEIGHT_BITS: u32 = 8;

/// The synthesizer's inputs, in units of 1/128.
///
/// * A corner of B bits: exact up to 7; an 8-bit one drops one bit.
/// * An interpolated latent: Σ weight·value has B + 8 fractional bits and drops B + 1 of them.
/// * A wave is a whole number of units: exact.
/// * The level is one rounding to the nearest, whatever the profile says.
#[must_use]
pub fn inputs(asset: &Asset) -> Vec<f64> {
    let shape = &asset.shape;
    let dropped = |grid: usize, more: u32| {
        let bits = u32::from(shape.grids[grid].format.bits());
        rounding(
            asset.profile.input,
            (bits + more).saturating_sub(INPUT_BITS),
        )
    };
    let mut bounds = vec![dropped(0, 0); 4 * usize::from(shape.grids[0].channels)];
    let interpolated = dropped(1, WEIGHT_BITS);
    bounds.extend(vec![interpolated; usize::from(shape.grids[1].channels)]);
    bounds.extend(vec![0.0; usize::from(shape.wave_count())]);
    bounds.push(if shape.mip_count > 1 {
        0.5 + float_error(127.0)
    } else {
        0.0
    });
    bounds
}

/// The activated accumulators of a layer, given its accumulators.
///
/// Identity and ReLU are exact. A leak of 2^−n rounds what is negative and drops n bits. A hard
/// GELU rounds its argument; its product then moves by as much as the gate does between the two
/// arguments, and the gate itself is exact.
#[must_use]
pub fn activated(asset: &Asset, layer: usize, accumulators: &[f64]) -> Vec<f64> {
    let parameters = &asset.layers[layer];
    let rows = accumulators.iter().zip(&parameters.scales);
    rows.map(|(&a, &multiplier)| match parameters.activation {
        Activation::Identity | Activation::Relu => 0.0,
        Activation::Leaky { shift } if a < 0.0 => rounding(asset.profile.leak, u32::from(shift)),
        Activation::Leaky { .. } => 0.0,
        Activation::HardGelu { .. } => {
            let argument = a * scale(multiplier);
            let moved = requantize(asset.profile.requantize, a, multiplier);
            // A product is at most 32768·1536 < 2^26.
            gate_error(argument, moved + float_error(argument)) + float_error(2_f64.powi(26))
        }
    })
    .collect()
}

/// The output of a hidden layer, given its activated accumulators and the values at the start of
/// its skip path: one rescaling, and a second one on the skip path. What is exactly zero stays so.
#[must_use]
pub fn outputs(asset: &Asset, layer: usize, activated: &[f64], source: Option<&[f64]>) -> Vec<f64> {
    let parameters = &asset.layers[layer];
    let mut bounds = rescaled(asset, layer, asset.profile.requantize, activated);
    if let (Some(skip), Some(source)) = (parameters.skip, source) {
        let zero_point = layer
            .checked_sub(usize::from(skip.span))
            .map_or(0.0, |from| f64::from(asset.layers[from].zero_point));
        for (bound, from) in bounds.iter_mut().zip(source) {
            let value = from - zero_point;
            *bound += one(asset.profile.skip, value, skip.scale);
        }
    }
    bounds
}

/// The channel codes, given the last layer's activated accumulators: one rescaling.
#[must_use]
pub fn channels(asset: &Asset, activated: &[f64]) -> Vec<f64> {
    rescaled(
        asset,
        asset.layers.len() - 1,
        asset.profile.output,
        activated,
    )
}

fn rescaled(
    asset: &Asset,
    layer: usize,
    requantizer: ntmu_isa::rescale::Requantizer,
    activated: &[f64],
) -> Vec<f64> {
    let parameters = &asset.layers[layer];
    let rows = activated.iter().enumerate();
    rows.map(|(row, &a)| one(requantizer, a, output_multiplier(parameters, row)))
        .collect()
}

/// One rescaling of one value; zero is rescaled to zero by every requantiser.
pub(super) fn one(
    requantizer: ntmu_isa::rescale::Requantizer,
    value: f64,
    multiplier: ntmu_isa::rescale::Multiplier,
) -> f64 {
    if value == 0.0 {
        0.0
    } else {
        let result = (value * scale(multiplier)).abs().min(2_f64.powi(31));
        requantize(requantizer, value, multiplier) + float_error(result)
    }
}
