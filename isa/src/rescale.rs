//! Requantisation: an accumulator becomes a value of another scale.
//!
//! The normative rule is TOSA 1.0 `RESCALE` with `SINGLE_ROUND` and a 32-bit multiplier
//! (`apply_scale_32`). The alternates are what shipped hardware and libraries do instead.

use crate::round::{Rounding, saturate};

/// A positive real scale as `mantissa / 2^shift`.
///
/// `mantissa` is in 2^30..2^31 (normalised), `shift` in 2..=62.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Multiplier {
    mantissa: i32,
    shift: u8,
}

/// Why a pair is no [`Multiplier`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MultiplierError {
    /// The mantissa found; 2^30..2^31 is allowed.
    pub mantissa: i64,
    /// The shift found; 2..=62 is allowed.
    pub shift: i64,
}

impl std::fmt::Display for MultiplierError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "multiplier {} / 2^{}: the mantissa must be in 1073741824..2147483648 and the shift in 2..=62",
            self.mantissa, self.shift
        )
    }
}

impl std::error::Error for MultiplierError {}

impl Multiplier {
    /// The scale 2^−k for 0 ≤ k ≤ 32.
    #[must_use]
    pub const fn power_of_two(k: u8) -> Multiplier {
        assert!(k <= 32);
        Multiplier {
            mantissa: 1 << 30,
            shift: 30 + k,
        }
    }

    /// The pair, checked.
    ///
    /// # Errors
    /// When either number is outside the range of its field.
    pub const fn new(mantissa: i32, shift: u8) -> Result<Multiplier, MultiplierError> {
        if mantissa >= 1 << 30 && shift >= 2 && shift <= 62 {
            Ok(Multiplier { mantissa, shift })
        } else {
            Err(MultiplierError {
                mantissa: mantissa as i64,
                shift: shift as i64,
            })
        }
    }

    /// The nearest multiplier to `significand · 2^exponent`, ties to even.
    ///
    /// The derivation is pinned to integers because libraries that derive it from floats differ by
    /// one in the last place (tensorflow issues 23800 and 103028). A caller that holds an `f64`
    /// hands over its exact significand and exponent.
    ///
    /// # Errors
    /// When the scale is zero or outside what `mantissa / 2^shift` can express.
    pub const fn nearest(significand: u64, exponent: i32) -> Result<Multiplier, MultiplierError> {
        if significand == 0 || significand > 1 << 62 {
            return Err(MultiplierError {
                mantissa: significand as i64,
                shift: -(exponent as i64),
            });
        }
        let width = 64 - significand.leading_zeros() as i32;
        let (mut mantissa, mut exponent) = if width > 31 {
            let drop = (width - 31) as u32;
            (
                Rounding::HalfEven.shift(significand as i64, drop),
                exponent + drop as i32,
            )
        } else {
            (
                (significand << (31 - width)) as i64,
                exponent - (31 - width),
            )
        };
        if mantissa == 1 << 31 {
            mantissa >>= 1;
            exponent += 1;
        }
        let shift = -(exponent as i64);
        if shift >= 2 && shift <= 62 {
            Ok(Multiplier {
                mantissa: mantissa as i32,
                shift: shift as u8,
            })
        } else {
            Err(MultiplierError { mantissa, shift })
        }
    }

    /// The mantissa, 2^30..2^31.
    #[must_use]
    pub const fn mantissa(self) -> i32 {
        self.mantissa
    }

    /// The shift, 2..=62.
    #[must_use]
    pub const fn shift(self) -> u8 {
        self.shift
    }

    /// The same mantissa with the real scale doubled `log2` times.
    ///
    /// # Errors
    /// When the shift would leave 2..=62.
    pub const fn times_power_of_two(self, log2: u8) -> Result<Multiplier, MultiplierError> {
        if self.shift >= log2 + 2 {
            Ok(Multiplier {
                mantissa: self.mantissa,
                shift: self.shift - log2,
            })
        } else {
            Err(MultiplierError {
                mantissa: self.mantissa as i64,
                shift: self.shift as i64 - log2 as i64,
            })
        }
    }
}

/// The arithmetic of one requantiser.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, serde::Serialize, serde::Deserialize,
)]
#[serde(rename_all = "kebab-case")]
pub enum Requantizer {
    /// One rounding of the full product, ties up. TOSA `RESCALE` `SINGLE_ROUND`. Normative.
    Single,
    /// Two roundings when the shift exceeds 31. TOSA `DOUBLE_ROUND`, gemmlowp.
    Double,
    /// One rounding of the full product, ties to even. Gemmini, RISC-V vector.
    HalfEven,
    /// One rounding of the full product, ties away from zero. NVDLA.
    HalfAway,
    /// A 16-bit multiplier: the mantissa is first rounded to its upper 16 bits (ties up, saturated
    /// at 32767), then one rounding, ties up. TOSA `apply_scale_16`.
    Narrow,
}

