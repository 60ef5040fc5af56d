//! Descent: how the synthesizer's parameters follow their gradient.
//!
//! Muon (Jordan et al. 2024) replaces the momentum of a matrix of weights by the nearest matrix
//! with orthonormal columns, so that directions which seldom matter move as far as those which
//! always do. With `m` the momentum and `g` the gradient of the weights `W` (inputs × outputs):
//!
//! ```text
//! m ← β·m + (1 − β)·g
//! W ← W − rate · 0.14 · √max(inputs, outputs) · orthogonal(β·m + (1 − β)·g)
//! ```
//!
//! The root makes the size of an update that of Adam's, whatever the shape (Liu et al. 2025), so
//! that both take the same learning rate. The last layer, whose columns are channels with units of
//! their own, and the biases take Adam.

use crate::adam::{Moments, Rate};
use crate::choices::Optimiser;
use crate::kernel::{product, product_transposed};
use crate::topology::{LayerShape, Topology};
use rayon::prelude::*;

/// Decay of the momentum.
pub(crate) const MOMENTUM: f32 = 0.95;

/// The root mean square of an element of an update at a learning rate of 1, where the longer side
/// of the matrix counts.
const SIZE: f32 = 0.14;

/// Coefficients of a step of the iteration towards the orthogonal matrix, x·(a + b·s + c·s²) for a
/// singular value x with square s: those of Jordan et al., which bring every value from 0.005 on to
/// between 0.7 and 1.2 in [`ROUNDS`] steps.
pub(crate) const COEFFICIENTS: [f32; 3] = [3.4445, -4.7750, 2.0315];

/// Steps of that iteration.
pub(crate) const ROUNDS: usize = 5;

/// Keeps a gradient of zeros from dividing by zero.
pub(crate) const LEAST_NORM: f32 = 1e-20;

/// One step's way of moving the synthesizer's parameters.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Descent {
    /// All by Adam.
    Adam(Rate),
    /// The weights of hidden layers by Muon, with this learning rate; the rest by Adam.
    Muon { rate: f32, others: Rate },
}

impl Descent {
    /// That of the `count`-th update of a stage, counted from 1.
    pub(crate) fn new(optimiser: Optimiser, learning_rate: f64, count: u64) -> Descent {
        let adam = Rate::new(learning_rate, count);
        match optimiser {
            Optimiser::Adam => Descent::Adam(adam),
            Optimiser::Muon => Descent::Muon {
                rate: learning_rate as f32,
                others: adam,
            },
        }
    }

    /// Moves `parameters` along `gradient`.
    pub(crate) fn update(
        self,
        topology: &Topology,
        moments: &mut Moments,
        parameters: &mut [f32],
        gradient: &[f32],
    ) {
        let (rate, others) = match self {
            Descent::Adam(rate) => {
                moments.update(rate, parameters, gradient);
                return;
            }
            Descent::Muon { rate, others } => (rate, others),
        };
        let Some((last, hidden)) = topology.layers.split_last() else {
            return;
        };
        // A layer is one task, so that sums do not depend on the number of threads.
        let updates: Vec<Vec<f32>> = hidden
            .par_iter()
            .map(|layer| {
                let ahead = look_ahead(layer.weights(&moments.first), layer.weights(gradient));
                orthogonal(ahead, layer.columns())
            })
            .collect();
        for (layer, update) in hidden.iter().zip(updates) {
            let part = layer.weights_at..layer.bias_at;
            let momentum = &mut moments.first[part.clone()];
            for (m, g) in momentum.iter_mut().zip(&gradient[part.clone()]) {
                *m = mixed(*m, *g);
            }
            let step = rate * update_size(layer);
            for (w, u) in parameters[part].iter_mut().zip(update) {
                *w -= step * u;
            }
            let bias = layer.bias_at..layer.bias_at + layer.columns();
            moments.update_part(bias, others, parameters, gradient);
        }
        let part = last.weights_at..last.bias_at + last.columns();
        moments.update_part(part, others, parameters, gradient);
    }
}

