//! Halves: the fp16 layer that real parameters stand for.
//!
//! ```text
//! read   = 2^−(bits − 1) where the register holds integers, else 1     as the layer reads a unit
//! weight = fp16(W · s_in / read)                                        s_in: what a unit means
//! bias   = fp16(b)
//! ```

use crate::epilogue::half::Ending;
use crate::epilogue::integer::Saturation;
use crate::network::{Epilogue, Halves, Prepared, transpose};
use crate::quantise::Context;

/// The nearest half, ties to even, saturated at ±65504; a NaN stays one.
///
/// [`ntmu_isa::half::Half::round`] in vectors. Of a zero only the sign may differ.
#[inline(always)]
pub(crate) fn round_half(number: f32) -> f32 {
    const LARGEST: f32 = 65_504.0;
    /// 2^−14, the smallest normal half.
    const NORMAL: f32 = f32::from_bits((127 - 14) << 23);
    /// Floats around it are multiples of 2^−24, as subnormal halves are.
    const AMONG_MULTIPLES: f32 = 0.75;
    let bits = number.to_bits();
    let carried = bits.wrapping_add(0x0fff + (bits >> 13 & 1));
    let normal = f32::from_bits(carried & !0x1fff);
    let subnormal = (number + AMONG_MULTIPLES) - AMONG_MULTIPLES;
    let rounded = if number.abs() < NORMAL {
        subnormal
    } else {
        normal
    };
    rounded.clamp(-LARGEST, LARGEST)
}

/// The fp16 layer, and the derivative of its rows' weights by the real ones.
pub(crate) fn half_layer(context: &Context<'_>) -> (Prepared, Vec<f32>) {
    let Context {
        topology,
        widths,
        index,
        shape,
        weights,
        bias,
        input_scale,
        ..
    } = *context;
    let unit_of = |bits: u8| 1.0 / (1_u32 << (bits - 1)) as f32;
    let read = match index.checked_sub(1) {
        None => unit_of(widths.input),
        Some(before) if topology.writes_halves(before) => 1.0,
        Some(_) => unit_of(widths.activation),
    };
    let gain = input_scale / read;
    let weights: Vec<f32> = weights
        .iter()
        .map(|w| round_half(w * gain) * read)
        .collect();
    let ending = match context.range() {
        None => Ending::Codes(context.codes()),
        Some(_) if topology.writes_halves(index) => Ending::Round,
        Some(range) => Ending::Quantise {
            factor: 1.0 / f64::from(range.scale),
            saturation: Saturation {
                zero: f64::from(range.zero_point),
                range: widths.lanes(),
            },
        },
    };
    let mut derivative = vec![input_scale; shape.columns()];
    derivative[shape.outputs..].fill(0.0);
    let layer = Prepared {
        shape,
        transposed: transpose(&weights, shape.rows(), shape.columns()),
        weights,
        bias: bias.iter().map(|&b| round_half(b)).collect(),
        epilogue: Epilogue::Half(Halves { read, ending }),
    };
    (layer, derivative)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ntmu_isa::half::Half;

    #[test]
    fn rounding_is_isas_at_every_half_every_midpoint_and_beside_them() {
        // Rounding is monotone, so that the floats at and beside every place where it can change
        // decide it everywhere.
        for bits in 0..0x7c00_u16 {
            let half = Half::from_bits(bits).to_f32();
            let next = Half::from_bits((bits + 1).min(0x7bff)).to_f32();
            let middle = f32::midpoint(half, next);
            for float in [half, middle].into_iter().flat_map(|f| {
                let bits = f.to_bits();
                [bits.saturating_sub(1), bits, bits + 1].map(f32::from_bits)
            }) {
                for number in [float, -float] {
                    assert_eq!(
                        round_half(number),
                        Half::round(number).to_f32(),
                        "{number:e}"
                    );
                }
            }
        }
        for number in [65_519.9, 65_520.0, 1e9, f32::INFINITY, 1e-30, 0.0] {
            assert_eq!(
                round_half(number),
                Half::round(number).to_f32(),
                "{number:e}"
            );
            assert_eq!(round_half(-number), Half::round(-number).to_f32());
        }
        assert!(round_half(f32::NAN).is_nan());
    }
}
