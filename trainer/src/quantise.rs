//! Quantise: the network that the unit computes, from real parameters.
//!
//! Training computes with the very numbers that the export writes down, and passes gradients
//! straight through every rounding.

use crate::choices::Precision;
use crate::config::TrainConfig;
use crate::half::half_layer;
use crate::integer::integer_layer;
use crate::network::Network;
use crate::topology::{LayerShape, Topology};
use ntmu_isa::accumulate::signed_range;
use ntmu_isa::shape::OutputFormat;

/// What a unit of a hidden layer's register means: real = scale · (value − zero_point).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Range {
    pub(crate) scale: f32,
    pub(crate) zero_point: i16,
}

impl Range {
    /// That of a register of halves.
    pub(crate) const HALVES: Range = Range {
        scale: 1.0,
        zero_point: 0,
    };
}

/// Bits of the integers of a layer.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Widths {
    pub(crate) input: u8,
    pub(crate) weight: u8,
    pub(crate) activation: u8,
}

impl Widths {
    pub(crate) fn of(config: &TrainConfig, layer: usize) -> Widths {
        Widths {
            input: config.input_bits,
            weight: config.weight_bits_of(layer),
            activation: config.activation_bits,
        }
    }

    /// The smallest and the largest activation.
    pub(crate) fn lanes(self) -> (f64, f64) {
        let (low, high) = signed_range(self.activation);
        (f64::from(low), f64::from(high))
    }
}

/// A network in the numbers of the decode, and what leads from it back to real parameters.
#[derive(Clone, Debug)]
pub(crate) struct Quantised {
    pub(crate) network: Network,
    /// For each layer, the derivative of each row's weights by the real ones, which is one over the
    /// row's scale where weights are integers (0 in the padding).
    inverse: Vec<Vec<f32>>,
    /// For each layer, the scale of its input.
    input_scale: Vec<f32>,
}

/// What is known about a layer when it is quantised.
pub(crate) struct Context<'a> {
    pub(crate) topology: &'a Topology,
    pub(crate) ranges: &'a [Range],
    pub(crate) widths: Widths,
    pub(crate) outputs: &'a [OutputFormat],
    pub(crate) index: usize,
    pub(crate) shape: LayerShape,
    /// The real weights and biases, padded.
    pub(crate) weights: &'a [f32],
    pub(crate) bias: &'a [f32],
    /// What a unit of its input means.
    pub(crate) input_scale: f32,
}

impl Context<'_> {
    /// What a unit of its output means; none in the last layer.
    pub(crate) fn range(&self) -> Option<&Range> {
        self.ranges.get(self.index)
    }

    /// In the last layer, the smallest and the largest code of each channel (0 in the padding).
    pub(crate) fn codes(&self) -> Vec<(f64, f64)> {
        if self.index + 1 < self.topology.layers.len() {
            return Vec::new();
        }
        let ranges = self.outputs.iter().map(|o| o.range());
        let mut codes: Vec<_> = ranges.map(|(l, h)| (f64::from(l), f64::from(h))).collect();
        codes.resize(self.shape.columns(), (0.0, 0.0));
        codes
    }
}

/// The network of `parameters` in the numbers of the decode.
pub(crate) fn quantise(
    topology: &Topology,
    parameters: &[f32],
    ranges: &[Range],
    config: &TrainConfig,
    outputs: &[OutputFormat],
) -> Quantised {
    let mut input_scale = vec![1.0 / (1_u32 << (config.input_bits - 1)) as f32];
    input_scale.extend(ranges.iter().map(|r| r.scale));
    let mut inverse = Vec::new();
    let mut layers = Vec::new();
    for (index, shape) in topology.layers.iter().enumerate() {
        let context = Context {
            topology,
            ranges,
            widths: Widths::of(config, index),
            outputs,
            index,
            shape: *shape,
            weights: shape.weights(parameters),
            bias: shape.bias(parameters),
            input_scale: input_scale[index],
        };
        let (layer, derivative) = match shape.precision {
            Precision::Int8 => integer_layer(&context),
            Precision::Fp16 => half_layer(&context),
        };
        layers.push(layer);
        inverse.push(derivative);
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
    /// Turns the gradient of the decode's numbers into that of the real parameters, straight
    /// through the roundings.
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

    /// Draws the real weights of layers that have few bits to what they were quantised to: each goes
    /// `share` of the way.
    ///
    /// With gradients straight through the rounding, a weight between two codes is pushed across
    /// their middle by the one and back by the other, however small the rate, and the training ends
    /// with whichever it saw last. Nagel et al. 2022 damp that by a term in the loss, a weight's
    /// squared distance from its code; this is a step along the gradient of such a term.
    pub(crate) fn draw(
        &self,
        config: &TrainConfig,
        topology: &Topology,
        parameters: &mut [f32],
        share: f32,
    ) {
        for (index, shape) in topology.layers.iter().enumerate() {
            if !config.has_few_bits(index) {
                continue;
            }
            let columns = shape.columns();
            let stored = self.network.layers[index].weights.chunks_exact(columns);
            let weights = &mut parameters[shape.weights_at..shape.bias_at];
            for (row, stored) in weights.chunks_exact_mut(columns).zip(stored) {
                for ((weight, stored), r) in row.iter_mut().zip(stored).zip(&self.inverse[index]) {
                    if *r > 0.0 {
                        *weight += share * (stored / r - *weight);
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::Engine;
    use crate::model::{Ground, Model};
    use crate::tests::{small, source};

    #[test]
    fn weights_of_few_bits_come_to_rest_at_their_codes() {
        let source = source(40, 24, 5);
        let bits = vec![4, 8, 3, 6, 8, 4, 7];
        let base = TrainConfig {
            weight_bits_per_layer: Some(bits.clone()),
            ..small()
        };
        let config = TrainConfig {
            plan: Some(base.usual_plan([0, 30, 300])),
            ..base
        };
        let ground = Ground::new(&config, &source).unwrap();
        let mut model = Model::new(&ground).unwrap();
        for stage in config.stages(&source.sizes()).unwrap() {
            if stage.is_deployed() {
                model.deploy(&ground);
            }
            let channels = ground.texels.channels;
            let mut engine = Engine::new(&ground.topology, stage.batch, channels);
            for step in 0..stage.steps {
                let rates = stage.rates_at(step);
                model.step(&ground, &mut engine, &stage, step, rates);
            }
        }
        let quantised = model.quantised(&ground);
        for (index, (layer, bits)) in ground.topology.layers.iter().zip(bits).enumerate() {
            let inverse = quantised.inverse[index].iter().cycle();
            let stored = &quantised.network.layers[index].weights;
            let weights = layer.weights(&model.parameters);
            let offsets = weights.iter().zip(stored).zip(inverse);
            // Weights that are zero from the start have nowhere to go.
            let offsets: Vec<f32> = offsets
                .filter(|((weight, _), _)| **weight != 0.0)
                .map(|((weight, stored), r)| (weight * r - stored).abs())
                .collect();
            // Codes apart; a quarter where weights do not care where codes are.
            let mean = offsets.iter().sum::<f32>() / offsets.len() as f32;
            if bits < 7 {
                assert!(mean < 0.15, "layer {index} of {bits} bits: {mean}");
            } else {
                assert!(mean > 0.2, "layer {index} of {bits} bits: {mean}");
            }
        }
    }
}
