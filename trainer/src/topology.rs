//! Topology: the layers of a synthesizer and where their parameters lie in one flat slice.

use crate::choices::{ActivationKind, Precision};
use crate::config::TrainConfig;
use crate::kernel::padded;

/// One layer's sizes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct LayerShape {
    pub(crate) inputs: usize,
    pub(crate) outputs: usize,
    /// The arithmetic of the decode.
    pub(crate) precision: Precision,
    /// Whether the activation follows; otherwise the identity.
    pub(crate) activated: bool,
    /// How many layers a skip path that ends here spans.
    pub(crate) skip: Option<usize>,
    /// Where its weights start: `padded(inputs)` rows of `padded(outputs)` columns.
    pub(crate) weights_at: usize,
    /// Where its biases start.
    pub(crate) bias_at: usize,
}

impl LayerShape {
    pub(crate) const fn rows(&self) -> usize {
        padded(self.inputs)
    }

    pub(crate) const fn columns(&self) -> usize {
        padded(self.outputs)
    }

    pub(crate) fn weights<'a>(&self, parameters: &'a [f32]) -> &'a [f32] {
        &parameters[self.weights_at..self.weights_at + self.rows() * self.columns()]
    }

    pub(crate) fn bias<'a>(&self, parameters: &'a [f32]) -> &'a [f32] {
        &parameters[self.bias_at..self.bias_at + self.columns()]
    }
}

/// The layers, first layer first. Widths are padded for the kernels; the padding of weights and
/// biases is zero and stays zero, because its gradients are zero.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Topology {
    pub(crate) layers: Vec<LayerShape>,
    pub(crate) activation: ActivationKind,
    /// Length of the flat slice.
    pub(crate) parameters: usize,
}

impl Topology {
    pub(crate) fn new(config: &TrainConfig, channels: usize) -> Topology {
        let mut topology = Topology::empty(config.activation);
        let mut width = config.input_count();
        for &hidden in &config.hidden {
            topology.push(width, usize::from(hidden), true, None);
            width = usize::from(hidden);
        }
        for _ in 0..config.residual_blocks {
            let span = usize::from(config.layers_per_block);
            for layer in 1..=span {
                let last = layer == span;
                topology.push(width, width, !last, last.then_some(span));
            }
        }
        topology.push(width, channels, false, None);
        for (index, layer) in topology.layers.iter_mut().enumerate() {
            layer.precision = config.precision_of(index);
        }
        topology
    }

    /// Whether the register that a layer writes holds halves: an integer layer reads integers,
    /// which an fp16 layer before it has to give.
    pub(crate) fn writes_halves(&self, layer: usize) -> bool {
        let halves = |at: usize| {
            let layer = self.layers.get(at);
            layer.is_some_and(|l| l.precision == Precision::Fp16)
        };
        halves(layer) && halves(layer + 1)
    }

    /// No layer yet.
    pub(crate) const fn empty(activation: ActivationKind) -> Topology {
        Topology {
            layers: Vec::new(),
            activation,
            parameters: 0,
        }
    }

    /// One more layer, of integers.
    pub(crate) fn push(
        &mut self,
        inputs: usize,
        outputs: usize,
        activated: bool,
        skip: Option<usize>,
    ) {
        let weights_at = self.parameters;
        let bias_at = weights_at + padded(inputs) * padded(outputs);
        self.parameters = bias_at + padded(outputs);
        self.layers.push(LayerShape {
            inputs,
            outputs,
            precision: Precision::Int8,
            activated,
            skip,
            weights_at,
            bias_at,
        });
    }

    /// Multiplications per texel.
    pub(crate) fn macs(&self) -> u64 {
        self.layers
            .iter()
            .map(|l| (l.inputs * l.outputs) as u64)
            .sum()
    }
}
