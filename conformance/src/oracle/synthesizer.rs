//! The synthesizer in reals: fully connected layers with skip connections (paper, section "Text
//! synthesis"), on the numbers that an asset deploys.

use super::number::{LARGEST_HALF, half, lane_range, signed};
use ntmu_isa::activation::Activation;
use ntmu_isa::layer::{HalfParameters, IntegerParameters, Layer, Parameters, Quantize};
use ntmu_isa::profile::Profile;
use ntmu_isa::rescale::Multiplier;
use ntmu_isa::shape::LaneFormat;

/// The real numbers that one layer makes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RealLayer {
    /// Bias plus products: in accumulator units, or the real itself in an fp16 layer.
    pub accumulators: Vec<f64>,
    /// After the activation; for an integer layer's hard GELU 6·2^16 times its real, for a table its
    /// entry.
    pub activated: Vec<f64>,
    /// What the register holds, clamped: integers with their zero point, or the reals of halves;
    /// empty in the last layer.
    pub outputs: Vec<f64>,
}

/// The values at the start of a skip path, and what stands for their real zero.
#[derive(Clone, Copy, Debug)]
pub struct Source<'a> {
    /// One per lane.
    pub values: &'a [f64],
    /// 0 for halves.
    pub zero_point: f64,
}

/// A layer's weights and biases as reals.
#[derive(Clone, Debug)]
pub(super) struct Synthesizer {
    bias: Vec<f64>,
    /// `inputs` columns of `outputs` weights: whole columns are added at a time, which is the same
    /// sum and lets the compiler add several rows at once.
    columns: Vec<f64>,
    /// The same, `outputs` rows of `inputs` weights.
    rows: Vec<f64>,
    inputs: usize,
    /// Where an integer register is read by an fp16 layer: zero point, and values to the real 1.
    reading: Option<(f64, f64)>,
}

impl Synthesizer {
    /// Of a layer that reads a register of this format.
    pub(super) fn new(layer: &Layer, input: LaneFormat) -> Synthesizer {
        let (rows, inputs) = (usize::from(layer.outputs), usize::from(layer.inputs));
        let by_row: Vec<f64> = (0..rows).flat_map(|row| weights(layer, row)).collect();
        let column = |k: usize| by_row.iter().skip(k).step_by(inputs);
        Synthesizer {
            bias: (0..rows).map(|row| bias(layer, row)).collect(),
            columns: (0..inputs).flat_map(column).copied().collect(),
            rows: by_row,
            inputs,
            reading: reading(layer, input),
        }
    }

    pub(super) fn row(&self, row: usize) -> &[f64] {
        &self.rows[row * self.inputs..(row + 1) * self.inputs]
    }

    /// bias + Σ weight · input.
    pub(super) fn accumulators(&self, input: &[f64]) -> Vec<f64> {
        let mut sums = self.bias.clone();
        for (column, &x) in self.columns.chunks_exact(self.bias.len()).zip(input) {
            let x = match self.reading {
                Some((zero_point, one)) => (x - zero_point) / one,
                None => x,
            };
            for (sum, weight) in sums.iter_mut().zip(column) {
                *sum += weight * x;
            }
        }
        sums
    }
}

/// How a layer reads an integer register, if it is an fp16 layer: zero point, and the values that
/// stand for the real 1.
#[must_use]
pub fn reading(layer: &Layer, input: LaneFormat) -> Option<(f64, f64)> {
    match (&layer.parameters, input) {
        (Parameters::Half(_), LaneFormat::Integer { bits, zero_point }) => {
            Some((f64::from(zero_point), -signed(bits).0))
        }
        (Parameters::Half(_), LaneFormat::Half) | (Parameters::Integer(_), _) => None,
    }
}

/// The weights of a row as reals.
#[must_use]
pub fn weights(layer: &Layer, row: usize) -> Vec<f64> {
    let inputs = usize::from(layer.inputs);
    let lanes = row * inputs..(row + 1) * inputs;
    match &layer.parameters {
        Parameters::Integer(p) => p.weights[lanes].iter().map(|&w| f64::from(w)).collect(),
        Parameters::Half(p) => p.weights[lanes].iter().map(|&w| half(w)).collect(),
    }
}

