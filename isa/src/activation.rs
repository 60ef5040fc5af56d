//! Activations: what happens to an accumulator between two layers.
//!
//! Those of fp16 layers, on f32 sums, are in [`crate::half::activation`].

use crate::rescale::{Multiplier, Requantizer};
use crate::round::{Rounding, saturate};

/// Fractional bits of a hard GELU's argument: real = value / 2^8.
pub const GATE_FRACTION_BITS: u8 = 8;

/// The range of a hard GELU's argument: 16 bits.
pub const GATE_RANGE: (i32, i32) = (-32_768, 32_767);

/// The activation of a layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Activation {
    /// The accumulator itself.
    Identity,
    /// max(x, 0), on the accumulator.
    Relu,
    /// x for x ≥ 0, x / 2^shift below, on the accumulator, with the profile's leak rounding.
    Leaky {
        /// n of the slope 2^−n, 1..=7.
        shift: u8,
    },
    /// x · clamp(x/3 + ½, 0, 1), see [`gate`].
    HardGelu {
        /// From the gate's product to the layer's output scale, for all rows; one in an fp16 layer.
        scale: Multiplier,
        /// x is first limited to 3, as in NVIDIA's RTX SDK.
        is_clamped: bool,
    },
    /// An entry of the layer's table, see [`table_index`]; not in an fp16 layer.
    Table,
}

/// Entries of a layer's table.
pub const TABLE_ENTRIES: usize = 256;

/// The largest shift of a leaky ReLU.
pub const MAX_LEAK_SHIFT: u8 = 7;

impl Activation {
    /// The name in tables, assembly and JSON, without its parameter.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Activation::Identity => "identity",
            Activation::Relu => "relu",
            Activation::Leaky { .. } => "leaky",
            Activation::HardGelu {
                is_clamped: false, ..
            } => "hard-gelu",
            Activation::HardGelu {
                is_clamped: true, ..
            } => "hard-gelu-3",
            Activation::Table => "table",
        }
    }
}

impl Activation {
    /// The code in a file, without its parameters.
    #[must_use]
    pub const fn code(self) -> u8 {
        match self {
            Activation::Identity => 0,
            Activation::Relu => 1,
            Activation::Leaky { .. } => 2,
            Activation::HardGelu {
                is_clamped: false, ..
            } => 3,
            Activation::HardGelu {
                is_clamped: true, ..
            } => 4,
            Activation::Table => 5,
        }
    }

    /// The activation with this code and these parameters, if there is one.
    #[must_use]
    pub const fn from_code(code: u8, shift: u8, scale: Multiplier) -> Option<Activation> {
        Some(match code {
            0 => Activation::Identity,
            1 => Activation::Relu,
            2 => Activation::Leaky { shift },
            3 | 4 => Activation::HardGelu {
                scale,
                is_clamped: code == 4,
            },
            5 => Activation::Table,
            _ => return None,
        })
    }
}

/// Leaky ReLU of an accumulator with slope 2^−`shift`.
#[must_use]
pub const fn leak(accumulator: i32, shift: u8, rounding: Rounding) -> i32 {
    if accumulator >= 0 {
        accumulator
    } else {
        rounding.shift(accumulator as i64, shift as u32) as i32
    }
}

/// The product of a hard GELU, before it is rescaled.
///
/// `argument` is x with 8 fractional bits, 16 bits wide. Six times the gate, `6·(x/3 + ½)`, is
/// `2·x + 3` and therefore an integer with the same fractional bits; so the product
/// `argument · clamp(2·argument + 3·256, 0, 6·256)` is exact, and its real is product / (6·2^16).
/// At most 32768·1536 < 2^26 in magnitude.
#[must_use]
pub const fn gate(argument: i32) -> i32 {
    let one = 6 << GATE_FRACTION_BITS;
    let six_gates = saturate((2 * argument + one / 2) as i64, 0, one);
    argument * six_gates
}

/// A hard GELU's argument from its accumulator: rescaled per row, saturated to 16 bits, or to at
/// most 3 if the activation is clamped.
#[must_use]
pub const fn gate_argument(
    accumulator: i32,
    scale: Multiplier,
    requantizer: Requantizer,
    is_clamped: bool,
) -> i32 {
    let high = if is_clamped {
        3 << GATE_FRACTION_BITS
    } else {
        GATE_RANGE.1
    };
    saturate(
        requantizer.apply(accumulator, scale) as i64,
        GATE_RANGE.0,
        high,
    )
}

/// The entry of a layer's table for an accumulator: rescaled per row, saturated to a signed byte,
/// from entry 0 for −128 on.
#[must_use]
pub const fn table_index(accumulator: i32, scale: Multiplier, requantizer: Requantizer) -> usize {
    let byte = saturate(requantizer.apply(accumulator, scale) as i64, -128, 127);
    (byte + 128) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_gate_is_shut_below_and_open_above_three_halves() {
        for argument in GATE_RANGE.0..=GATE_RANGE.1 {
            let product = gate(argument);
            if argument <= -384 {
                assert_eq!(product, 0);
            } else if argument >= 384 {
                assert_eq!(product, argument * 1536);
            } else {
                // 6·2^16·x·(x/3 + 1/2) with x = argument/256.
                assert_eq!(product, argument * (2 * argument + 768));
            }
        }
    }

    #[test]
    fn a_leak_keeps_what_is_positive_and_rounds_what_is_not() {
        assert_eq!(leak(1000, 3, Rounding::HalfUp), 1000);
        assert_eq!(leak(-4, 3, Rounding::HalfUp), 0);
        assert_eq!(leak(-4, 3, Rounding::Floor), -1);
        assert_eq!(leak(-800, 3, Rounding::HalfEven), -100);
    }
}
