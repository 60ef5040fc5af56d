//! The integer synthesizer that real parameters stand for.
//!
//! ```text
//! w[row] = max |W[row]| / (2^(bits−1) − 1)        the scale of a row's weights
//! q      = round(W / w)                           its stored weights
//! a      = w · s_in                               the scale of its accumulator
//! bias   = round(b / a)                           before the input's zero point is folded in
//! scale  = a / s_out                              as an isa multiplier with 24 significant bits
//! ```
//!
//! Training computes with these very integers and passes gradients straight through every
//! rounding; the export writes the same integers down.

use crate::config::ActivationKind;
use crate::network::{Epilogue, Network, Prepared, Rescaling, transpose};
use crate::topology::Topology;
use ntmu_isa::activation::GATE_FRACTION_BITS;
use ntmu_isa::embed::INPUT_FRACTION_BITS;
use ntmu_isa::shape::OutputFormat;

/// The largest bias before the zero point is folded in. With it and at most
/// [`crate::config::WIDEST`] products of a weight (127) and an input without its zero point (255),
/// an accumulator stays below 2^24, where floats are exact.
const BIAS_LIMIT: f32 = (1 << 22) as f32;

/// The smallest scale: a multiplier expresses no less than 2^−32.
const LEAST_SCALE: f64 = 1.0 / (1_u64 << 31) as f64;

/// The scale and zero point of a hidden layer's outputs: real = scale · (value − zero_point).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Range {
    pub(crate) scale: f32,
    pub(crate) zero_point: i16,
}

/// An integer network and what its gradients need to become gradients of real parameters.
#[derive(Clone, Debug)]
pub(crate) struct Quantised {
    pub(crate) network: Network,
    /// For each layer, one over the scale of each row's weights (0 in the padding).
    inverse: Vec<Vec<f32>>,
    /// For each layer, the scale of its input.
    input_scale: Vec<f32>,
}

/// The integer network of `parameters`.
pub(crate) fn quantise(
    topology: &Topology,
    parameters: &[f32],
    ranges: &[Range],
    weight_bits: u8,
    outputs: &[OutputFormat],
) -> Quantised {
    let largest = f32::from((1_i16 << (weight_bits - 1)) - 1);
    let last = topology.layers.len() - 1;
    let mut input_scale = vec![1.0 / f32::from(1_u8 << INPUT_FRACTION_BITS)];
    input_scale.extend(ranges.iter().map(|r| r.scale));
    let mut inverse = Vec::new();
    let mut layers = Vec::new();
    for (index, shape) in topology.layers.iter().enumerate() {
        let (rows, columns) = (shape.rows(), shape.columns());
        let (source, bias) = (shape.weights(parameters), shape.bias(parameters));
        let s_in = input_scale[index];
        let gated = shape.activated && topology.activation == ActivationKind::HardGelu;
        // What the rescaled accumulator counts: 1/s_out for a hidden layer, codes for the last,
        // 2^8 for the argument of a hard GELU.
        let target = |o: usize| match ranges.get(index) {
            _ if gated => f64::from(1_u16 << GATE_FRACTION_BITS),
            Some(range) => 1.0 / f64::from(range.scale),
            None => f64::from(outputs[o].range().1),
        };
        let mut greatest = vec![0.0_f32; columns];
        for row in source.chunks_exact(columns) {
            for (g, w) in greatest.iter_mut().zip(row) {
                *g = g.max(w.abs());
            }
        }
        let mut scale = vec![0.0_f32; columns];
        let mut rescale = vec![0.0_f64; columns];
        for o in 0..shape.outputs {
            // A row of zeros, or one whose bias outweighs its weights, takes the coarser scale.
            let least = LEAST_SCALE / (f64::from(s_in) * target(o));
            scale[o] = (greatest[o] / largest)
                .max(bias[o].abs() / (s_in * BIAS_LIMIT))
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
            .map(|(b, r)| (b * r / s_in).round().clamp(-BIAS_LIMIT, BIAS_LIMIT))
            .collect();
        let mut codes = Vec::new();
        if index == last {
            codes = outputs
                .iter()
                .map(|o| o.range())
                .map(|(l, h)| (f64::from(l), f64::from(h)))
                .collect();
            codes.resize(columns, (0.0, 0.0));
        }
        let range = ranges.get(index);
        let s_out = range.map_or(1.0, |r| r.scale);
        let gate = 1.0 / (6.0 * f64::from(1_u32 << (2 * GATE_FRACTION_BITS)) * f64::from(s_out));
        let skip = shape
            .skip
            .map_or(0.0, |span| f64::from(ranges[index - span].scale / s_out));
        layers.push(Prepared {
            shape: *shape,
            transposed: transpose(&weights, rows, columns),
            weights,
            bias: integer_bias,
            epilogue: Epilogue::Integer(Rescaling {
                scales: rescale,
                gate: f64::from(gate as f32),
                skip,
                zero_point: range.map_or(0.0, |r| f64::from(r.zero_point)),
                codes,
            }),
        });
        inverse.push(reciprocal);
    }
    let low = outputs
        .iter()
        .map(|&o| crate::source::real_range(o).0)
        .collect();
    let network = Network {
        layers,
        activation: topology.activation,
        low,
    };
    Quantised {
        network,
        inverse,
        input_scale,
    }
}

impl Quantised {
    /// Turns the gradient of the integers into that of the real parameters, straight through the
    /// roundings.
    pub(crate) fn to_real_gradient(&self, topology: &Topology, gradient: &mut [f32]) {
        for (index, shape) in topology.layers.iter().enumerate() {
            let inverse = &self.inverse[index];
            let weights = &mut gradient[shape.weights_at..shape.bias_at];
            for row in weights.chunks_exact_mut(shape.columns()) {
                for (g, r) in row.iter_mut().zip(inverse) {
                    *g *= r;
                }
            }
            let bias = &mut gradient[shape.bias_at..shape.bias_at + shape.columns()];
            for (g, r) in bias.iter_mut().zip(inverse) {
                *g *= r / self.input_scale[index];
            }
        }
    }
}
