//! Layer: the integers of one fully connected layer of the synthesizer.

use crate::activation::Activation;
use crate::rescale::Multiplier;

/// The skip path that is added to a layer's output.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Skip {
    /// How many layers the path spans: 2 adds the input of the layer before this one.
    pub span: u8,
    /// From the source's scale to this layer's output scale.
    pub scale: Multiplier,
}

/// One layer.
///
/// ```text
/// accumulator[row] = bias[row] + Σ_k weights[row][k] · input[k]      k ascending, bias first
/// output[row] = saturate(rescale(activation(accumulator[row]), scales[row])
///                        + rescale(source[row] − source zero point, skip) + zero_point)
/// ```
///
/// The term of the skip path is there where [`Layer::skip`] is. A layer's input has a zero point
/// of its own (its predecessor's); the bias holds its contribution, −zero_point·Σ weights, so that
/// the datapath multiplies plain signed bytes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layer {
    /// Lanes in.
    pub inputs: u16,
    /// Rows.
    pub outputs: u16,
    /// `outputs` rows of `inputs` weights, within the asset's weight bits.
    pub weights: Vec<i8>,
    /// One for each row.
    pub bias: Vec<i32>,
    /// One for each row: accumulator scale to output scale (to 2^−8 where the activation is a hard
    /// GELU, whose own scale follows).
    pub scales: Vec<Multiplier>,
    /// The value that stands for the real zero of the output, −128..=127; 0 in the last layer.
    pub zero_point: i16,
    /// Between accumulator and rescaling; the identity in the last layer.
    pub activation: Activation,
    /// The skip path that ends here.
    pub skip: Option<Skip>,
}

impl Layer {
    /// The weights of one row.
    #[must_use]
    pub fn row(&self, row: usize) -> &[i8] {
        let inputs = usize::from(self.inputs);
        &self.weights[row * inputs..(row + 1) * inputs]
    }

    /// Multiplications per texel.
    #[must_use]
    pub fn macs(&self) -> u32 {
        u32::from(self.inputs) * u32::from(self.outputs)
    }
}
