//! The synthesizer in reals, on tensors: what [`crate::network`] and [`crate::tile`] do on slices.

use super::flat::{Flat, flat_gradient};
use crate::choices::ActivationKind;
use crate::descent::{COEFFICIENTS, Descent, LEAST_NORM, MOMENTUM, ROUNDS, update_size};
use crate::topology::Topology;
use burn_tensor::{Gradients, Tensor, activation};

/// Weights (padded inputs × padded outputs) and biases (1 × padded outputs) of every layer.
pub(crate) struct Leaves(Vec<(Tensor<2>, Tensor<2>)>);

impl Leaves {
    pub(crate) fn of(topology: &Topology, parameters: &Flat) -> Leaves {
        let layers = topology.layers.iter().map(|layer| {
            (
                parameters.leaf(layer.weights_at, [layer.rows(), layer.columns()]),
                parameters.leaf(layer.bias_at, [1, layer.columns()]),
            )
        });
        Leaves(layers.collect())
    }

    /// From texels × padded inputs to texels × padded outputs of the last layer.
    pub(crate) fn forward(&self, topology: &Topology, inputs: Tensor<2>) -> Tensor<2> {
        let mut outs: Vec<Tensor<2>> = Vec::with_capacity(self.0.len());
        let mut x = inputs;
        for (index, (layer, (weights, bias))) in topology.layers.iter().zip(&self.0).enumerate() {
            let product = x.matmul(weights.clone());
            x = match layer.skip {
                Some(span) => product + (outs[index - span].clone() + bias.clone()),
                None if layer.activated => activate(product + bias.clone(), topology.activation),
                None => product + bias.clone(),
            };
            outs.push(x.clone());
        }
        x
    }

    /// The gradient of every parameter, in the order of the flat slice.
    pub(crate) fn gradient(&self, gradients: &mut Gradients) -> Tensor<1> {
        let parts = self.0.iter().flat_map(|(weights, bias)| {
            [
                flat_gradient(weights, gradients),
                flat_gradient(bias, gradients),
            ]
        });
        Tensor::cat(parts.collect(), 0)
    }
}

impl Flat {
    /// [`Descent::update`] on a device.
    pub(crate) fn descend(&mut self, topology: &Topology, descent: Descent, gradient: Tensor<1>) {
        let (rate, others) = match descent {
            Descent::Adam(rate) => {
                self.update(rate, gradient);
                return;
            }
            Descent::Muon { rate, others } => (rate, others),
        };
        let Some((_, hidden)) = topology.layers.split_last() else {
            return;
        };
        let mut by_adam = self.clone();
        by_adam.update(others, gradient.clone());
        for layer in hidden {
            let (at, sides) = (layer.weights_at, [layer.rows(), layer.columns()]);
            let part = at..layer.bias_at;
            let gradient = gradient.clone().narrow(0, at, part.len());
            let first = self.first.clone().narrow(0, at, part.len());
            let mix = |first: Tensor<1>| first * MOMENTUM + gradient.clone() * (1.0 - MOMENTUM);
            let momentum = mix(first);
            let ahead = mix(momentum.clone()).reshape(sides);
            let update = orthogonal(ahead).reshape([part.len()]) * (rate * update_size(layer));
            let values = self.values.clone().narrow(0, at, part.len()) - update;
            by_adam.values = by_adam.values.slice_assign([part.clone()], values);
            by_adam.first = by_adam.first.slice_assign([part.clone()], momentum);
            let second = self.second.clone().narrow(0, at, part.len());
            by_adam.second = by_adam.second.slice_assign([part], second);
        }
        *self = by_adam;
    }
}

fn orthogonal(x: Tensor<2>) -> Tensor<2> {
    let norm = (x.clone() * x.clone()).sum().sqrt() + LEAST_NORM;
    let mut x = x / norm.unsqueeze();
    let [a, b, c] = COEFFICIENTS;
    for _ in 0..ROUNDS {
        let squares = x.clone().transpose().matmul(x.clone());
        let polynomial = squares.clone().matmul(squares.clone()) * c + squares * b;
        x = x.clone() * a + x.matmul(polynomial);
    }
    x
}

fn activate(x: Tensor<2>, kind: ActivationKind) -> Tensor<2> {
    let gelu = |x: Tensor<2>| {
        let gate = (x.clone() * (1.0_f32 / 3.0) + 0.5).clamp(0.0, 1.0);
        x * gate
    };
    match kind {
        ActivationKind::Relu => activation::relu(x),
        ActivationKind::Leaky { shift } => {
            let leak = 1.0 / f32::from(1_u8 << shift);
            // A slope is a power of two or 1, so this is exact.
            let slope = x.clone().inner().greater_equal_elem(0.0).float() * (1.0 - leak) + leak;
            x * slope
        }
        ActivationKind::HardGelu => gelu(x),
        ActivationKind::ClampedHardGelu => gelu(x.clamp_max(3.0)),
    }
}
