//! Convolution on the processor, with this crate's own matrix products.
//!
//! With the channels of a position together and a border of zeros, the product of a kernel's tap
//! with a row of positions is a product of matrices in place: positions × inputs, each position a
//! row, times inputs × outputs. Nothing is copied to columns first. A kernel at every second
//! position becomes four at every position of the four parities of the image (see [`Field`]).

mod field;
#[cfg(test)]
mod tests;

pub(crate) use field::Field;

use crate::config::CHUNKS;
use crate::kernel::{padded, product, product_transposed};
use crate::network::transpose;
use rayon::prelude::*;

/// The sizes of a convolution: 1×1 or 3×3 at every position, or 5×5 at every second one, around
/// the position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Sizes {
    pub(crate) inputs: usize,
    pub(crate) outputs: usize,
    pub(crate) kernel: usize,
    pub(crate) stride: usize,
}

/// One element of a kernel: the plane that it reads, and how far from the border's start.
#[derive(Clone, Copy, Debug)]
struct Tap {
    plane: usize,
    row: usize,
    column: usize,
}

/// What happens to a sum.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Ending<'a> {
    Nothing,
    Relu,
    /// A field is added.
    Skip(&'a Field),
}

/// A convolution ready to run.
#[derive(Clone, Debug)]
pub(crate) struct Convolution {
    sizes: Sizes,
    taps: Vec<Tap>,
    /// Channels of the input and of the output, padded.
    channels: [usize; 2],
    /// Taps × inputs × outputs, padded.
    weights: Vec<f32>,
    /// Taps × outputs × inputs, padded.
    transposed: Vec<f32>,
    bias: Vec<f32>,
}

impl Sizes {
    /// The border of its input, and of its output's gradient.
    pub(crate) const fn border(&self) -> usize {
        if self.kernel > 1 { 1 } else { 0 }
    }

    const fn planes(&self) -> usize {
        self.stride * self.stride
    }
}

impl Convolution {
    /// With weights `[output][input][row][column]` and biases, for fields of `channels` channels.
    pub(crate) fn new(sizes: Sizes, channels: usize, weights: &[f32], bias: &[f32]) -> Convolution {
        let Sizes {
            inputs,
            outputs,
            kernel,
            stride,
        } = sizes;
        let tap = |at: usize| {
            let (row, column) = (at / kernel, at % kernel);
            Tap {
                plane: row % stride * stride + column % stride,
                row: row / stride,
                column: column / stride,
            }
        };
        let taps: Vec<Tap> = (0..kernel * kernel).map(tap).collect();
        let columns = padded(outputs);
        let len = channels * columns;
        let mut packed = vec![0.0; taps.len() * len];
        for output in 0..outputs {
            for input in 0..inputs {
                let of_taps = &weights[(output * inputs + input) * taps.len()..][..taps.len()];
                for (tap, &weight) in of_taps.iter().enumerate() {
                    packed[tap * len + input * columns + output] = weight;
                }
            }
        }
        let transposed = packed.chunks_exact(len);
        let transposed = transposed.flat_map(|tap| transpose(tap, channels, columns));
        let mut padded_bias = bias.to_vec();
        padded_bias.resize(columns, 0.0);
        Convolution {
            sizes,
            taps,
            channels: [channels, columns],
            transposed: transposed.collect(),
            weights: packed,
            bias: padded_bias,
        }
    }

    /// Channels of the output, padded.
    pub(crate) const fn output_channels(&self) -> usize {
        self.channels[1]
    }

    /// The output, as a field with this border. The input has the border of [`Sizes::border`].
    pub(crate) fn forward(&self, input: &Field, ending: Ending<'_>, border: usize) -> Field {
        let [inputs, outputs] = self.channels;
        let sides = (input.rows, input.columns);
        let mut out = Field::zero((input.items, 1), sides, border, outputs);
        out.fill(|item, _, row, sums| {
            match ending {
                Ending::Nothing | Ending::Relu => {
                    for sums in sums.chunks_exact_mut(outputs) {
                        sums.copy_from_slice(&self.bias);
                    }
                }
                Ending::Skip(skip) => {
                    let skip = skip.row(item, 0, row).chunks_exact(outputs);
                    for (sums, skip) in sums.chunks_exact_mut(outputs).zip(skip) {
                        for ((sum, skip), bias) in sums.iter_mut().zip(skip).zip(&self.bias) {
                            *sum = skip + bias;
                        }
                    }
                }
            }
            let weights = self.weights.chunks_exact(inputs * outputs);
            for (tap, weights) in self.taps.iter().zip(weights) {
                let part = input.part(item, tap.plane, row + tap.row, tap.column);
                let depth = self.sizes.inputs;
                product((part, inputs), weights, sums, depth, outputs, true);
            }
            if matches!(ending, Ending::Relu) {
                for sum in sums {
                    *sum = sum.max(0.0);
                }
            }
        });
        out
    }