/// What an orthogonal matrix is multiplied with at a learning rate of 1.
pub(crate) fn update_size(layer: &LayerShape) -> f32 {
    SIZE * (layer.inputs.max(layer.outputs) as f32).sqrt()
}

fn mixed(momentum: f32, gradient: f32) -> f32 {
    MOMENTUM * momentum + (1.0 - MOMENTUM) * gradient
}

/// Where the momentum will be if the gradient stays (Nesterov's).
fn look_ahead(momentum: &[f32], gradient: &[f32]) -> Vec<f32> {
    let pairs = momentum.iter().zip(gradient);
    pairs.map(|(&m, &g)| mixed(mixed(m, g), g)).collect()
}

/// The matrix with the singular vectors of `x` (rows × `columns`) and singular values near 1; zeros
/// stay zeros.
fn orthogonal(mut x: Vec<f32>, columns: usize) -> Vec<f32> {
    let norm = x.iter().map(|v| v * v).sum::<f32>().sqrt() + LEAST_NORM;
    for value in &mut x {
        *value /= norm;
    }
    let [a, b, c] = COEFFICIENTS;
    let mut squares = vec![0.0; columns * columns];
    let mut polynomial = vec![0.0; columns * columns];
    let mut higher = vec![0.0; x.len()];
    for _ in 0..ROUNDS {
        squares.fill(0.0);
        product_transposed((&x, columns), (&x, columns), &mut squares);
        let sides = (squares.as_slice(), columns);
        product(sides, &squares, &mut polynomial, columns, columns, false);
        for (fourth, square) in polynomial.iter_mut().zip(&squares) {
            *fourth = c * *fourth + b * square;
        }
        product(
            (&x, columns),
            &polynomial,
            &mut higher,
            columns,
            columns,
            false,
        );
        for (value, higher) in x.iter_mut().zip(&higher) {
            *value = a * *value + higher;
        }
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{Purpose, Stream};

    const COLUMNS: usize = 32;

    fn random(rows: usize) -> Vec<f32> {
        let stream = Stream::new(3, Purpose::Synthesizer, 0);
        (0..rows * COLUMNS)
            .map(|i| stream.signed(i as u64))
            .collect()
    }

    /// Columns of the result times each other: near the identity.
    #[test]
    fn columns_become_orthonormal_whatever_their_size() {
        let rows = 96;
        let mut matrix = random(rows);
        for row in matrix.chunks_exact_mut(COLUMNS) {
            row[3] *= 10.0;
            row[4] *= 0.3;
        }
        let x = orthogonal(matrix, COLUMNS);
        for i in 0..COLUMNS {
            for j in 0..COLUMNS {
                let dot: f32 = x.chunks_exact(COLUMNS).map(|row| row[i] * row[j]).sum();
                // Of singular values of 0.7 to 1.2.
                let (low, high) = if i == j { (0.49, 1.44) } else { (-0.48, 0.48) };
                assert!((low..high).contains(&dot), "{i} {j}: {dot}");
            }
        }
    }

    #[test]
    fn rows_and_columns_of_zeros_and_nothing_at_all_stay_zero() {
        let mut matrix = random(64);
        for (at, row) in matrix.chunks_exact_mut(COLUMNS).enumerate() {
            row[7] = 0.0;
            if at >= 60 {
                row.fill(0.0);
            }
        }
        let x = orthogonal(matrix, COLUMNS);
        for (at, row) in x.chunks_exact(COLUMNS).enumerate() {
            assert_eq!(row[7], 0.0);
            assert!(at < 60 || row.iter().all(|&v| v == 0.0));
        }
        assert_eq!(
            orthogonal(vec![0.0; 64 * COLUMNS], COLUMNS),
            vec![0.0; 64 * COLUMNS]
        );
    }
}
