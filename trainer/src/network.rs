//! Network: a synthesizer ready to run, in reals or in the integers of the decode.
//!
//! Both kinds share the matrix products. They differ in what follows a product, the *epilogue*:
//! in reals the bias and the activation, in integers isa's activation, rescaling, skip path, zero
//! point and saturation. Integers are held in floats: an accumulator is below 2^24 (see
//! [`crate::integer`]), so its products and sums are exact.

use crate::config::ActivationKind;
use crate::topology::{LayerShape, Topology};
use ntmu_isa::activation::{GATE_FRACTION_BITS, GATE_RANGE};
use ntmu_isa::embed::ACTIVATION_RANGE;

/// What follows the product of a layer.
#[derive(Clone, Debug)]
pub(crate) enum Epilogue {
    /// Bias and activation.
    Real,
    /// Bias, activation, rescaling, skip path, zero point, saturation.
    Integer(Rescaling),
}

/// The integers of one layer's epilogue, held in floats.
///
/// Every scale is the real of an isa multiplier with at most 24 significant bits, so that its
/// product with an accumulator below 2^24 is exact in a double.
#[derive(Clone, Debug)]
pub(crate) struct Rescaling {
    /// Accumulator to output, one for each padded row; 0 in the padding.
    pub(crate) scales: Vec<f64>,
    /// From a hard GELU's product to the output.
    pub(crate) gate: f64,
    /// From the skip path's source to the output.
    pub(crate) skip: f64,
    /// The value that stands for zero.
    pub(crate) zero_point: f64,
    /// In the last layer: the smallest and the largest code of each channel (0 in the padding).
    pub(crate) codes: Vec<(f64, f64)>,
}

/// One layer of a [`Network`].
#[derive(Clone, Debug)]
pub(crate) struct Prepared {
    pub(crate) shape: LayerShape,
    /// Inputs × outputs, padded: for the way forward.
    pub(crate) weights: Vec<f32>,
    /// Outputs × inputs, padded: for the way back.
    pub(crate) transposed: Vec<f32>,
    pub(crate) bias: Vec<f32>,
    pub(crate) epilogue: Epilogue,
}

/// A synthesizer ready to run.
#[derive(Clone, Debug)]
pub(crate) struct Network {
    pub(crate) layers: Vec<Prepared>,
    pub(crate) activation: ActivationKind,
    /// The smallest real of each channel; the largest is 1.
    pub(crate) low: Vec<f32>,
}

impl Network {
    /// The network in reals with these parameters.
    pub(crate) fn real(topology: &Topology, parameters: &[f32], low: &[f32]) -> Network {
        let layers = topology.layers.iter().map(|shape| {
            let weights = shape.weights(parameters).to_vec();
            Prepared {
                shape: *shape,
                transposed: transpose(&weights, shape.rows(), shape.columns()),
                weights,
                bias: shape.bias(parameters).to_vec(),
                epilogue: Epilogue::Real,
            }
        });
        Network { layers: layers.collect(), activation: topology.activation, low: low.to_vec() }
    }
}

pub(crate) fn transpose(matrix: &[f32], rows: usize, columns: usize) -> Vec<f32> {
    let mut out = vec![0.0; matrix.len()];
    for (r, row) in matrix.chunks_exact(columns).enumerate() {
        for (c, &value) in row.iter().enumerate() {
            out[c * rows + r] = value;
        }
    }
    out
}

/// A rounding to the nearest integer, ties up: isa's `HalfUp` and `Requantizer::Single`.
#[inline(always)]
fn nearest(value: f64) -> f64 {
    (value + 0.5).floor()
}

impl Prepared {
    /// Turns the products in `out` into the layer's outputs, and leaves in `slope` the derivative
    /// of an output by its accumulator (where a skip path ends: by the sum before saturation).
    ///
    /// Integer outputs are kept without their zero point: value − zero_point.
    #[inline(always)]
    pub(crate) fn finish(
        &self,
        activation: ActivationKind,
        source: Option<&[f32]>,
        out: &mut [f32],
        slope: &mut [f32],
    ) {
        match &self.epilogue {
            Epilogue::Real => self.finish_real(activation, source, out, slope),
            Epilogue::Integer(rescaling) => {
                self.finish_integer(rescaling, activation, source, out, slope);
            }
        }
    }

    #[inline(always)]
    fn finish_real(
        &self,
        activation: ActivationKind,
        source: Option<&[f32]>,
        out: &mut [f32],
        slope: &mut [f32],
    ) {
        if let Some(source) = source {
            let columns = self.bias.len();
            let rows = out.chunks_exact_mut(columns).zip(source.chunks_exact(columns));
            for (out, source) in rows {
                for ((out, source), bias) in out.iter_mut().zip(source).zip(&self.bias) {
                    *out += bias + source;
                }
            }
            slope.fill(1.0);
            return;
        }
        if !self.shape.activated {
            self.each(out, slope, |v, _| (v, 1.0));
            return;
        }
        match activation {
            ActivationKind::Relu => {
                self.each(out, slope, |v, _| if v > 0.0 { (v, 1.0) } else { (0.0, 0.0) });
            }
            ActivationKind::Leaky { shift } => {
                let leak = 1.0 / f32::from(1_u8 << shift);
                self.each(out, slope, |v, _| if v >= 0.0 { (v, 1.0) } else { (v * leak, leak) });
            }
            ActivationKind::HardGelu => self.each(out, slope, |v, _| {
                let gate = (v * (1.0 / 3.0) + 0.5).clamp(0.0, 1.0);
                let inner = if gate > 0.0 && gate < 1.0 { v * (1.0 / 3.0) } else { 0.0 };
                (v * gate, gate + inner)
            }),
        }
    }