/// The bias of a row as a real.
#[must_use]
pub fn bias(layer: &Layer, row: usize) -> f64 {
    match &layer.parameters {
        Parameters::Integer(p) => f64::from(p.bias[row]),
        Parameters::Half(p) => half(p.bias[row]),
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
    accumulators
        .iter()
        .enumerate()
        .map(|(row, &a)| activate(layer, row, a))
        .collect()
}

/// One accumulator after the activation.
#[must_use]
pub fn activate(layer: &Layer, row: usize, a: f64) -> f64 {
    match (layer.activation, &layer.parameters) {
        (Activation::Identity, _) => a,
        (Activation::Relu, _) => a.max(0.0),
        (Activation::Leaky { shift }, _) => {
            if a < 0.0 {
                a / 2_f64.powi(i32::from(shift))
            } else {
                a
            }
        }
        (Activation::HardGelu { is_clamped, .. }, Parameters::Integer(p)) => {
            let x = gate_argument(a, p.scales[row], is_clamped) / 256.0;
            6.0 * 65_536.0 * hard_gelu(x)
        }
        (Activation::HardGelu { is_clamped, .. }, Parameters::Half(_)) => {
            hard_gelu(if is_clamped { a.min(3.0) } else { a })
        }
        (Activation::Table, Parameters::Integer(p)) => {
            table_entry(&p.table, table_index(a, p.scales[row]))
        }
        // A validated fp16 layer has no table.
        (Activation::Table, Parameters::Half(_)) => a,
    }
}

/// x · clamp(x/3 + ½, 0, 1).
#[must_use]
pub fn hard_gelu(x: f64) -> f64 {
    x * (x / 3.0 + 0.5).clamp(0.0, 1.0)
}

/// A hard GELU's argument in units of 1/256, clamped to 16 bits, or to at most 3.
#[must_use]
pub fn gate_argument(accumulator: f64, multiplier: Multiplier, is_clamped: bool) -> f64 {
    let high = if is_clamped { 768.0 } else { 32_767.0 };
    rescale(accumulator, multiplier).clamp(-32_768.0, high)
}

/// A table's index, from −128, clamped to a signed byte; not rounded.
#[must_use]
pub fn table_index(accumulator: f64, multiplier: Multiplier) -> f64 {
    rescale(accumulator, multiplier).clamp(-128.0, 127.0)
}

/// The table between its entries: a straight line. The entries are the definition; that a device
/// takes the nearest one is a rounding of the index, and is left out like any other.
#[must_use]
pub fn table_entry(table: &[i16], index: f64) -> f64 {
    let place = index + 128.0;
    let (below, inside) = (place.floor(), place - place.floor());
    let entry = |at: f64| {
        let entry = table.get(at as usize).or(table.last());
        entry.map_or(0.0, |&entry| f64::from(entry))
    };
    entry(below) + inside * (entry(below + 1.0) - entry(below))
}

/// The multiplier of a row's last rescaling: a hard GELU's rows share one; a table's entries are not
/// rescaled.
#[must_use]
pub fn output_multiplier(
    layer: &Layer,
    parameters: &IntegerParameters,
    row: usize,
) -> Option<Multiplier> {
    match layer.activation {
        Activation::HardGelu { scale, .. } => Some(scale),
        Activation::Identity | Activation::Relu | Activation::Leaky { .. } => {
            Some(parameters.scales[row])
        }
        Activation::Table => None,
    }
}

/// A hidden layer's output, clamped to its register's lanes.
#[must_use]
pub fn outputs(
    layer: &Layer,
    profile: &Profile,
    activated: &[f64],
    source: Option<Source<'_>>,
) -> Vec<f64> {
    let (low, high) = lane_range(layer.output_format());
    outputs_unclamped(layer, profile, activated, source)
        .iter()
        .map(|value| value.clamp(low, high))
        .collect()
}

/// As [`outputs`], before the clamp.
#[must_use]
pub fn outputs_unclamped(
    layer: &Layer,
    profile: &Profile,
    activated: &[f64],
    source: Option<Source<'_>>,
) -> Vec<f64> {
    activated
        .iter()
        .enumerate()
        .map(|(row, &a)| {
            let from = source.map(|source| source.values[row] - source.zero_point);
            match &layer.parameters {
                Parameters::Integer(p) => integer_output(layer, p, profile, (row, a), from),
                Parameters::Half(p) => half_output(p, a, from),
            }
        })
        .collect()
}

fn integer_output(
    layer: &Layer,
    parameters: &IntegerParameters,
    profile: &Profile,
    (row, a): (usize, f64),
    from: Option<f64>,
) -> f64 {
    let value = match output_multiplier(layer, parameters, row) {
        Some(multiplier) => rescale(a, multiplier),
        None => a,
    };
    let skip = layer.skip.zip(from).map_or(0.0, |(skip, from)| {
        let (low, high) = signed(profile.residual_bits);
        rescale(from, skip.scale).clamp(low, high)
    });
    value + skip + f64::from(parameters.zero_point)
}

fn half_output(parameters: &HalfParameters, a: f64, from: Option<f64>) -> f64 {
    let sum = a + from.unwrap_or(0.0);
    match parameters.quantize {
        None => sum,
        Some(quantize) => quantized(sum, quantize) + f64::from(quantize.zero_point),
    }
}

/// A real as a multiple of an integer register's step, less the zero point, within 32 bits and a
/// sign.
#[must_use]
pub fn quantized(real: f64, quantize: Quantize) -> f64 {
    let limit = 2_f64.powi(31);
    (real * 2_f64.powi(i32::from(quantize.exponent))).clamp(-limit, limit)
}

/// A real as an fp16 register holds it, but for the rounding.
#[must_use]
pub fn saturated(real: f64) -> f64 {
    real.clamp(-LARGEST_HALF, LARGEST_HALF)
}
