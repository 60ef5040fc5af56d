//! Encoder: CNTC's global transformer and grid constructors, on burn's tensors.
//!
//! The architecture is ELIC's analysis transform (He et al. 2022) without attention and with three
//! of its four halvings: conv 5×5/2, three residual bottleneck blocks, conv 5×5/2, three blocks,
//! conv 5×5/2, ½·tanh; then one 1×1 convolution for each grid. What its planes are is said in
//! [`crate::constructor`].
//!
//! Parameters live in one flat slice, so that they are updated, saved and restored like those of
//! the synthesizer; burn holds them for the length of one pass.

use crate::config::TrainConfig;
use crate::error::TrainError;
use crate::random::Stream;
use burn::tensor::module::conv2d;
use burn::tensor::ops::ConvOptions;
use burn::tensor::{Device, Tensor, TensorData, activation};

/// log2 of the encoder's reduction.
pub(crate) const SCALE_LOG2: u8 = 3;

/// Texels around a position that its latents depend on: 2 + 3·2 + 2·2 + 3·4 + 2·4.
pub(crate) const RECEPTIVE: usize = 32;

/// Residual blocks between two halvings.
const BLOCKS: usize = 3;

/// One convolution.
#[derive(Clone, Copy, Debug)]
struct Conv {
    inputs: usize,
    outputs: usize,
    kernel: usize,
    stride: usize,
    weights_at: usize,
    bias_at: usize,
}

/// The convolutions, and the length of their parameters.
#[derive(Clone, Debug)]
pub(crate) struct Encoder {
    convs: Vec<Conv>,
    pub(crate) parameters: usize,
}

/// A pass whose gradient can still be taken.
pub(crate) struct Pass {
    parameters: Vec<(Tensor<4>, Tensor<1>)>,
    outputs: [Tensor<4>; 2],
}

fn values<const D: usize>(tensor: Tensor<D>) -> Result<Vec<f32>, TrainError> {
    let data = tensor
        .try_into_data()
        .map_err(|e| TrainError::Engine(format!("{e:?}")))?;
    data.try_into_vec()
        .map_err(|e| TrainError::Engine(format!("{e:?}")))
}

impl Encoder {
    /// The encoder of a set of `channels` channels to two grids of `planes` planes.
    pub(crate) fn new(config: &TrainConfig, channels: usize, planes: [usize; 2]) -> Encoder {
        let width = usize::from(config.encoder_width);
        // ELIC's bottleneck has 320 channels at width 192.
        let bottleneck = width * 5 / 3;
        let mut encoder = Encoder {
            convs: Vec::new(),
            parameters: 0,
        };
        for inputs in [channels, width] {
            encoder.push(inputs, width, 5, 2);
            for _ in 0..BLOCKS {
                encoder.push(width, width / 2, 1, 1);
                encoder.push(width / 2, width / 2, 3, 1);
                encoder.push(width / 2, width, 1, 1);
            }
        }
        encoder.push(width, bottleneck, 5, 2);
        for planes in planes {
            encoder.push(bottleneck, planes, 1, 1);
        }
        encoder
    }

    fn push(&mut self, inputs: usize, outputs: usize, kernel: usize, stride: usize) {
        let weights_at = self.parameters;
        let bias_at = weights_at + outputs * inputs * kernel * kernel;
        self.parameters = bias_at + outputs;
        self.convs.push(Conv {
            inputs,
            outputs,
            kernel,
            stride,
            weights_at,
            bias_at,
        });
    }

    /// Initial parameters: uniform after He et al. 2015, biases zero, and the last convolution of
    /// a block at a tenth.
    pub(crate) fn start(&self, stream: Stream) -> Vec<f32> {
        let mut parameters = vec![0.0; self.parameters];
        for (index, conv) in self.convs.iter().enumerate() {
            let fan_in = (conv.inputs * conv.kernel * conv.kernel) as f32;
            // Within a stage: the halving, then three convolutions for each block.
            let (stage, place) = (index / (1 + 3 * BLOCKS), index % (1 + 3 * BLOCKS));
            let ends_block = stage < 2 && place > 0 && place.is_multiple_of(3);
            let damp = if ends_block { 0.1 } else { 1.0 };
            let bound = damp * (6.0 / fan_in).sqrt();
            let weights = &mut parameters[conv.weights_at..conv.bias_at];
            for (at, weight) in (conv.weights_at..).zip(weights) {
                *weight = bound * stream.signed(at as u64);
            }
        }
        parameters
    }