    #[inline(always)]
    fn finish_integer(
        &self,
        rescaling: &Rescaling,
        activation: ActivationKind,
        source: Option<&[f32]>,
        out: &mut [f32],
        slope: &mut [f32],
    ) {
        let scales = &rescaling.scales[..self.bias.len()];
        if !rescaling.codes.is_empty() {
            let codes = &rescaling.codes[..self.bias.len()];
            self.each(out, slope, |v, o| {
                let code = nearest(f64::from(v) * scales[o]).clamp(codes[o].0, codes[o].1);
                (code as f32, scales[o] as f32)
            });
            return;
        }
        let zero = rescaling.zero_point;
        let (low, high) = (f64::from(ACTIVATION_RANGE.0), f64::from(ACTIVATION_RANGE.1));
        // The value saturated and without its zero point; and whether it was inside.
        let saturate = |value: f64| {
            let shifted = value + zero;
            let inside = shifted >= low && shifted <= high;
            ((shifted.clamp(low, high) - zero) as f32, inside)
        };
        if let Some(source) = source {
            let columns = self.bias.len();
            let rows = out.chunks_exact_mut(columns).zip(slope.chunks_exact_mut(columns));
            for ((out, slope), source) in rows.zip(source.chunks_exact(columns)) {
                for o in 0..columns {
                    let main = nearest(f64::from(out[o] + self.bias[o]) * scales[o]);
                    let (value, inside) = saturate(main + nearest(f64::from(source[o]) * rescaling.skip));
                    out[o] = value;
                    slope[o] = if inside { 1.0 } else { 0.0 };
                }
            }
            return;
        }
        let plain = |v: f64, o: usize, leak: f64| {
            let (value, inside) = saturate(nearest(v * scales[o]));
            (value, if inside { (leak * scales[o]) as f32 } else { 0.0 })
        };
        if !self.shape.activated {
            self.each(out, slope, |v, o| plain(f64::from(v), o, 1.0));
            return;
        }
        match activation {
            ActivationKind::Relu => self.each(out, slope, |v, o| {
                let open = if v > 0.0 { 1.0 } else { 0.0 };
                plain(f64::from(v) * open, o, open)
            }),
            ActivationKind::Leaky { shift } => {
                let leak = 1.0 / f64::from(1_u8 << shift);
                self.each(out, slope, |v, o| {
                    let v = f64::from(v);
                    if v >= 0.0 { plain(v, o, 1.0) } else { plain(nearest(v * leak), o, leak) }
                });
            }
            ActivationKind::HardGelu => {
                let one = f64::from(6 << GATE_FRACTION_BITS);
                let range = (f64::from(GATE_RANGE.0), f64::from(GATE_RANGE.1));
                self.each(out, slope, |v, o| {
                    let argument = nearest(f64::from(v) * scales[o]).clamp(range.0, range.1);
                    let open = 2.0 * argument + one / 2.0;
                    let gates = open.clamp(0.0, one);
                    let inner = if open > 0.0 && open < one { 2.0 * argument } else { 0.0 };
                    let (value, inside) = saturate(nearest(argument * gates * rescaling.gate));
                    let slope = (gates + inner) * rescaling.gate * scales[o];
                    (value, if inside { slope as f32 } else { 0.0 })
                });
            }
        }
    }

    /// `f` of every accumulator (bias added) and its column.
    #[inline(always)]
    fn each(&self, out: &mut [f32], slope: &mut [f32], f: impl Fn(f32, usize) -> (f32, f32)) {
        let columns = self.bias.len();
        for (out, slope) in out.chunks_exact_mut(columns).zip(slope.chunks_exact_mut(columns)) {
            for o in 0..columns {
                (out[o], slope[o]) = f(out[o] + self.bias[o], o);
            }
        }
    }

    /// How much a skip path's source counts, and how much the layer's own rows.
    pub(crate) fn skip_gains(&self) -> (f32, Option<&[f64]>) {
        match &self.epilogue {
            Epilogue::Real => (1.0, None),
            Epilogue::Integer(rescaling) => (rescaling.skip as f32, Some(&rescaling.scales)),
        }
    }

    /// In the last layer: the largest code of a channel, or 1 for reals.
    #[inline(always)]
    pub(crate) fn unit(&self, channel: usize) -> f32 {
        match &self.epilogue {
            Epilogue::Real => 1.0,
            Epilogue::Integer(rescaling) => rescaling.codes[channel].1 as f32,
        }
    }
}
