//! Network: a synthesizer ready to run, in reals or in the integers of the decode.
//!
//! Both kinds share the matrix products. They differ in what follows a product, the *epilogue*:
//! in reals the bias and the activation, in integers isa's activation, rescaling, skip path, zero
//! point and saturation. Integers are held in floats: an accumulator is below 2^24 (see
//! [`crate::integer`]), so its products and sums are exact.

use crate::config::ActivationKind;
use crate::kernel::{Vectorised, vectorised};
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
        Network {
            layers: layers.collect(),
            activation: topology.activation,
            low: low.to_vec(),
        }
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
    pub(crate) fn finish(
        &self,
        activation: ActivationKind,
        source: Option<&[f32]>,
        out: &mut [f32],
        slope: &mut [f32],
    ) {
        let bias = self.bias.as_slice();
        match &self.epilogue {
            Epilogue::Real => match source {
                Some(source) => vectorised(RealSkip {
                    bias,
                    source,
                    out,
                    slope,
                }),
                None if !self.shape.activated => each(RealIdentity, bias, out, slope),
                None => match activation {
                    ActivationKind::Relu => each(RealLeaky(0.0), bias, out, slope),
                    ActivationKind::Leaky { shift } => {
                        each(RealLeaky(1.0 / f32::from(1_u8 << shift)), bias, out, slope);
                    }
                    ActivationKind::HardGelu => each(RealGelu, bias, out, slope),
                },
            },
            Epilogue::Integer(r) => {
                let scales = &r.scales[..bias.len()];
                let saturation = Saturation { zero: r.zero_point };
                if let Some(source) = source {
                    vectorised(IntegerSkip {
                        bias,
                        scales,
                        skip: r.skip,
                        saturation,
                        source,
                        out,
                        slope,
                    });
                } else if !r.codes.is_empty() {
                    each(
                        IntegerCodes {
                            scales,
                            codes: &r.codes[..bias.len()],
                        },
                        bias,
                        out,
                        slope,
                    );
                } else if !self.shape.activated {
                    each(
                        IntegerLeaky {
                            scales,
                            saturation,
                            leak: 1.0,
                        },
                        bias,
                        out,
                        slope,
                    );
                } else {
                    match activation {
                        ActivationKind::Relu => {
                            each(
                                IntegerLeaky {
                                    scales,
                                    saturation,
                                    leak: 0.0,
                                },
                                bias,
                                out,
                                slope,
                            );
                        }
                        ActivationKind::Leaky { shift } => {
                            let leak = 1.0 / f64::from(1_u8 << shift);
                            each(
                                IntegerLeaky {
                                    scales,
                                    saturation,
                                    leak,
                                },
                                bias,
                                out,
                                slope,
                            );
                        }
                        ActivationKind::HardGelu => {
                            each(
                                IntegerGelu {
                                    scales,
                                    saturation,
                                    gate: r.gate,
                                },
                                bias,
                                out,
                                slope,
                            );
                        }
                    }
                }
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

/// What happens to one accumulator (bias added) of column `o`: its output and its slope.
trait Element {
    fn of(&self, value: f32, o: usize) -> (f32, f32);
}

struct Each<'a, E> {
    element: E,
    bias: &'a [f32],
    out: &'a mut [f32],
    slope: &'a mut [f32],
}

fn each<E: Element>(element: E, bias: &[f32], out: &mut [f32], slope: &mut [f32]) {
    vectorised(Each {
        element,
        bias,
        out,
        slope,
    });
}

impl<E: Element> Vectorised for Each<'_, E> {
    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let columns = self.bias.len();
        for (out, slope) in self
            .out
            .chunks_exact_mut(columns)
            .zip(self.slope.chunks_exact_mut(columns))
        {
            for o in 0..columns {
                let (value, derivative) = self.element.of(out[o] + self.bias[o], o);
                out[o] = value;
                slope[o] = derivative;
            }
        }
    }
}

struct RealIdentity;

impl Element for RealIdentity {
    #[inline(always)]
    fn of(&self, value: f32, _: usize) -> (f32, f32) {
        (value, 1.0)
    }
}

/// Leaky ReLU with this slope; ReLU is the slope 0.
struct RealLeaky(f32);

impl Element for RealLeaky {
    #[inline(always)]
    fn of(&self, value: f32, _: usize) -> (f32, f32) {
        let slope = if value >= 0.0 { 1.0 } else { self.0 };
        (value * slope, slope)
    }
}

struct RealGelu;

