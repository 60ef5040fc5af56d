//! Network: a synthesizer ready to run, in reals or in the numbers of the decode.
//!
//! All kinds of layers share the matrix products. They differ in what follows a product, the
//! *epilogue*: in reals the bias and the activation, in integers isa's activation, rescaling, skip
//! path, zero point and saturation, in fp16 isa's f32 activation and the rounding. Integers are
//! held in floats: an accumulator is below 2^24 (see [`crate::integer`]), so its products and sums
//! are exact. A sum of an fp16 layer starts with its bias, as isa's does, and goes on in the same
//! order, so it has the same bits.

use crate::choices::ActivationKind;
use crate::epilogue::each;
use crate::epilogue::half::{Ending, finish_half};
use crate::epilogue::integer::{IntegerCodes, IntegerGelu, IntegerLeaky, IntegerSkip, Saturation};
use crate::epilogue::real::{RealClampedGelu, RealGelu, RealIdentity, RealLeaky, RealSkip};
use crate::kernel::vectorised;
use crate::topology::{LayerShape, Topology};

/// What follows the product of a layer.
#[derive(Clone, Debug)]
pub(crate) enum Epilogue {
    /// Bias and activation.
    Real,
    /// Bias, activation, rescaling, skip path, zero point, saturation.
    Integer(Rescaling),
    /// Activation, skip path, rounding; the sum started with the bias.
    Half(Halves),
}

/// The numbers of an fp16 layer beside its weights and biases.
#[derive(Clone, Debug)]
pub(crate) struct Halves {
    /// One unit of the register that the layer reads, as the half that it reads: 2^−(bits − 1) for
    /// integers, 1 for halves. The weights contain it: it is a power of two, so products keep
    /// their bits.
    pub(crate) read: f32,
    pub(crate) ending: Ending,
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
    /// The ends of the output's lanes, and the value that stands for zero.
    pub(crate) saturation: Saturation,
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
                    ActivationKind::ClampedHardGelu => each(RealClampedGelu, bias, out, slope),
                },
            },
            Epilogue::Integer(r) => match source {
                Some(source) => vectorised(IntegerSkip {
                    bias,
                    scales: &r.scales[..bias.len()],
                    skip: r.skip,
                    saturation: r.saturation,
                    source,
                    out,
                    slope,
                }),
                None => self.finish_integer(r, activation, out, slope),
            },
            Epilogue::Half(halves) => {
                let activation = self.shape.activated.then_some(activation);
                finish_half(&halves.ending, activation, source, bias.len(), out, slope);
            }
        }
    }

    fn finish_integer(
        &self,
        r: &Rescaling,
        activation: ActivationKind,
        out: &mut [f32],
        slope: &mut [f32],
    ) {
        let bias = self.bias.as_slice();
        let (scales, saturation) = (&r.scales[..bias.len()], r.saturation);
        let leaky = |leak| IntegerLeaky {
            scales,
            saturation,
            leak,
        };
        if !r.codes.is_empty() {
            let codes = &r.codes[..bias.len()];
            each(IntegerCodes { scales, codes }, bias, out, slope);
            return;
        }
        if !self.shape.activated {
            each(leaky(1.0), bias, out, slope);
            return;
        }
        let gate = r.gate;
        match activation {
            ActivationKind::Relu => each(leaky(0.0), bias, out, slope),
            ActivationKind::Leaky { shift } => {
                each(leaky(1.0 / f64::from(1_u8 << shift)), bias, out, slope);
            }
            ActivationKind::HardGelu => {
                let gelu = IntegerGelu::<false> {
                    scales,
                    saturation,
                    gate,
                };
                each(gelu, bias, out, slope);
            }
            ActivationKind::ClampedHardGelu => {
                let gelu = IntegerGelu::<true> {
                    scales,
                    saturation,
                    gate,
                };
                each(gelu, bias, out, slope);
            }
        }
    }

    /// What every sum starts with, where that is not zero.
    pub(crate) fn sums_start_with(&self) -> Option<&[f32]> {
        match &self.epilogue {
            Epilogue::Real | Epilogue::Integer(_) => None,
            Epilogue::Half(_) => Some(&self.bias),
        }
    }

    /// How much a skip path's source counts, and how much the layer's own rows.
    pub(crate) fn skip_gains(&self) -> (f32, Option<&[f64]>) {
        match &self.epilogue {
            Epilogue::Real | Epilogue::Half(_) => (1.0, None),
            Epilogue::Integer(rescaling) => (rescaling.skip as f32, Some(&rescaling.scales)),
        }
    }

    /// In the last layer: the largest code of a channel, or 1 for reals.
    #[inline(always)]
    pub(crate) fn unit(&self, channel: usize) -> f32 {
        match &self.epilogue {
            Epilogue::Real => 1.0,
            Epilogue::Integer(rescaling) => rescaling.codes[channel].1 as f32,
            Epilogue::Half(halves) => match &halves.ending {
                Ending::Codes(codes) => codes[channel].1 as f32,
                Ending::Round | Ending::Quantise { .. } => 1.0,
            },
        }
    }
}