    /// The gradient of the input from that of the output, whose border is [`Sizes::border`]: added
    /// to `on_top` where there is something, zero where `relu` is, with this border.
    pub(crate) fn back(
        &self,
        gradient: &Field,
        on_top: Option<&Field>,
        relu: Option<&Field>,
        border: usize,
    ) -> Field {
        let [inputs, outputs] = self.channels;
        let (items, planes) = (gradient.items, self.sizes.planes());
        let sides = (gradient.rows, gradient.columns);
        let mut out = Field::zero((items, planes), sides, border, inputs);
        let reach = 2 * self.sizes.border();
        out.fill(|item, plane, row, sums| {
            if let Some(on_top) = on_top {
                sums.copy_from_slice(on_top.row(item, plane, row));
            }
            let weights = self.transposed.chunks_exact(inputs * outputs);
            let taps = self.taps.iter().zip(weights);
            for (tap, weights) in taps.filter(|(tap, _)| tap.plane == plane) {
                let part = gradient.part(item, 0, row + reach - tap.row, reach - tap.column);
                let depth = self.sizes.outputs;
                product((part, outputs), weights, sums, depth, inputs, true);
            }
            if let Some(relu) = relu {
                for (sum, &value) in sums.iter_mut().zip(relu.row(item, plane, row)) {
                    *sum = if value > 0.0 { *sum } else { 0.0 };
                }
            }
        });
        out
    }

    /// The gradients of weights and biases from the input and the gradient of the output, in the
    /// layout of [`Convolution::new`]. Rows are summed in [`CHUNKS`] chunks whatever the number of
    /// threads.
    pub(crate) fn gradients(
        &self,
        input: &Field,
        gradient: &Field,
        weights: &mut [f32],
        bias: &mut [f32],
    ) {
        let [inputs, outputs] = self.channels;
        let len = inputs * outputs;
        let rows = input.items * input.rows;
        let chunk = |chunk: usize| {
            let mut sums = vec![0.0; self.taps.len() * len + outputs];
            let (of_weights, of_bias) = sums.split_at_mut(self.taps.len() * len);
            for at in rows * chunk / CHUNKS..rows * (chunk + 1) / CHUNKS {
                let (item, row) = (at / input.rows, at % input.rows);
                let gradient = gradient.row(item, 0, row);
                for (tap, sums) in self.taps.iter().zip(of_weights.chunks_exact_mut(len)) {
                    let part = input.part(item, tap.plane, row + tap.row, tap.column);
                    product_transposed((part, inputs), (gradient, outputs), sums);
                }
                for gradient in gradient.chunks_exact(outputs) {
                    for (sum, gradient) in of_bias.iter_mut().zip(gradient) {
                        *sum += gradient;
                    }
                }
            }
            sums
        };
        let chunks: Vec<Vec<f32>> = (0..CHUNKS).into_par_iter().map(chunk).collect();
        let Some((first, rest)) = chunks.split_first() else {
            return;
        };
        let mut sums = first.clone();
        for chunk in rest {
            for (sum, more) in sums.iter_mut().zip(chunk) {
                *sum += more;
            }
        }
        let taps = self.taps.len();
        for output in 0..self.sizes.outputs {
            for input in 0..self.sizes.inputs {
                let of_taps = &mut weights[(output * self.sizes.inputs + input) * taps..][..taps];
                for (tap, weight) in of_taps.iter_mut().enumerate() {
                    *weight = sums[tap * len + input * outputs + output];
                }
            }
            bias[output] = sums[taps * len + output];
        }
    }
}
