//! Tile: the way of [`TILE`] texels through a network, and the way of their gradients back.

use crate::config::TILE;
use crate::kernel::{Vectorised, product, product_transposed, vectorised};
use crate::network::Network;
use crate::topology::Topology;

/// What one tile needs; reused, because its pages and cache lines are warm.
#[derive(Debug)]
pub(crate) struct Workspace {
    /// Texels × inputs.
    pub(crate) inputs: Vec<f32>,
    /// Texels × outputs of each layer.
    outs: Vec<Vec<f32>>,
    /// Derivatives that [`crate::network::Prepared::finish`] left.
    slopes: Vec<Vec<f32>>,
    /// Gradients of each layer's outputs, then of its accumulators.
    gradients: Vec<Vec<f32>>,
}

impl Workspace {
    pub(crate) fn new(topology: &Topology) -> Workspace {
        let layers = || {
            topology
                .layers
                .iter()
                .map(|l| vec![0.0; TILE * l.columns()])
                .collect()
        };
        let inputs = topology.layers.first().map_or(0, |l| l.rows());
        Workspace {
            inputs: vec![0.0; TILE * inputs],
            outs: layers(),
            slopes: layers(),
            gradients: layers(),
        }
    }

    /// The outputs of the last layer, texels × padded channels: reals, or codes.
    pub(crate) fn output(&self) -> &[f32] {
        self.outs.last().map_or(&[], Vec::as_slice)
    }

    /// The outputs of layer `layer`, texels × padded rows, without their zero point.
    pub(crate) fn layer_output(&self, layer: usize) -> &[f32] {
        &self.outs[layer]
    }

    /// From the inputs to the outputs.
    pub(crate) fn forward(&mut self, network: &Network) {
        for (index, layer) in network.layers.iter().enumerate() {
            let (before, rest) = self.outs.split_at_mut(index);
            let out = &mut rest[0];
            let input = before.last().unwrap_or(&self.inputs);
            let shape = layer.shape;
            let (depth, columns) = (shape.inputs, shape.columns());
            let start = layer.sums_start_with();
            if let Some(bias) = start {
                for row in out.chunks_exact_mut(columns) {
                    row.copy_from_slice(bias);
                }
            }
            product(
                (input, shape.rows()),
                &layer.weights,
                out,
                depth,
                columns,
                start.is_some(),
            );
            let source = shape.skip.map(|span| before[index - span].as_slice());
            layer.finish(network.activation, source, out, &mut self.slopes[index]);
        }
    }

    /// The squared error of the outputs against `targets` (texels × channels, unpadded), each
    /// channel's times its weight, summed; and its gradient, times `scale`, in place of the outputs'
    /// gradient. A target that is no number is masked out and counts nothing.
    ///
    /// An output is compared after it is limited to what its format can emit, and the gradient
    /// passes the limit unchanged: an output beyond a limit that the target sits on costs nothing
    /// and is left alone, one whose target lies inside is pulled back.
    pub(crate) fn compare(
        &mut self,
        network: &Network,
        targets: &[f32],
        weights: &[f32],
        scale: f32,
    ) -> f64 {
        let last = network.layers.len() - 1;
        let layer = &network.layers[last];
        let (columns, channels) = (layer.shape.columns(), layer.shape.outputs);
        let (out, gradient) = (&self.outs[last], &mut self.gradients[last]);
        let slope = &self.slopes[last];
        let mut sum = 0.0_f32;
        for (row, target) in targets.chunks_exact(channels).enumerate() {
            for (channel, (&target, &weight)) in target.iter().zip(weights).enumerate() {
                let at = row * columns + channel;
                let unit = 1.0 / layer.unit(channel);
                let real = (out[at] * unit).clamp(network.low[channel], 1.0);
                let error = if target.is_nan() { 0.0 } else { real - target };
                sum += weight * (error * error);
                gradient[at] = weight * (2.0 * scale * error * unit * slope[at]);
            }
        }
        f64::from(sum)
    }

    /// From the outputs' gradient to those of the parameters, which are added to `parameters`,
    /// and those of the inputs, which replace `inputs`.
    pub(crate) fn backward(
        &mut self,
        network: &Network,
        parameters: &mut [f32],
        inputs: &mut [f32],
    ) {
        let last = network.layers.len() - 1;
        for index in (0..network.layers.len()).rev() {
            let layer = &network.layers[index];
            let shape = layer.shape;
            let (before, rest) = self.gradients.split_at_mut(index);
            let gradient = &mut rest[0];
            let slope = self.slopes[index].as_slice();
            if let Some(span) = shape.skip {
                let (source_gain, gains) = layer.skip_gains();
                let source = &mut before[index - span];
                let columns = shape.columns();
                vectorised(SkipBack {
                    columns,
                    source_gain,
                    gains,
                    slope,
                    gradient,
                    source,
                });
            } else if index != last {
                vectorised(Scale { gradient, slope });
            }
            let input = if index == 0 {
                &self.inputs
            } else {
                &self.outs[index - 1]
            };
            let weights = &mut parameters[shape.weights_at..shape.bias_at];
            product_transposed((input, shape.rows()), (gradient, shape.columns()), weights);
            let bias = &mut parameters[shape.bias_at..shape.bias_at + shape.columns()];
            vectorised(ColumnSums {
                gradient,
                sums: bias,
            });
            // A skip path that starts here left its share already.
            let is_source = index > 0
                && network.layers.iter().enumerate().any(|(later, l)| {
                    l.shape
                        .skip
                        .is_some_and(|span| later >= span && later - span == index - 1)
                });
            let out = if index == 0 {
                &mut *inputs
            } else {
                &mut before[index - 1]
            };
            let (depth, columns) = (shape.outputs, shape.rows());
            let gradient = (gradient.as_slice(), shape.columns());
            product(gradient, &layer.transposed, out, depth, columns, is_source);
        }
    }
}

struct Scale<'a> {
    gradient: &'a mut [f32],
    slope: &'a [f32],
}

impl Vectorised for Scale<'_> {
    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        for (g, slope) in self.gradient.iter_mut().zip(self.slope) {
            *g *= slope;
        }
    }
}

/// The gradient of a sum of a layer and its skip path, to both.
struct SkipBack<'a> {
    columns: usize,
    source_gain: f32,
    gains: Option<&'a [f64]>,
    slope: &'a [f32],
    gradient: &'a mut [f32],
    source: &'a mut [f32],
}

impl Vectorised for SkipBack<'_> {
    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        for ((g, s), slope) in self.gradient.iter_mut().zip(self.source).zip(self.slope) {
            *g *= slope;
            *s = *g * self.source_gain;
        }
        if let Some(gains) = self.gains {
            for row in self.gradient.chunks_exact_mut(self.columns) {
                for (g, &gain) in row.iter_mut().zip(gains) {
                    *g *= gain as f32;
                }
            }
        }
    }
}

struct ColumnSums<'a> {
    gradient: &'a [f32],
    sums: &'a mut [f32],
}

impl Vectorised for ColumnSums<'_> {
    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        for row in self.gradient.chunks_exact(self.sums.len()) {
            for (sum, g) in self.sums.iter_mut().zip(row) {
                *sum += g;
            }
        }
    }
}