impl Requantizer {
    /// Every requantiser, in the order of its code in a file.
    pub const ALL: [Requantizer; 5] = [
        Requantizer::Single,
        Requantizer::Double,
        Requantizer::HalfEven,
        Requantizer::HalfAway,
        Requantizer::Narrow,
    ];

    /// The name in tables, assembly and JSON.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Requantizer::Single => "single",
            Requantizer::Double => "double",
            Requantizer::HalfEven => "half-even",
            Requantizer::HalfAway => "half-away",
            Requantizer::Narrow => "narrow",
        }
    }

    /// The code in a file.
    #[must_use]
    pub const fn code(self) -> u8 {
        self as u8
    }

    /// The requantiser with this code, if there is one.
    #[must_use]
    pub fn from_code(code: u8) -> Option<Requantizer> {
        Requantizer::ALL.get(usize::from(code)).copied()
    }

    /// `value · scale`, rounded to an integer and saturated to 32 bits.
    ///
    /// The product of two 32-bit numbers is below 2^62 in magnitude, so neither it nor the added
    /// half overflows 64 bits. Known answer (tensorflow issue 25087): 7984 · 1583594044 / 2^40 is
    /// 11.4991; single gives 11, double gives 12.
    #[must_use]
    pub const fn apply(self, value: i32, scale: Multiplier) -> i32 {
        let shift = scale.shift as u32;
        let product = value as i64 * scale.mantissa as i64;
        let rounded = match self {
            Requantizer::Single => Rounding::HalfUp.shift(product, shift),
            Requantizer::HalfEven => Rounding::HalfEven.shift(product, shift),
            Requantizer::HalfAway => Rounding::HalfAway.shift(product, shift),
            Requantizer::Double => {
                // The first rounding is to 2^-31 of the product, ties up; the second is the final
                // one, ties away from zero. TOSA folds both into a single addition.
                let first = if shift > 31 {
                    if value >= 0 {
                        1_i64 << 30
                    } else {
                        -(1_i64 << 30)
                    }
                } else {
                    0
                };
                Rounding::HalfUp.shift(product + first, shift)
            }
            Requantizer::Narrow => {
                let upper = Rounding::HalfUp.shift(scale.mantissa as i64, 16);
                let narrow = value as i64 * if upper > 32_767 { 32_767 } else { upper };
                if shift > 16 {
                    Rounding::HalfUp.shift(narrow, shift - 16)
                } else {
                    narrow << (16 - shift)
                }
            }
        };
        saturate(rounded, i32::MIN, i32::MAX)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn multiplier() -> impl Strategy<Value = Multiplier> {
        ((1_i32 << 30)..=i32::MAX, 2_u8..=62)
            .prop_map(|(mantissa, shift)| Multiplier::new(mantissa, shift).unwrap())
    }

    #[test]
    fn single_and_double_give_the_published_answers() {
        let scale = Multiplier::new(1_583_594_044, 40).unwrap();
        assert_eq!(Requantizer::Single.apply(7984, scale), 11);
        assert_eq!(Requantizer::Double.apply(7984, scale), 12);
    }

    #[test]
    fn ties_separate_the_single_roundings() {
        let half = Multiplier::power_of_two(1);
        let at = |value| Requantizer::ALL.map(|r| r.apply(value, half));
        // 1.5, 0.5, -0.5, -1.5 in the order Single, Double, HalfEven, HalfAway, Narrow. A shift of
        // 31 leaves Double a single rounding.
        assert_eq!(at(3), [2, 2, 2, 2, 2]);
        assert_eq!(at(1), [1, 1, 0, 1, 1]);
        assert_eq!(at(-1), [0, 0, 0, -1, 0]);
        assert_eq!(at(-3), [-1, -1, -2, -2, -1]);
    }

    #[test]
    fn nearest_keeps_what_fits_and_rounds_what_does_not() {
        assert_eq!(Multiplier::nearest(1, 0), Multiplier::new(1 << 30, 30));
        assert_eq!(Multiplier::nearest(3, -2), Multiplier::new(3 << 29, 31));
        let almost_one = (1_u64 << 53) - 1;
        assert_eq!(
            Multiplier::nearest(almost_one, -53),
            Multiplier::new(1 << 30, 30)
        );
        assert!(Multiplier::nearest(0, 0).is_err());
        assert!(Multiplier::nearest(1, 40).is_err());
        assert!(Multiplier::nearest(1, -80).is_err());
    }

    /// The requantisers by their published definitions: quotients and remainders in 128 bits.
    fn by_definition(requantizer: Requantizer, value: i32, scale: Multiplier) -> i128 {
        let (mantissa, shift) = (i128::from(scale.mantissa()), u32::from(scale.shift()));
        let product = i128::from(value) * mantissa;
        let half_up = |numerator: i128, unit: i128| (2 * numerator + unit).div_euclid(2 * unit);
        let away =
            |numerator: i128, unit: i128| numerator.signum() * half_up(numerator.abs(), unit);
        let unit = 1_i128 << shift;
        match requantizer {
            Requantizer::Single => half_up(product, unit),
            Requantizer::HalfAway => away(product, unit),
            Requantizer::HalfEven => {
                let up = half_up(product, unit);
                let is_tie = (2 * product).rem_euclid(2 * unit) == unit;
                if is_tie && up % 2 != 0 { up - 1 } else { up }
            }
            Requantizer::Double if shift > 31 => {
                // gemmlowp: SaturatingRoundingDoublingHighMul, whose division truncates after a nudge
                // of the product's sign, then RoundingDivideByPOT, ties away from zero.
                let nudge = if product >= 0 { 1 << 30 } else { 1 - (1 << 30) };
                let high = (product + nudge) / (1 << 31);
                away(high, 1 << (shift - 31))
            }
            Requantizer::Double => half_up(product, unit),
            Requantizer::Narrow => {
                let upper = half_up(mantissa, 1 << 16).min(32_767);
                let narrow = i128::from(value) * upper;
                if shift > 16 {
                    half_up(narrow, 1 << (shift - 16))
                } else {
                    narrow << (16 - shift)
                }
            }
        }
    }

    #[test]
    fn every_requantizer_is_its_definition_on_all_sixteen_bit_accumulators() {
        // Ties at many values, both ends of the mantissa and of the shift, where double rounding
        // begins, and the published case.
        let scales = [
            (1 << 30, 2),
            (1 << 30, 30),
            (1 << 30, 31),
            (1 << 30, 32),
            (1 << 30, 38),
            (3 << 29, 33),
            (5 << 28, 36),
            (0x6000_8000, 40),
            (i32::MAX, 2),
            (i32::MAX, 31),
            (i32::MAX, 47),
            (i32::MAX, 62),
            (1 << 30, 62),
            (1_583_594_044, 40),
        ];
        for (mantissa, shift) in scales {
            let scale = Multiplier::new(mantissa, shift).unwrap();
            for requantizer in Requantizer::ALL {
                for value in i32::from(i16::MIN)..=i32::from(i16::MAX) {
                    let exact = by_definition(requantizer, value, scale);
                    let saturated = exact.clamp(i128::from(i32::MIN), i128::from(i32::MAX));
                    assert_eq!(
                        i128::from(requantizer.apply(value, scale)),
                        saturated,
                        "{} of {value} by {mantissa} / 2^{shift}",
                        requantizer.name()
                    );
                }
            }
        }
    }

    proptest! {
        #[test]
        fn every_requantizer_is_its_definition(value: i32, scale in multiplier()) {
            for requantizer in Requantizer::ALL {
                let exact = by_definition(requantizer, value, scale);
                let saturated = exact.clamp(i128::from(i32::MIN), i128::from(i32::MAX));
                prop_assert_eq!(i128::from(requantizer.apply(value, scale)), saturated);
            }
        }

        #[test]
        fn single_is_the_nearest_integer_in_exact_arithmetic(value: i32, scale in multiplier()) {
            let product = i128::from(value) * i128::from(scale.mantissa());
            let unit = 1_i128 << scale.shift();
            let nearest = (2 * product + unit).div_euclid(2 * unit);
            let saturated = nearest.clamp(i128::from(i32::MIN), i128::from(i32::MAX));
            prop_assert_eq!(i128::from(Requantizer::Single.apply(value, scale)), saturated);
        }

        #[test]
        fn alternates_stay_within_one_of_the_normative_rule(
            value in -(1_i32 << 24)..(1_i32 << 24), scale in multiplier(),
        ) {
            let normative = i64::from(Requantizer::Single.apply(value, scale));
            for other in [Requantizer::Double, Requantizer::HalfEven, Requantizer::HalfAway] {
                prop_assert!((i64::from(other.apply(value, scale)) - normative).abs() <= 1);
            }
        }
    }
}
