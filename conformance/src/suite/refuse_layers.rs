//! Of the refuse suite: what a layer must not hold.

use super::container::Container;
use crate::emit::Builder;
use crate::flag::{self, Flag};
use ntmu_isa::Asset;
use ntmu_isa::layer::{Layer, Parameters};

/// Where a layer's fields lie, from its first byte.
mod at {
    pub(super) const OUTPUTS: usize = 2;
    pub(super) const KIND: usize = 4;
    pub(super) const ACTIVATION: usize = 5;
    pub(super) const LEAK: usize = 6;
    pub(super) const SPAN: usize = 7;
    pub(super) const GATE: usize = 8;
    pub(super) const SKIP: usize = 13;
    pub(super) const WEIGHT_BITS: usize = 18;
    pub(super) const OUTPUT_BITS: usize = 19;
    pub(super) const ZERO_POINT: usize = 20;
    /// Of an integer layer's first row.
    pub(super) const MANTISSA: usize = 22;
    pub(super) const SHIFT: usize = 26;
    /// Of an fp16 layer.
    pub(super) const QUANTIZE_BITS: usize = 18;
    pub(super) const EXPONENT: usize = 19;
    pub(super) const BIAS: usize = 22;
}

/// Puts bytes somewhere in a section; comment and flag say what is wrong then.
pub(super) type Change<'a> = dyn FnMut(&str, Flag, &str, usize, &[u8]) + 'a;

/// Files of integer layers that hold what they must not, with every CRC-32 right.
pub(super) fn layer_fields(change: &mut Change<'_>, asset: &Asset) {
    let (range, clash, reserved) = (flag::FIELD_RANGE, flag::CONTRADICTION, flag::RESERVED);
    let first = 4;
    let second = first + layer_bytes(&asset.layers[0]);
    let last = second + layer_bytes(&asset.layers[1]);
    let mut put = |comment: &str, flag, at, bytes: &[u8]| change(comment, flag, "WGTS", at, bytes);
    put("no layers", range, 0, &[0, 0]);
    put("65 layers", range, 0, &[65, 0]);
    put("a layer fewer than there are", clash, 0, &[2, 0]);
    put("a reserved bit of the weights", reserved, 3, &[1]);
    let more = asset.layers[0].inputs as u8 + 1;
    put("an input more than there are", clash, first, &[more]);
    put("1025 outputs", range, first + at::OUTPUTS, &[1, 4]);
    put("a layer of kind 2", range, first + at::KIND, &[2]);
    put("activation 6", range, first + at::ACTIVATION, &[6]);
    put("a leak of 2^-8", range, first + at::ACTIVATION, &[2, 8]);
    put("a leak of 2^0", range, first + at::ACTIVATION, &[2, 0]);
    put(
        "a leak where nothing leaks",
        reserved,
        first + at::LEAK,
        &[1],
    );
    put(
        "a gate's scale where there is no gate",
        reserved,
        first + at::GATE,
        &[1],
    );
    put(
        "a skip path into the first layer",
        clash,
        first + at::SPAN,
        &[1],
    );
    put("weights of one bit", range, first + at::WEIGHT_BITS, &[1]);
    put("weights of nine bits", range, first + at::WEIGHT_BITS, &[9]);
    put(
        "outputs of three bits",
        range,
        first + at::OUTPUT_BITS,
        &[3],
    );
    put("outputs of 17 bits", range, first + at::OUTPUT_BITS, &[17]);
    put(
        "a zero point of 128",
        range,
        first + at::ZERO_POINT,
        &[128, 0],
    );
    put(
        "a zero point of -129",
        range,
        first + at::ZERO_POINT,
        &[127, 255],
    );
    put(
        "a mantissa of 2^30 - 1",
        range,
        first + at::MANTISSA,
        &[255, 255, 255, 63],
    );
    put(
        "a negative mantissa",
        range,
        first + at::MANTISSA + 3,
        &[128],
    );
    put("a shift of 1", range, first + at::SHIFT, &[1]);
    put("a shift of 63", range, first + at::SHIFT, &[63]);
    put("a skip path of four layers", range, second + at::SPAN, &[4]);
    put(
        "a skip path from before the first layer",
        clash,
        second + at::SPAN,
        &[2],
    );
    put(
        "a skip path's scale where there is none",
        reserved,
        second + at::SPAN,
        &[0],
    );
    put(
        "a zero point in the last layer",
        range,
        last + at::ZERO_POINT,
        &[1],
    );
    put(
        "outputs of nine bits in the last layer",
        range,
        last + at::OUTPUT_BITS,
        &[9],
    );
    put(
        "a ReLU in the last layer",
        range,
        last + at::ACTIVATION,
        &[1],
    );
    put(
        "a skip path into the last layer",
        range,
        last + at::SPAN,
        &[1],
    );
}

/// Files of fp16 layers that hold what they must not, with every CRC-32 right.
pub(super) fn half_fields(builder: &mut Builder, container: &Container, asset: &Asset) {
    let (range, clash, reserved) = (flag::FIELD_RANGE, flag::CONTRADICTION, flag::RESERVED);
    let mut put = |comment: &str, flag: Flag, at: usize, bytes: &[u8]| {
        let changed = container.with("WGTS", at, bytes).to_bytes();
        builder.refused(comment, &[flag], changed);
    };
    let first = 4;
    let second = first + layer_bytes(&asset.layers[0]);
    let last = second + layer_bytes(&asset.layers[1]);
    let weights = first + at::BIAS + 2 * usize::from(asset.layers[0].outputs);
    put("an infinite bias", range, first + at::BIAS, &[0, 0x7c]);
    put("a weight that is no number", range, weights, &[1, 0xfe]);
    put(
        "an exponent where nothing becomes an integer",
        reserved,
        first + at::EXPONENT,
        &[1],
    );
    put(
        "integers of 17 bits",
        range,
        first + at::QUANTIZE_BITS,
        &[17],
    );
    put(
        "integers of 2^25 steps to one",
        range,
        first + at::QUANTIZE_BITS,
        &[8, 25],
    );
    put(
        "integers about a zero point that they do not hold",
        range,
        first + at::QUANTIZE_BITS,
        &[8, 0, 128, 0],
    );
    put(
        "a skip path from integers into an fp16 layer",
        clash,
        first + at::QUANTIZE_BITS,
        &[8, 7],
    );
    put(
        "a table in an fp16 layer",
        clash,
        first + at::ACTIVATION,
        &[5],
    );
    put(
        "a gate's scale other than one in an fp16 layer",
        clash,
        first + at::ACTIVATION,
        &[3, 0, 0, 0, 0, 0, 0x40, 31],
    );
    put(
        "a skip path's scale other than one in an fp16 layer",
        clash,
        second + at::SKIP + 4,
        &[31],
    );
    put(
        "integers from the last layer",
        range,
        last + at::QUANTIZE_BITS,
        &[8, 7],
    );
    put(
        "a layer of the other kind than its body",
        clash,
        last + at::KIND,
        &[0],
    );
}

/// Bytes of a layer in the section of weights.
fn layer_bytes(layer: &Layer) -> usize {
    let rows = usize::from(layer.outputs);
    let weights = layer.macs() as usize;
    at::BIAS
        + match &layer.parameters {
            Parameters::Integer(p) => {
                9 * rows + 2 * p.table.len() + (weights * usize::from(p.weight_bits)).div_ceil(8)
            }
            Parameters::Half(_) => 2 * (rows + weights),
        }
}
