//! Rounding: the only place in the project where an integer loses its low bits.

/// How a quotient by a power of two becomes an integer.
///
/// Real meaning of every mode: `q = value / 2^shift`, then to the nearest integer, with ties as the
/// name says; [`Rounding::Floor`] has no ties.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, serde::Serialize, serde::Deserialize,
)]
#[serde(rename_all = "kebab-case")]
pub enum Rounding {
    /// Ties towards +∞: `(value + half) >> shift`. TOSA's `SINGLE_ROUND`.
    HalfUp,
    /// Ties to the even neighbour: IEEE 754 `roundTiesToEven`, RISC-V vector `rne`.
    HalfEven,
    /// Ties away from zero: NVDLA's `AC_RND_INF`, gemmlowp's `RoundingDivideByPOT`.
    HalfAway,
    /// Towards −∞: the arithmetic shift itself.
    Floor,
}

impl Rounding {
    /// Every mode, in the order of its code in a file.
    pub const ALL: [Rounding; 4] = [
        Rounding::HalfUp,
        Rounding::HalfEven,
        Rounding::HalfAway,
        Rounding::Floor,
    ];

    /// The name in tables, assembly and JSON.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Rounding::HalfUp => "half-up",
            Rounding::HalfEven => "half-even",
            Rounding::HalfAway => "half-away",
            Rounding::Floor => "floor",
        }
    }

    /// The code in a file.
    #[must_use]
    pub const fn code(self) -> u8 {
        self as u8
    }

    /// The mode with this code, if there is one.
    #[must_use]
    pub fn from_code(code: u8) -> Option<Rounding> {
        Rounding::ALL.get(usize::from(code)).copied()
    }

    /// `value / 2^shift`, rounded.
    ///
    /// `shift` is 0..=62 and `|value|` at most 2^62, so that adding the half cannot overflow.
    /// Worked example: `shift(-6, 2)` is −1.5, which gives −1 (half-up), −2 (half-even), −2
    /// (half-away), −2 (floor).
    #[must_use]
    pub const fn shift(self, value: i64, shift: u32) -> i64 {
        debug_assert!(shift <= 62);
        if shift == 0 {
            return value;
        }
        let half = 1_i64 << (shift - 1);
        let floor = value >> shift;
        let remainder = value - (floor << shift);
        let up = match self {
            Rounding::HalfUp => remainder >= half,
            Rounding::HalfEven => remainder > half || (remainder == half && floor & 1 == 1),
            // The floor of a negative tie is the neighbour farther from zero already.
            Rounding::HalfAway => remainder > half || (remainder == half && value >= 0),
            Rounding::Floor => false,
        };
        floor + up as i64
    }
}

/// `value` limited to `low..=high`.
#[must_use]
pub const fn saturate(value: i64, low: i32, high: i32) -> i32 {
    if value < low as i64 {
        low
    } else if value > high as i64 {
        high
    } else {
        value as i32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The definition, by comparing twice the distance: no shift, no mask.
    fn nearest_by_definition(mode: Rounding, value: i64, shift: u32) -> i64 {
        let unit = 1_i64 << shift;
        let below = value.div_euclid(unit);
        let twice = 2 * (value - below * unit);
        match mode {
            Rounding::Floor => below,
            _ if twice < unit => below,
            _ if twice > unit => below + 1,
            Rounding::HalfUp => below + 1,
            Rounding::HalfEven => below + below.rem_euclid(2),
            Rounding::HalfAway => below + i64::from(value > 0),
        }
    }

    #[test]
    fn every_mode_equals_its_definition_on_all_small_values() {
        for mode in Rounding::ALL {
            for shift in 1..=12 {
                for value in -20_000..=20_000 {
                    assert_eq!(
                        mode.shift(value, shift),
                        nearest_by_definition(mode, value, shift),
                        "{} of {value} / 2^{shift}",
                        mode.name()
                    );
                }
            }
        }
    }

    #[test]
    fn codes_and_names_are_distinct_and_return() {
        for mode in Rounding::ALL {
            assert_eq!(Rounding::from_code(mode.code()), Some(mode));
        }
        assert_eq!(Rounding::from_code(4), None);
    }

    #[test]
    fn the_largest_product_of_a_rescale_does_not_overflow() {
        let largest = (1_i64 << 31) * (1_i64 << 31);
        for mode in Rounding::ALL {
            assert_eq!(mode.shift(largest, 62), 1);
            assert_eq!(mode.shift(-largest, 62), -1);
        }
    }
}
