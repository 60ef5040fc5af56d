//! The rescale suite: every requantiser at its ties, beside them, and at the edges of 32 bits.
//!
//! Random operands do not find ties, so they are solved for. With `2^t` the largest power of two in
//! the mantissa, `value·mantissa / 2^s` is a tie exactly where `value = odd · 2^(s−1−t)`.

use super::SuiteError;
use crate::emit::Builder;
use crate::flag::{self, Flag};
use crate::vector::{Answer, Query, RescaleQuery, VectorFile};
use ntmu_isa::rescale::{Multiplier, Requantizer};

/// Mantissas with 30, 29, 14, 2 and 0 trailing zeros.
const MANTISSAS: [i32; 5] = [1 << 30, 3 << 29, 0x4abc_4000, 1_583_594_044, i32::MAX];

/// Shifts around the one where `Double` begins, some larger, and the largest.
const SHIFTS: [u8; 6] = [31, 32, 33, 40, 46, 61];

/// The suite.
///
/// # Errors
/// Never: all multipliers are within their limits.
pub fn suite() -> Result<VectorFile, SuiteError> {
    let about = "value * mantissa / 2^shift by each requantiser: ties, their neighbours, \
                 saturation, published answers";
    let mut cases = Cases {
        builder: Builder::new("rescale", about),
    };
    cases.add(
        "the published example",
        &[flag::KNOWN_ANSWER],
        7984,
        1_583_594_044,
        40,
    )?;
    for mantissa in MANTISSAS {
        for shift in SHIFTS {
            ties(&mut cases, mantissa, shift)?;
            double_ties(&mut cases, mantissa, shift)?;
        }
    }
    for (mantissa, shift) in [(0x4001_1234, 33), (0x6000_7fff, 36), (0x7abc_def0, 45)] {
        narrow_ties(&mut cases, mantissa, shift)?;
    }
    // Between two 16-bit multipliers, and above the largest.
    for mantissa in [0x4000_8000, 0x4000_7fff, 0x7fff_7fff, 0x7fff_8000, i32::MAX] {
        for value in [1 << 20, -(1 << 20) - 1] {
            cases.add(
                "a mantissa to narrow",
                &[flag::NARROW_MANTISSA],
                value,
                mantissa,
                40,
            )?;
        }
    }
    for shift in [2, 3, 15, 16, 17] {
        for value in [0, 1, -1, 3, 32_767, i32::MAX, i32::MIN] {
            cases.add(
                "a small shift",
                &[flag::SMALL_SHIFT],
                value,
                0x4000_0001,
                shift,
            )?;
        }
    }
    for value in [i32::MAX, i32::MAX - 1, i32::MIN, i32::MIN + 1] {
        cases.add(
            "the largest shift",
            &[flag::LARGE_SHIFT],
            value,
            1 << 30,
            62,
        )?;
        cases.add(
            "the largest product",
            &[flag::LARGE_SHIFT],
            value,
            i32::MAX,
            62,
        )?;
        cases.add("times one", &[flag::SATURATION], value, 1 << 30, 30)?;
        cases.add(
            "times a little more than one",
            &[flag::SATURATION],
            value,
            (1 << 30) + 1,
            30,
        )?;
    }
    for value in [(1 << 30) - 1, 1 << 30, -(1 << 30), -(1 << 30) - 1] {
        cases.add("times two", &[flag::SATURATION], value, 1 << 30, 29)?;
    }
    for value in [0, 1, -1, 1000, -1000, 123_456_789, -123_456_789] {
        cases.add("no tie", &[flag::PLAIN], value, 0x6789_abcd, 38)?;
    }
    Ok(cases.builder.build())
}

