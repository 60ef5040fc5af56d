//! Integers: the integer layer that real parameters stand for.
//!
//! ```text
//! w[row] = max |W[row]| / (2^(bits−1) − 1)        the scale of a row's weights; or less, see below
//! q      = round(W / w)                           its stored weights
//! a      = w · s_in                               the scale of its accumulator
//! bias   = round(b / a)                           before the input's zero point is folded in
//! scale  = a / s_out                              as an isa multiplier with 24 significant bits
//! ```
//!
//! Weights of fewer than 8 bits take the scale with the least squared rounding error among 2^(k/8)
//! up to one octave below that of the largest weight, which is then cut. Steps of the scale, because
//! one that follows the largest weight moves the whole row at every step of training.

use crate::choices::ActivationKind;
use crate::config::BIAS_LIMIT;
use crate::epilogue::integer::Saturation;
use crate::network::{Epilogue, Prepared, Rescaling, transpose};
use crate::quantise::Context;
use ntmu_isa::activation::GATE_FRACTION_BITS;

/// The largest bias before the zero point is folded in. With it an accumulator stays below 2^24,
/// where floats are exact, which a valid configuration promises.
const MOST_BIAS: f32 = BIAS_LIMIT as f32;

/// The smallest scale: a multiplier expresses no less than 2^−32.
const LEAST_SCALE: f64 = 1.0 / (1_u64 << 31) as f64;

/// The integer layer, and one over the scale of each row's weights (0 in the padding).
pub(crate) fn integer_layer(context: &Context<'_>) -> (Prepared, Vec<f32>) {
    let Context {
        topology,
        ranges,
        widths,
        outputs,
        index,
        shape,
        weights: source,
        bias,
        input_scale: s_in,
    } = *context;
    let largest = f32::from((1_i16 << (widths.weight - 1)) - 1);
    let (rows, columns) = (shape.rows(), shape.columns());
    let gated = shape.activated
        && match topology.activation {
            ActivationKind::HardGelu | ActivationKind::ClampedHardGelu => true,
            ActivationKind::Relu | ActivationKind::Leaky { .. } => false,
        };
    let range = context.range();
    // What the rescaled accumulator counts: 1/s_out for a hidden layer, codes for the last,
    // 2^8 for the argument of a hard GELU.
    let target = |o: usize| match range {
        _ if gated => f64::from(1_u16 << GATE_FRACTION_BITS),
        Some(range) => 1.0 / f64::from(range.scale),
        None => f64::from(outputs[o].range().1),
    };
    let fitting = fitting_scales(source, columns, largest);
    let mut scale = vec![0.0_f32; columns];
    let mut rescale = vec![0.0_f64; columns];
    for o in 0..shape.outputs {
        // A row of zeros, or one whose bias outweighs its weights, takes the coarser scale.
        let least = LEAST_SCALE / (f64::from(s_in) * target(o));
        scale[o] = fitting[o]
            .max(bias[o].abs() / (s_in * MOST_BIAS))
            .max(least as f32);
        rescale[o] = f64::from((f64::from(scale[o]) * f64::from(s_in) * target(o)) as f32);
    }
    let reciprocal: Vec<f32> = scale
        .iter()
        .map(|&s| if s > 0.0 { 1.0 / s } else { 0.0 })
        .collect();
    let mut weights = source.to_vec();
    for row in weights.chunks_exact_mut(columns) {
        for (w, r) in row.iter_mut().zip(&reciprocal) {
            *w = (*w * r).round().clamp(-largest, largest);
        }
    }
    let integer_bias: Vec<f32> = bias
        .iter()
        .zip(&reciprocal)
        .map(|(b, r)| (b * r / s_in).round().clamp(-MOST_BIAS, MOST_BIAS))
        .collect();
    let s_out = range.map_or(1.0, |r| r.scale);
    let gate = 1.0 / (6.0 * f64::from(1_u32 << (2 * GATE_FRACTION_BITS)) * f64::from(s_out));
    let skip = shape
        .skip
        .map_or(0.0, |span| f64::from(ranges[index - span].scale / s_out));
    let layer = Prepared {
        shape,
        transposed: transpose(&weights, rows, columns),
        weights,
        bias: integer_bias,
        epilogue: Epilogue::Integer(Rescaling {
            scales: rescale,
            gate: f64::from(gate as f32),
            skip,
            saturation: Saturation {
                zero: range.map_or(0.0, |r| f64::from(r.zero_point)),
                range: widths.lanes(),
            },
            codes: context.codes(),
        }),
    };
    (layer, reciprocal)
}

/// The scale for each row's weights, of which the integers are −largest..=largest.
fn fitting_scales(source: &[f32], columns: usize, largest: f32) -> Vec<f32> {
    let mut scales = vec![0.0_f32; columns];
    for row in source.chunks_exact(columns) {
        for (scale, w) in scales.iter_mut().zip(row) {
            *scale = scale.max(w.abs() / largest);
        }
    }
    if largest < f32::from(i8::MAX) {
        for (o, scale) in scales.iter_mut().enumerate().filter(|(_, s)| **s > 0.0) {
            *scale = least_error(source.iter().skip(o).step_by(columns), *scale, largest);
        }
    }
    scales
}

/// Steps of a scale in an octave.
const STEPS_OF_OCTAVE: u8 = 8;

/// Among the steps from the one above `whole` down to an octave below, the scale that rounds these
/// weights best.
fn least_error<'a>(
    weights: impl Iterator<Item = &'a f32> + Clone,
    whole: f32,
    largest: f32,
) -> f32 {
    let steps = f32::from(STEPS_OF_OCTAVE);
    let above = (whole.log2() * steps).ceil();
    let mut best = (f32::INFINITY, whole);
    for below in 0..STEPS_OF_OCTAVE {
        let scale = ((above - f32::from(below)) / steps).exp2();
        let errors = weights.clone().map(|w| {
            let stored = (w / scale).round().clamp(-largest, largest);
            (w - stored * scale).powi(2)
        });
        let error = errors.sum();
        if error < best.0 {
            best = (error, scale);
        }
    }
    best.1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_even_row_keeps_its_largest_weight_and_a_lone_one_is_cut() {
        let even: Vec<f32> = (-100..=100).map(|i| i as f32 / 100.0).collect();
        let scale = least_error(even.iter(), 1.0 / 7.0, 7.0);
        assert!((0.9..=1.1).contains(&(scale * 7.0)), "{scale}");
        let lone: Vec<f32> = even.iter().copied().chain([1.6]).collect();
        let scale = least_error(lone.iter(), 1.6 / 7.0, 7.0);
        assert!((0.9..=1.2).contains(&(scale * 7.0)), "{scale}");
    }
}
