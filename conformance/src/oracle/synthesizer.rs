//! The synthesizer in reals: fully connected layers with skip connections (paper, section "Text
//! synthesis"), on the integers that an asset deploys.

use ntmu_isa::activation::Activation;
use ntmu_isa::layer::Layer;
use ntmu_isa::rescale::Multiplier;

/// The real numbers that one layer makes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RealLayer {
    /// Bias plus products, in accumulator units.
    pub accumulators: Vec<f64>,
    /// After the activation; for a hard GELU 6·2^16 times its real.
    pub activated: Vec<f64>,
    /// After rescaling, skip path, zero point and clamp; empty in the last layer.
    pub outputs: Vec<f64>,
}

/// A layer's weights and biases as reals.
#[derive(Clone, Debug)]
pub(super) struct Synthesizer {
    bias: Vec<f64>,
    /// `inputs` columns of `outputs` weights: whole columns are added at a time, which is the same
    /// sum and lets the compiler add several rows at once.
    columns: Vec<f64>,
}

impl Synthesizer {
    pub(super) fn new(layer: &Layer) -> Synthesizer {
        let (rows, inputs) = (usize::from(layer.outputs), usize::from(layer.inputs));
        let weight = |row: usize, k: usize| f64::from(layer.weights[row * inputs + k]);
        let columns = (0..inputs)
            .flat_map(|k| (0..rows).map(move |row| weight(row, k)))
            .collect();
        let bias = layer.bias.iter().map(|&b| f64::from(b)).collect();
        Synthesizer { bias, columns }
    }

    /// bias + Σ weight · input.
    pub(super) fn accumulators(&self, input: &[f64]) -> Vec<f64> {
        let mut sums = self.bias.clone();
        for (column, x) in self.columns.chunks_exact(self.bias.len()).zip(input) {
            for (sum, weight) in sums.iter_mut().zip(column) {
                *sum += weight * x;
            }
        }
        sums
    }
}

/// mantissa / 2^shift.
#[must_use]
pub fn scale(multiplier: Multiplier) -> f64 {
    f64::from(multiplier.mantissa()) / 2_f64.powi(i32::from(multiplier.shift()))
}

/// A value times a scale; the result of a rescaling is a 32-bit word and is clamped to it.
#[must_use]
pub fn rescale(value: f64, multiplier: Multiplier) -> f64 {
    (value * scale(multiplier)).clamp(f64::from(i32::MIN), f64::from(i32::MAX))
}

/// Accumulators after the activation.
#[must_use]
pub fn activated(layer: &Layer, accumulators: &[f64]) -> Vec<f64> {
    let rows = accumulators.iter().zip(&layer.scales);
    rows.map(|(&a, &to_argument)| match layer.activation {
        Activation::Identity => a,
        Activation::Relu => a.max(0.0),
        Activation::Leaky { shift } if a < 0.0 => a / 2_f64.powi(i32::from(shift)),
        Activation::Leaky { .. } => a,
        Activation::HardGelu { .. } => {
            let x = gate_argument(a, to_argument) / 256.0;
            6.0 * 65_536.0 * hard_gelu(x)
        }
    })
    .collect()
}

/// x · clamp(x/3 + ½, 0, 1).
#[must_use]
pub fn hard_gelu(x: f64) -> f64 {
    x * (x / 3.0 + 0.5).clamp(0.0, 1.0)
}

/// A hard GELU's argument in units of 1/256, clamped to 16 bits.
#[must_use]
pub fn gate_argument(accumulator: f64, multiplier: Multiplier) -> f64 {
    rescale(accumulator, multiplier).clamp(-32_768.0, 32_767.0)
}

/// The multiplier of a row's last rescaling: a hard GELU's rows share one.
#[must_use]
pub fn output_multiplier(layer: &Layer, row: usize) -> Multiplier {
    match layer.activation {
        Activation::HardGelu { scale } => scale,
        Activation::Identity | Activation::Relu | Activation::Leaky { .. } => layer.scales[row],
    }
}

/// Activated accumulators on the scale of the layer's output.
#[must_use]
pub fn rescaled(layer: &Layer, activated: &[f64]) -> Vec<f64> {
    let rows = activated.iter().enumerate();
    rows.map(|(row, &a)| rescale(a, output_multiplier(layer, row)))
        .collect()
}

/// A hidden layer's output: rescaled, plus the skip path (values and their zero point), plus the
/// zero point, clamped to a signed byte.
#[must_use]
pub fn outputs(layer: &Layer, activated: &[f64], source: Option<(&[f64], f64)>) -> Vec<f64> {
    let unclamped = outputs_unclamped(layer, activated, source);
    unclamped
        .iter()
        .map(|value| value.clamp(-128.0, 127.0))
        .collect()
}

/// As [`outputs`], before the clamp.
#[must_use]
pub fn outputs_unclamped(
    layer: &Layer,
    activated: &[f64],
    source: Option<(&[f64], f64)>,
) -> Vec<f64> {
    let mut values = rescaled(layer, activated);
    if let (Some(skip), Some((source, zero_point))) = (layer.skip, source) {
        for (value, from) in values.iter_mut().zip(source) {
            *value += rescale(from - zero_point, skip.scale);
        }
    }
    for value in &mut values {
        *value += f64::from(layer.zero_point);
    }
    values
}