impl Element for RealGelu {
    #[inline(always)]
    fn of(&self, value: f32, _: usize) -> (f32, f32) {
        let gate = (value * (1.0 / 3.0) + 0.5).clamp(0.0, 1.0);
        let inner = if gate > 0.0 && gate < 1.0 {
            value * (1.0 / 3.0)
        } else {
            0.0
        };
        (value * gate, gate + inner)
    }
}

struct RealSkip<'a> {
    bias: &'a [f32],
    source: &'a [f32],
    out: &'a mut [f32],
    slope: &'a mut [f32],
}

impl Vectorised for RealSkip<'_> {
    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let columns = self.bias.len();
        let rows = self
            .out
            .chunks_exact_mut(columns)
            .zip(self.source.chunks_exact(columns));
        for (out, source) in rows {
            for ((out, source), bias) in out.iter_mut().zip(source).zip(self.bias) {
                *out += bias + source;
            }
        }
        self.slope.fill(1.0);
    }
}

/// The end of every hidden layer: zero point, saturation, and the zero point away again.
#[derive(Clone, Copy)]
struct Saturation {
    zero: f64,
}

impl Saturation {
    /// The value without its zero point, and 1 where nothing was cut, 0 elsewhere.
    #[inline(always)]
    fn of(self, value: f64) -> (f32, f32) {
        let (low, high) = (f64::from(ACTIVATION_RANGE.0), f64::from(ACTIVATION_RANGE.1));
        let shifted = value + self.zero;
        let kept = shifted.max(low).min(high);
        (
            (kept - self.zero) as f32,
            if kept == shifted { 1.0 } else { 0.0 },
        )
    }
}

/// Identity (leak 1), ReLU (leak 0) or leaky ReLU, rescaled.
struct IntegerLeaky<'a> {
    scales: &'a [f64],
    saturation: Saturation,
    leak: f64,
}

impl Element for IntegerLeaky<'_> {
    #[inline(always)]
    fn of(&self, value: f32, o: usize) -> (f32, f32) {
        let value = f64::from(value);
        // The rounding of a leak of 1 or 0 changes nothing.
        let (value, leak) = if value >= 0.0 {
            (value, 1.0)
        } else {
            (nearest(value * self.leak), self.leak)
        };
        let (out, inside) = self.saturation.of(nearest(value * self.scales[o]));
        (out, inside * (leak * self.scales[o]) as f32)
    }
}

struct IntegerGelu<'a> {
    scales: &'a [f64],
    saturation: Saturation,
    gate: f64,
}

impl Element for IntegerGelu<'_> {
    #[inline(always)]
    fn of(&self, value: f32, o: usize) -> (f32, f32) {
        let one = f64::from(6 << GATE_FRACTION_BITS);
        let (low, high) = (f64::from(GATE_RANGE.0), f64::from(GATE_RANGE.1));
        let argument = nearest(f64::from(value) * self.scales[o])
            .max(low)
            .min(high);
        let open = 2.0 * argument + one / 2.0;
        let gates = open.max(0.0).min(one);
        let inner = if gates == open { 2.0 * argument } else { 0.0 };
        let (out, inside) = self.saturation.of(nearest(argument * gates * self.gate));
        (
            out,
            inside * ((gates + inner) * self.gate * self.scales[o]) as f32,
        )
    }
}

/// The last layer: codes.
struct IntegerCodes<'a> {
    scales: &'a [f64],
    codes: &'a [(f64, f64)],
}

impl Element for IntegerCodes<'_> {
    #[inline(always)]
    fn of(&self, value: f32, o: usize) -> (f32, f32) {
        let (low, high) = self.codes[o];
        let code = nearest(f64::from(value) * self.scales[o])
            .max(low)
            .min(high);
        (code as f32, self.scales[o] as f32)
    }
}

struct IntegerSkip<'a> {
    bias: &'a [f32],
    scales: &'a [f64],
    skip: f64,
    saturation: Saturation,
    source: &'a [f32],
    out: &'a mut [f32],
    slope: &'a mut [f32],
}

impl Vectorised for IntegerSkip<'_> {
    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let columns = self.bias.len();
        let scales = &self.scales[..columns];
        let rows = self
            .out
            .chunks_exact_mut(columns)
            .zip(self.slope.chunks_exact_mut(columns));
        for ((out, slope), source) in rows.zip(self.source.chunks_exact(columns)) {
            for o in 0..columns {
                let main = nearest(f64::from(out[o] + self.bias[o]) * scales[o]);
                let (value, inside) = self
                    .saturation
                    .of(main + nearest(f64::from(source[o]) * self.skip));
                out[o] = value;
                slope[o] = inside;
            }
        }
    }
}
