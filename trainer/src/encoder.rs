//! Encoder: CNTC's global transformer and grid constructors, on burn's tensors.
//!
//! The architecture is ELIC's analysis transform (He et al. 2022) without attention and with three
//! of its four halvings: conv 5×5/2, three residual bottleneck blocks, conv 5×5/2, three blocks,
//! conv 5×5/2, ½·tanh; then one 1×1 convolution for each grid. What its planes are is said in
//! [`crate::constructor`].
//!
//! Parameters live in one flat slice, so that they are updated, saved and restored like those of
//! the synthesizer. [`crate::encoder_pass`] runs it on the processor; what is here runs it on burn's
//! tensors, on any device.

use crate::config::TrainConfig;
use crate::convolution::Sizes;
use crate::random::Stream;
use burn_tensor::module::conv2d;
use burn_tensor::ops::ConvOptions;
use burn_tensor::{Gradients, Tensor, activation};

/// log2 of the encoder's reduction.
pub(crate) const SCALE_LOG2: u8 = 3;

/// Texels around a position that its latents depend on: 2 + 3·2 + 2·2 + 3·4 + 2·4.
pub(crate) const RECEPTIVE: usize = 32;

/// Residual blocks between two halvings.
pub(crate) const BLOCKS: usize = 3;

/// One convolution.
#[derive(Clone, Copy, Debug)]
struct Conv {
    sizes: Sizes,
    weights_at: usize,
    bias_at: usize,
}

/// The convolutions, and the length of their parameters.
#[derive(Clone, Debug)]
pub(crate) struct Encoder {
    convs: Vec<Conv>,
    pub(crate) parameters: usize,
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
            sizes: Sizes {
                inputs,
                outputs,
                kernel,
                stride,
            },
            weights_at,
            bias_at,
        });
    }

    /// Initial parameters: uniform after He et al. 2015, biases zero, and the last convolution of
    /// a block at a tenth.
    pub(crate) fn start(&self, stream: Stream) -> Vec<f32> {
        let mut parameters = vec![0.0; self.parameters];
        for (index, conv) in self.convs.iter().enumerate() {
            let fan_in = (conv.sizes.inputs * conv.sizes.kernel * conv.sizes.kernel) as f32;
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

    /// From images to both grids, given the weights and biases of every convolution.
    pub(crate) fn run(
        &self,
        parameters: &[(Tensor<4>, Tensor<1>)],
        images: Tensor<4>,
    ) -> [Tensor<4>; 2] {
        // In 0..=1 an image is far from having mean zero, which is what the weights expect.
        let mut x = images * 2.0 - 1.0;
        let apply = |x: Tensor<4>, index: usize| {
            let Sizes { kernel, stride, .. } = self.convs[index].sizes;
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
        [apply(z.clone(), bottleneck + 1), apply(z, bottleneck + 2)]
    }

    /// Where every convolution's weights start in the flat slice and their sides, then the same of
    /// its biases: one after the other without a gap.
    pub(crate) fn places(&self) -> impl Iterator<Item = (usize, [usize; 4], usize, usize)> {
        let place = |c: &Conv| {
            let Sizes {
                inputs,
                outputs,
                kernel,
                ..
            } = c.sizes;
            (
                c.weights_at,
                [outputs, inputs, kernel, kernel],
                c.bias_at,
                outputs,
            )
        };
        self.convs.iter().map(place)
    }

    /// Convolutions.
    pub(crate) const fn count(&self) -> usize {
        self.convs.len()
    }

    /// The sizes of a convolution.
    pub(crate) fn sizes(&self, index: usize) -> Sizes {
        self.convs[index].sizes
    }

    /// The weights and the biases of a convolution.
    pub(crate) fn parts<'a>(&self, index: usize, flat: &'a [f32]) -> (&'a [f32], &'a [f32]) {
        let Conv {
            weights_at,
            bias_at,
            sizes,
        } = self.convs[index];
        (
            &flat[weights_at..bias_at],
            &flat[bias_at..bias_at + sizes.outputs],
        )
    }

    /// [`Encoder::parts`], to be changed.
    pub(crate) fn parts_mut<'a>(
        &self,
        index: usize,
        flat: &'a mut [f32],
    ) -> (&'a mut [f32], &'a mut [f32]) {
        let Conv {
            weights_at,
            bias_at,
            sizes,
        } = self.convs[index];
        let (before, after) = flat.split_at_mut(bias_at);
        (&mut before[weights_at..], &mut after[..sizes.outputs])
    }
}

/// The way back from both grids, given their gradients.
pub(crate) fn backward_from(outputs: [Tensor<4>; 2], gradients: [Tensor<4>; 2]) -> Gradients {
    let ([o0, o1], [g0, g1]) = (outputs, gradients);
    // The scalar product with a constant has that constant as its gradient: what was computed
    // outside burn's graph enters it here.
    ((o0 * g0).sum() + (o1 * g1).sum()).backward()
}
