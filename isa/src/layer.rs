//! Layer: the numbers of one fully connected layer of the synthesizer.

use crate::activation::Activation;
use crate::half::Half;
use crate::rescale::Multiplier;
use crate::shape::LaneFormat;

/// The skip path that is added to a layer's output.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Skip {
    /// How many layers the path spans: 2 adds the input of the layer before this one.
    pub span: u8,
    /// From the source's scale to this layer's output scale; one between fp16 layers, which share
    /// a scale.
    pub scale: Multiplier,
}

/// One layer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layer {
    /// Lanes in.
    pub inputs: u16,
    /// Rows.
    pub outputs: u16,
    /// The arithmetic, with its numbers.
    pub parameters: Parameters,
    /// Between sum and output; the identity in the last layer.
    pub activation: Activation,
    /// The skip path that ends here.
    pub skip: Option<Skip>,
}

/// The arithmetic of a layer, with its numbers. Layers of both kinds may follow each other.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Parameters {
    /// Integers into integers.
    Integer(IntegerParameters),
    /// Halves, or integers read as halves, into halves or integers.
    Half(HalfParameters),
}

/// The numbers of an integer layer. Its input is an integer register.
///
/// ```text
/// accumulator[row] = bias[row] + Σ_k weights[row][k] · input[k]      k ascending, bias first
/// output[row] = saturate(rescale(activation(accumulator[row]), scales[row])
///                        + saturate(rescale(source[row] − source zero point, skip), residual bits)
///                        + zero_point)
/// ```
///
/// The term of the skip path is there where [`Layer::skip`] is. A layer's input has a zero point
/// of its own (its predecessor's); the bias holds its contribution, −zero_point·Σ weights, so that
/// the datapath multiplies plain signed integers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct IntegerParameters {
    /// Bits of a weight, 2..=8.
    pub weight_bits: u8,
    /// `outputs` rows of `inputs` weights.
    pub weights: Vec<i8>,
    /// One for each row, within the profile's bias bits.
    pub bias: Vec<i32>,
    /// One for each row: accumulator scale to output scale (to 2^−8 where the activation is a hard
    /// GELU, whose own scale follows; to the index where it is a table).
    pub scales: Vec<Multiplier>,
    /// Bits of an output, 4..=16; 8 in the last layer, which has formats instead.
    pub output_bits: u8,
    /// The value that stands for the real zero of the output; 0 in the last layer.
    pub zero_point: i16,
    /// 256 outputs, less the zero point, where the activation is a table; empty otherwise.
    pub table: Vec<i16>,
}

/// The numbers of an fp16 layer.
///
/// ```text
/// sum[row] = bias[row] + Σ_k weights[row][k] · input[k]      in f32, in the profile's order
/// output[row] = round(activation(sum[row]) + source[row])    to fp16, ties to even, saturated
/// ```
///
/// An integer register is read as (value − zero point) / 2^(bits − 1), rounded to fp16: exact up to
/// eleven bits and a sign. The last layer's channels are reals: 1 is the largest code of a unorm or
/// snorm format.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HalfParameters {
    /// `outputs` rows of `inputs` finite weights.
    pub weights: Vec<Half>,
    /// One for each row, finite.
    pub bias: Vec<Half>,
    /// To integers, for an integer layer that follows; none in the last layer.
    pub quantize: Option<Quantize>,
}

/// From the f32 sum of an fp16 layer to integers:
/// value = saturate(round(real · 2^exponent) + zero_point).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Quantize {
    /// Bits of a value, 4..=16.
    pub bits: u8,
    /// log2 of the values that stand for the real 1, −16..=24.
    pub exponent: i8,
    /// The value that stands for the real zero.
    pub zero_point: i16,
}

impl Layer {
    /// Multiplications per texel.
    #[must_use]
    pub fn macs(&self) -> u32 {
        u32::from(self.inputs) * u32::from(self.outputs)
    }

    /// The numbers of an integer layer.
    #[must_use]
    pub fn integer(&self) -> Option<&IntegerParameters> {
        match &self.parameters {
            Parameters::Integer(parameters) => Some(parameters),
            Parameters::Half(_) => None,
        }
    }

    /// The numbers of an fp16 layer.
    #[must_use]
    pub fn half(&self) -> Option<&HalfParameters> {
        match &self.parameters {
            Parameters::Integer(_) => None,
            Parameters::Half(parameters) => Some(parameters),
        }
    }

    /// What the register that it writes holds. The last layer writes none.
    #[must_use]
    pub fn output_format(&self) -> LaneFormat {
        match &self.parameters {
            Parameters::Integer(parameters) => LaneFormat::Integer {
                bits: parameters.output_bits,
                zero_point: parameters.zero_point,
            },
            Parameters::Half(HalfParameters {
                quantize: Some(quantize),
                ..
            }) => LaneFormat::Integer {
                bits: quantize.bits,
                zero_point: quantize.zero_point,
            },
            Parameters::Half(HalfParameters { quantize: None, .. }) => LaneFormat::Half,
        }
    }

    /// Bits of its numbers as a unit stores them: weights at their width; an integer row has a bias
    /// of `bias_bits` and a multiplier of 31 and 6 bits in 40, an fp16 row a bias of 16; a table
    /// has its entries.
    #[must_use]
    pub fn parameter_bits(&self, bias_bits: u8) -> u64 {
        let (macs, rows) = (u64::from(self.macs()), u64::from(self.outputs));
        match &self.parameters {
            Parameters::Integer(parameters) => {
                macs * u64::from(parameters.weight_bits)
                    + rows * (u64::from(bias_bits) + 40)
                    + parameters.table.len() as u64 * u64::from(parameters.output_bits)
            }
            Parameters::Half(_) => (macs + rows) * 16,
        }
    }
}

impl IntegerParameters {
    /// The weights of one row of a layer with `inputs` lanes in.
    #[must_use]
    pub fn row(&self, row: usize, inputs: u16) -> &[i8] {
        let inputs = usize::from(inputs);
        &self.weights[row * inputs..(row + 1) * inputs]
    }
}

impl HalfParameters {
    /// The weights of one row of a layer with `inputs` lanes in.
    #[must_use]
    pub fn row(&self, row: usize, inputs: u16) -> &[Half] {
        let inputs = usize::from(inputs);
        &self.weights[row * inputs..(row + 1) * inputs]
    }
}

/// A lane of an integer register as an fp16 layer reads it: (value − zero point) / 2^(bits − 1).
#[must_use]
pub const fn integer_as_half(value: i16, bits: u8, zero_point: i16) -> Half {
    Half::from_fixed(value as i128 - zero_point as i128, bits as u32 - 1)
}
