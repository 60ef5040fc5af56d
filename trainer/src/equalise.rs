//! Equalise: bring the neurons of a layer nearer one range, so that the layer's only scale serves all of
//! them.
//!
//! What a neuron puts out is multiplied, and the weights that read it are divided, by the same factor.
//! ReLU and leaky ReLU let positive factors through, so the function in reals stays what it is (as in
//! Nagel et al. 2019, cross-layer equalisation). Neurons along residual blocks share their factors,
//! because skip paths add them.
//!
//! With e for how far a neuron goes from zero, its factor is e^−½, over the layer's geometric mean.
//! Not e^−1, which would make all ranges equal: the readers of a neuron that is seldom far from zero
//! would have weights that their own rows' scale is too coarse for.

use crate::choices::{ActivationKind, Precision};
use crate::topology::{LayerShape, Topology};

/// The largest factor, and one over the smallest.
const MOST: f32 = 16.0;

/// How much of the way to one range neurons go, in logarithms.
const SHARE: f32 = 0.5;

/// Multiplies neurons by factors that bring `extents`, the largest size of each layer's neurons, near
/// each other. Layers in fp16 and those of other activations stay.
pub(crate) fn equalise(topology: &Topology, extents: &[Vec<f32>], parameters: &mut [f32]) {
    let homogeneous = match topology.activation {
        ActivationKind::Relu | ActivationKind::Leaky { .. } => true,
        ActivationKind::HardGelu | ActivationKind::ClampedHardGelu => false,
    };
    for group in groups(topology, extents.len()) {
        let fits = |&at: &usize| {
            let layer = topology.layers[at];
            layer.precision == Precision::Int8 && (homogeneous || !layer.activated)
        };
        if !group.iter().all(fits) {
            continue;
        }
        let factors = factors(&group, extents);
        for &at in &group {
            let (own, next) = (topology.layers[at], topology.layers[at + 1]);
            scale(own, next, &factors, parameters);
        }
    }
}

/// The hidden layers, those together whose outputs skip paths add.
fn groups(topology: &Topology, hidden: usize) -> Vec<Vec<usize>> {
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for (at, layer) in topology.layers[..hidden].iter().enumerate() {
        let start = layer.skip.map(|span| at - span);
        let known = groups
            .iter_mut()
            .find(|g| start.is_some_and(|s| g.contains(&s)));
        match known {
            Some(group) => group.push(at),
            None => groups.push(vec![at]),
        }
    }
    groups
}

/// The factor of each neuron: the geometric mean over the layers of what each would give it. A
/// neuron that is always zero has none.
fn factors(group: &[usize], extents: &[Vec<f32>]) -> Vec<f32> {
    let mut logarithms = vec![0.0; extents[group[0]].len()];
    for &at in group {
        let alive = extents[at].iter().filter(|e| **e > 0.0);
        let mean = alive.clone().map(|e| e.log2()).sum::<f32>() / alive.count().max(1) as f32;
        for (sum, &extent) in logarithms.iter_mut().zip(&extents[at]) {
            if extent > 0.0 {
                *sum += SHARE * (mean - extent.log2());
            }
        }
    }
    let of_layers = |sum: f32| (sum / group.len() as f32).exp2();
    let limited = |factor: f32| factor.clamp(MOST.recip(), MOST);
    logarithms.into_iter().map(of_layers).map(limited).collect()
}

fn scale(own: LayerShape, next: LayerShape, factors: &[f32], parameters: &mut [f32]) {
    let (of_own, columns) = (own.weights_at..own.bias_at + own.columns(), own.columns());
    for row in parameters[of_own].chunks_exact_mut(columns) {
        for (value, factor) in row.iter_mut().zip(factors) {
            *value *= factor;
        }
    }
    let rows = parameters[next.weights_at..next.bias_at].chunks_exact_mut(next.columns());
    for (row, factor) in rows.zip(factors) {
        for value in row {
            *value /= factor;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::TrainConfig;
    use crate::model::{Ground, Model};
    use crate::sampler::Numbers;
    use crate::tests::{small, source};

    /// How unequal the neurons of each hidden layer are: the deviation of their extents' logarithms.
    fn spreads(model: &mut Model, ground: &Ground<'_>) -> Vec<f32> {
        let of_layer = |extents: Vec<f32>| {
            let logarithms = extents.iter().filter(|e| **e > 0.0).map(|e| e.log2());
            let logarithms: Vec<f32> = logarithms.collect();
            let count = logarithms.len() as f32;
            let mean = logarithms.iter().sum::<f32>() / count;
            let squares = logarithms.iter().map(|l| (l - mean).powi(2));
            (squares.sum::<f32>() / count).sqrt()
        };
        model.extents(ground).into_iter().map(of_layer).collect()
    }

    #[test]
    fn ranges_come_nearer_and_the_function_stays() {
        let source = source(96, 80, 5);
        let config = small();
        let ground = Ground::new(&config, &source).unwrap();
        let mut model = Model::new(&ground).unwrap();
        // Neurons of very different sizes, in and beside the residual blocks.
        for layer in &ground.topology.layers {
            let columns = layer.columns();
            let weights = &mut model.parameters[layer.weights_at..layer.bias_at];
            for row in weights.chunks_exact_mut(columns) {
                for (neuron, weight) in row.iter_mut().enumerate() {
                    *weight *= [0.3, 1.0, 3.0][neuron % 3];
                }
            }
        }
        let before = model.evaluate(&ground, Numbers::Real).overall();
        let wide = spreads(&mut model, &ground);
        model.equalise(&ground);
        let after = model.evaluate(&ground, Numbers::Real).overall();
        // Factors are rounded, products too; a neuron at a kink goes to the same side.
        assert!((after / before - 1.0).abs() < 1e-5, "{before} {after}");
        let narrow = spreads(&mut model, &ground);
        // The first layer's neurons read each other's through no block.
        assert!((narrow[0] / (wide[0] * (1.0 - SHARE)) - 1.0).abs() < 1e-3);
        let sum = |spreads: &[f32]| spreads.iter().sum::<f32>();
        assert!(sum(&narrow) < 0.7 * sum(&wide), "{wide:?} {narrow:?}");
    }

    #[test]
    fn layers_that_factors_do_not_pass_stay() {
        let source = source(96, 80, 5);
        for config in [
            TrainConfig {
                activation: ActivationKind::HardGelu,
                residual_blocks: 0,
                ..small()
            },
            TrainConfig {
                precision: Precision::Fp16,
                ..small()
            },
        ] {
            let ground = Ground::new(&config, &source).unwrap();
            let mut model = Model::new(&ground).unwrap();
            let before = model.parameters.clone();
            model.equalise(&ground);
            assert_eq!(model.parameters, before);
        }
    }

    #[test]
    fn a_dead_neuron_stays_and_factors_have_limits() {
        let extents = vec![vec![0.0, 1.0, 1e6, 1e-6]];
        let factors = factors(&[0], &extents);
        assert_eq!(factors, [1.0, 1.0, MOST.recip(), MOST]);
    }
}