/// Ties of the product: `odd · 2^(s−1−t)` for small odd numbers, and the neighbours.
fn ties(cases: &mut Cases, mantissa: i32, shift: u8) -> Result<(), SuiteError> {
    let zeros = mantissa.trailing_zeros();
    let Some(power) = u32::from(shift).checked_sub(1 + zeros) else {
        return Ok(());
    };
    for odd in [1_i64, -1, 3, -3] {
        let Ok(value) = i32::try_from(odd << power) else {
            continue;
        };
        let flags: &[Flag] = if odd < 0 {
            &[flag::TIE, flag::NEGATIVE_TIE]
        } else {
            &[flag::TIE]
        };
        cases.add("a tie", flags, value, mantissa, shift)?;
        if odd.abs() == 1 {
            for beside in [value.saturating_sub(1), value.saturating_add(1)] {
                cases.add("beside a tie", &[flag::NEAR_TIE], beside, mantissa, shift)?;
            }
        }
    }
    Ok(())
}

/// Ties of `Double`'s second rounding: product ± 2^30 ≡ 2^(s−1) modulo 2^s.
///
/// With the mantissa `o·2^t`, o odd, and the value `v·2^(30−t)`, the product is `o·v·2^30`; so
/// `o·v ≡ 2^(s−31) − 1` modulo 2^(s−30), and v is that times the inverse of o.
fn double_ties(cases: &mut Cases, mantissa: i32, shift: u8) -> Result<(), SuiteError> {
    let zeros = mantissa.trailing_zeros();
    let shift_bits = u32::from(shift);
    if shift_bits < 32 || shift_bits > 31 + zeros {
        return Ok(());
    }
    let modulus = 1_i64 << (shift_bits - 30);
    let odd = i64::from(mantissa >> zeros);
    let target = (1_i64 << (shift_bits - 31)) - 1;
    let v = (target * inverse(odd, modulus)).rem_euclid(modulus);
    for v in [v, -v] {
        let Ok(value) = i32::try_from(v << (30 - zeros)) else {
            continue;
        };
        cases.add(
            "a tie of the second rounding",
            &[flag::DOUBLE_TIE],
            value,
            mantissa,
            shift,
        )?;
        for beside in [value.saturating_sub(1), value.saturating_add(1)] {
            cases.add("beside a tie", &[flag::NEAR_TIE], beside, mantissa, shift)?;
        }
    }
    Ok(())
}

/// Ties of the product with the 16-bit multiplier.
fn narrow_ties(cases: &mut Cases, mantissa: i32, shift: u8) -> Result<(), SuiteError> {
    let upper = ((i64::from(mantissa) + 32_768) / 65_536).min(32_767);
    let Some(power) = u32::from(shift).checked_sub(17 + upper.trailing_zeros()) else {
        return Ok(());
    };
    for odd in [1_i64, -1, 3, -3] {
        if let Ok(value) = i32::try_from(odd << power) {
            cases.add(
                "a tie of 16 bits",
                &[flag::NARROW_TIE],
                value,
                mantissa,
                shift,
            )?;
        }
    }
    Ok(())
}

/// The inverse of an odd number modulo a power of two, by Newton's iteration: every step doubles
/// the bits that are right, starting from three.
fn inverse(odd: i64, modulus: i64) -> i64 {
    let mut inverse = odd;
    for _ in 0..5 {
        inverse = inverse.wrapping_mul(2_i64.wrapping_sub(odd.wrapping_mul(inverse)));
    }
    inverse.rem_euclid(modulus)
}

struct Cases {
    builder: Builder,
}

impl Cases {
    /// Adds the operands for every requantiser.
    fn add(
        &mut self,
        comment: &str,
        flags: &[Flag],
        value: i32,
        mantissa: i32,
        shift: u8,
    ) -> Result<(), SuiteError> {
        let scale = Multiplier::new(mantissa, shift)?;
        for requantizer in Requantizer::ALL {
            let query = RescaleQuery {
                requantizer,
                value,
                mantissa,
                shift,
            };
            let answer = Answer::Value(requantizer.apply(value, scale));
            self.builder
                .exact(comment, flags, Query::Rescale(query), answer);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_inverse_times_its_number_is_one() {
        for odd in (1_i64..2000)
            .step_by(2)
            .chain([0x5555_5555, i64::from(i32::MAX)])
        {
            for bits in 1..32 {
                let modulus = 1_i64 << bits;
                let product = i128::from(odd) * i128::from(inverse(odd, modulus));
                assert_eq!(product.rem_euclid(i128::from(modulus)), 1);
            }
        }
    }
}