    /// From images, `[item][channel][row][column]` with sides that are multiples of 8, to both
    /// grids as [`Pass::grids`] describes them.
    pub(crate) fn forward(
        &self,
        parameters: &[f32],
        images: Vec<f32>,
        shape: [usize; 4],
        tracked: bool,
    ) -> Pass {
        let device = if tracked {
            Device::flex().autodiff()
        } else {
            Device::flex()
        };
        let parameters: Vec<(Tensor<4>, Tensor<1>)> = self
            .convs
            .iter()
            .map(|c| {
                let weights = parameters[c.weights_at..c.bias_at].to_vec();
                let bias = parameters[c.bias_at..c.bias_at + c.outputs].to_vec();
                let sides = [c.outputs, c.inputs, c.kernel, c.kernel];
                let w = Tensor::<4>::from_data(TensorData::new(weights, sides), &device);
                let b = Tensor::<1>::from_data(TensorData::new(bias, [c.outputs]), &device);
                if tracked {
                    (w.require_grad(), b.require_grad())
                } else {
                    (w, b)
                }
            })
            .collect();
        let images = Tensor::<4>::from_data(TensorData::new(images, shape), &device);
        // In 0..=1 an image is far from having mean zero, which is what the weights expect.
        let mut x = images * 2.0 - 1.0;
        let apply = |x: Tensor<4>, index: usize| {
            let Conv { kernel, stride, .. } = self.convs[index];
            let (w, b) = parameters[index].clone();
            let pad = kernel / 2;
            let options = ConvOptions::new([stride; 2], [pad; 2], [1; 2], 1);
            conv2d(x, w, Some(b), options)
        };
        for stage in 0..2 {
            let first = stage * (1 + 3 * BLOCKS);
            x = apply(x, first);
            for block in 0..BLOCKS {
                let at = first + 1 + 3 * block;
                let y = activation::relu(apply(x.clone(), at));
                let y = activation::relu(apply(y, at + 1));
                x = x + apply(y, at + 2);
            }
        }
        let bottleneck = 2 * (1 + 3 * BLOCKS);
        let z = apply(x, bottleneck).tanh() * 0.5;
        let outputs = [apply(z.clone(), bottleneck + 1), apply(z, bottleneck + 2)];
        Pass {
            parameters,
            outputs,
        }
    }

    /// The gradient of the parameters, given that of both grids in the layout of [`Pass::grids`].
    pub(crate) fn backward(
        &self,
        pass: Pass,
        gradients: [Vec<f32>; 2],
    ) -> Result<Vec<f32>, TrainError> {
        let Pass {
            parameters,
            outputs,
        } = pass;
        let [g0, g1] = gradients;
        let [o0, o1] = outputs;
        // The scalar product with a constant has that constant as its gradient: what the
        // synthesizer computed outside burn enters burn's graph here.
        let product = |output: Tensor<4>, gradient: Vec<f32>| {
            let data = TensorData::new(gradient, output.dims());
            let constant = Tensor::<4>::from_data(data, &output.device());
            (output * constant).sum()
        };
        let mut gradients = (product(o0, g0) + product(o1, g1)).backward();
        let mut flat = vec![0.0; self.parameters];
        for (conv, (w, b)) in self.convs.iter().zip(parameters) {
            if let Some(gradient) = w.grad_remove(&mut gradients) {
                flat[conv.weights_at..conv.bias_at].copy_from_slice(&values(gradient)?);
            }
            if let Some(gradient) = b.grad_remove(&mut gradients) {
                let at = conv.bias_at;
                flat[at..at + conv.outputs].copy_from_slice(&values(gradient)?);
            }
        }
        Ok(flat)
    }
}

impl Pass {
    /// Both grids as reals, `[item][plane][row][column]` at 1/8 of the resolution, not yet limited
    /// to the latents' range: level by level, channel by channel, and within a channel the cells of
    /// a position in reading order.
    pub(crate) fn grids(&self) -> Result<[Vec<f32>; 2], TrainError> {
        let [o0, o1] = &self.outputs;
        Ok([values(o0.clone())?, values(o1.clone())?])
    }
}
