//! Bound: how far the model may lie from the oracle, derived from the profile, never tuned.
//!
//! * [`stage`]: given a stage's own integer input. Tight: one rounding moves its result by at most
//!   half an LSB, and the vectors and tests reach that.
//! * [`worst`]: end to end, sound. Every stage's bound is propagated through the actual weights as
//!   an interval; after a few layers it is loose, because it lets all roundings conspire.
//! * [`typical`]: end to end, expected. The variance of every rounding is propagated to the channel
//!   by the derivative of the channel with respect to it.
//!
//! All in LSB of the value that is bounded; reals of fp16 layers in units of one, where a rounding
//! moves a number by half the distance to its neighbour ([`float`]). A saturation is monotone and
//! never increases a distance, so clamps on both sides need no term of their own.
//!
//! An accumulator that overflows, and an fp16 sum that saturates on its way (`fused`), is no
//! rounding: the bounds hold where none does.

pub mod float;
mod interpolation;
mod range;
pub mod stage;
mod table;
pub mod typical;
pub mod worst;

use ntmu_isa::rescale::{Multiplier, Requantizer};
use ntmu_isa::round::Rounding;

/// The distance between the model and the oracle that is due to the oracle's own `f64`.
///
/// `magnitude` is the largest |value| on the way. A stage other than a dense layer rounds at most
/// four times (two products, two sums), each by 2^−53 of its result; a dense layer on integers is
/// exact, since its sums stay below 2^31. Below 2^−19 LSB even for a 32-bit value.
#[must_use]
pub fn float_error(magnitude: f64) -> f64 {
    magnitude.abs() * 2_f64.powi(-51)
}

/// A quotient by 2^`dropped_bits`: half an LSB to the nearest, and everything below the last unit
/// of the dividend for a floor; nothing where nothing is dropped.
#[must_use]
pub fn rounding(mode: Rounding, dropped_bits: u32) -> f64 {
    match mode {
        _ if dropped_bits == 0 => 0.0,
        Rounding::HalfUp | Rounding::HalfEven | Rounding::HalfAway => 0.5,
        Rounding::Floor => 1.0 - 2_f64.powi(-(dropped_bits as i32)),
    }
}

/// A rescaling of a value of at most `magnitude` in absolute value.
///
/// * `Single`, `HalfEven`, `HalfAway`: one rounding to the nearest, ½.
/// * `Double`: where the shift s exceeds 31, ±2^30 is added to the product before its rounding, so
///   the result moves by a further 2^30/2^s: ½ + 2^(30−s), at most ¾.
/// * `Narrow`: the mantissa M becomes `u = min(32767, M/2^16 to the nearest)`; the real value moves
///   by `magnitude·|u·2^16 − M|/2^s`, known from the multiplier itself. Then one rounding, ½, if
///   more than 16 bits are shifted out.
#[must_use]
pub fn requantize(requantizer: Requantizer, magnitude: f64, multiplier: Multiplier) -> f64 {
    let shift = i32::from(multiplier.shift());
    match requantizer {
        Requantizer::Single | Requantizer::HalfEven | Requantizer::HalfAway => 0.5,
        Requantizer::Double => 0.5 + double_offset(multiplier),
        Requantizer::Narrow => {
            let moved = magnitude.abs() * narrow_error(multiplier).abs();
            moved + if shift > 16 { 0.5 } else { 0.0 }
        }
    }
}

/// What `Double` adds to the real result of a positive value, and takes from that of a negative
/// one, before it rounds.
#[must_use]
pub fn double_offset(multiplier: Multiplier) -> f64 {
    let shift = i32::from(multiplier.shift());
    if shift > 31 {
        2_f64.powi(30 - shift)
    } else {
        0.0
    }
}

/// The scale that `Narrow` uses, less the scale that was meant.
#[must_use]
pub fn narrow_error(multiplier: Multiplier) -> f64 {
    let mantissa = f64::from(multiplier.mantissa());
    let upper = (mantissa / 65_536.0 + 0.5).floor().min(32_767.0);
    (upper * 65_536.0 - mantissa) / 2_f64.powi(i32::from(multiplier.shift()))
}

/// Six times 2^16 times a hard GELU of an argument in units of 1/256: what a gate computes, on
/// reals.
fn gate(argument: f64) -> f64 {
    argument * (2.0 * argument + 768.0).clamp(0.0, 1536.0)
}

/// The largest argument: of 16 bits, or 3.
fn gate_high(is_clamped: bool) -> f64 {
    if is_clamped { 768.0 } else { 32_767.0 }
}

/// How far a gate's product moves, at most, when its argument moves by `error`.
///
/// Between −384 and −192 the product falls, above it rises, below it is zero; so the extremes over
/// an interval are at its ends or at −192. Arguments are clamped to 16 bits, or to 3.
fn gate_error(argument: f64, error: f64, is_clamped: bool) -> f64 {
    let limit = |x: f64| x.clamp(-32_768.0, gate_high(is_clamped));
    let (low, high) = (limit(argument - error), limit(argument + error));
    let lowest = (-192.0_f64).clamp(low, high);
    let from = gate(limit(argument));
    [low, lowest, high]
        .iter()
        .map(|&at| (gate(at) - from).abs())
        .fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn multiplier() -> Multiplier {
        Multiplier::new(0x6000_4000, 40).unwrap()
    }

    #[test]
    fn a_narrow_multiplier_is_off_by_its_lower_half() {
        // 0x60004000 is 24576.25 · 2^16: the nearest is 24576, a quarter of 2^16 lower.
        assert_eq!(narrow_error(multiplier()), -16_384.0 / 2_f64.powi(40));
        let bound = requantize(Requantizer::Narrow, 2_f64.powi(20), multiplier());
        assert_eq!(bound, 0.5 + 2_f64.powi(20 + 14 - 40));
    }

    #[test]
    fn the_second_rounding_of_double_costs_a_quarter_at_most() {
        let at = |shift| Multiplier::new(1 << 30, shift).unwrap();
        let bound = |shift| requantize(Requantizer::Double, 1.0, at(shift));
        assert_eq!(
            [31, 32, 33, 62].map(bound),
            [0.5, 0.75, 0.625, 0.5 + 2_f64.powi(-32)]
        );
    }

    #[test]
    fn a_gates_error_is_the_largest_over_a_fine_walk_of_the_interval() {
        for argument in (-500..500).map(f64::from) {
            for error in [0.5, 3.25, 40.0, 200.0] {
                let walk = (-256..=256).map(|step| argument + error * f64::from(step) / 256.0);
                let moved = walk
                    .map(|at| (gate(at) - gate(argument)).abs())
                    .fold(0.0, f64::max);
                let bound = gate_error(argument, error, false);
                // A walk of 513 points misses the lowest point by 200/256 at most, and the product
                // is curved by 4 there.
                assert!(bound >= moved && bound - moved <= 2.0 * (200.0 / 256.0_f64).powi(2));
            }
        }
    }
}
