//! Number: which number the bits of an f32 are, and how an exact quotient is rounded once.

use crate::round::Rounding;

/// A finite f32: exactly `significand · 2^exponent`; or an infinity, as a number beyond all others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Number {
    /// Below 2^24 in magnitude.
    pub significand: i64,
    /// −149..=104, or 1000 for an infinity. Above 0 the number is an even integer of 2^24 or more.
    pub exponent: i32,
}

/// The exponent of an infinity.
const INFINITE: i32 = 1000;

/// Fractional bits of a [`Fixed`].
pub const FIXED_BITS: u32 = 32;

/// A magnitude that no finite product of this module reaches before it saturates.
const BEYOND: i128 = 1 << 104;

/// An exact number by its floor: `(value + rest) / 2^32` with 0 < rest < 1 if `is_between`, else
/// rest = 0. That is enough to compare it with, and to round it to, multiples of 2^−32.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fixed {
    /// The floor, in 1/2^32.
    pub value: i128,
    /// Whether the number lies between two multiples of 2^−32.
    pub is_between: bool,
}

impl Number {
    /// The number with these bits. A NaN is 0 (Direct3D 11.3, 3.2.4.1). Subnormal numbers are what
    /// they are: a unit that flushes them to zero differs only where a rounding is `floor`.
    #[must_use]
    pub const fn from_bits(bits: u32) -> Number {
        let exponent = (bits >> 23 & 0xff) as i32;
        let fraction = (bits & 0x007f_ffff) as i64;
        let (magnitude, exponent) = match exponent {
            0xff if fraction == 0 => (1 << 23, INFINITE),
            0xff => (0, -149),
            0 => (fraction, -149),
            _ => (fraction | 1 << 23, exponent - 150),
        };
        Number {
            significand: if bits >> 31 == 1 {
                -magnitude
            } else {
                magnitude
            },
            exponent,
        }
    }

    /// The number times a factor of at most 2^20. What is 2^60 or more saturates far above that.
    #[must_use]
    pub const fn times(self, factor: u32) -> Fixed {
        let product = self.significand as i128 * factor as i128;
        let shift = self.exponent + FIXED_BITS as i32;
        let (value, is_between) = if shift > 60 {
            (BEYOND * product.signum(), false)
        } else if shift >= 0 {
            (product << shift, false)
        } else {
            let shift = if shift < -127 { 127 } else { -shift };
            let value = product >> shift;
            (value, value << shift != product)
        };
        Fixed { value, is_between }
    }
}

impl Fixed {
    /// `value / 2^32`, exactly.
    #[must_use]
    pub const fn exact(value: i128) -> Fixed {
        Fixed {
            value,
            is_between: false,
        }
    }

    /// The number plus `value / 2^32`.
    #[must_use]
    pub const fn plus(self, value: i128) -> Fixed {
        Fixed {
            value: self.value + value,
            is_between: self.is_between,
        }
    }

    /// The number limited to `low / 2^32..=high / 2^32`.
    #[must_use]
    pub const fn clamp(self, low: i128, high: i128) -> Fixed {
        if self.value < low {
            Fixed::exact(low)
        } else if self.value >= high {
            Fixed::exact(high)
        } else {
            self
        }
    }

    /// What is left above the largest multiple of `modulus / 2^32` that is not greater.
    #[must_use]
    pub const fn above_floor(self, modulus: i128) -> Fixed {
        Fixed {
            value: self.value.rem_euclid(modulus),
            is_between: self.is_between,
        }
    }

    /// What is left, with the number's sign, beyond the last multiple of `modulus / 2^32` on the way
    /// from zero.
    #[must_use]
    pub const fn beyond_zero(self, modulus: i128) -> Fixed {
        if self.value >= 0 {
            return self.above_floor(modulus);
        }
        // A number between two multiples of 2^−32 is nearer to zero than its floor.
        let magnitude = -self.value - self.is_between as i128;
        self.plus(magnitude.div_euclid(modulus) * modulus)
    }

    /// `self · 2^32 / denominator`, rounded once. The denominator is even and positive.
    #[must_use]
    pub const fn round(self, denominator: i128, rounding: Rounding) -> i128 {
        let floor = self.value.div_euclid(denominator);
        let remainder = self.value.rem_euclid(denominator);
        let half = denominator / 2;
        let is_above = remainder > half || (remainder == half && self.is_between);
        let is_tie = remainder == half && !self.is_between;
        floor + goes_up(rounding, floor, self.value >= 0, is_above, is_tie) as i128
    }
}

/// `numerator / denominator`, rounded once: [`Rounding::shift`] for any positive denominator.
///
/// With q the floor of the quotient and r what is left, the result is q + 1 where 2r is more than
/// the denominator. Where they are equal (a tie; there is none where the denominator is odd) it is
/// q + 1 by half-up, the even one of q and q + 1 by half-even, and the one farther from zero by
/// half-away. By floor it is always q.
#[must_use]
pub const fn divide(numerator: i128, denominator: i128, rounding: Rounding) -> i128 {
    let floor = numerator.div_euclid(denominator);
    let twice = 2 * numerator.rem_euclid(denominator);
    let (is_above, is_tie) = (twice > denominator, twice == denominator);
    floor + goes_up(rounding, floor, numerator >= 0, is_above, is_tie) as i128
}

const fn goes_up(
    rounding: Rounding,
    floor: i128,
    is_positive: bool,
    is_above: bool,
    is_tie: bool,
) -> bool {
    match rounding {
        Rounding::HalfUp => is_above || is_tie,
        Rounding::HalfEven => is_above || (is_tie && floor & 1 == 1),
        // The floor of a negative tie is the neighbour farther from zero already.
        Rounding::HalfAway => is_above || (is_tie && is_positive),
        Rounding::Floor => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dividing_by_a_power_of_two_is_a_rounded_shift() {
        for rounding in Rounding::ALL {
            for (shift, value) in (0..8).flat_map(|s| (-2000..2000_i64).map(move |v| (s, v))) {
                let expected = i128::from(rounding.shift(value, shift));
                assert_eq!(divide(value.into(), 1 << shift, rounding), expected);
                if shift > 0 {
                    let fixed = Fixed::exact(value.into());
                    assert_eq!(fixed.round(1 << shift, rounding), expected);
                }
            }
        }
    }

    #[test]
    fn a_quotient_goes_to_the_nearest_and_a_tie_as_its_mode_says() {
        for (n, d) in (1..=16_i128).flat_map(|d| (-200..200).map(move |n| (n, d))) {
            for rounding in [Rounding::HalfUp, Rounding::HalfEven, Rounding::HalfAway] {
                let result = divide(n, d, rounding);
                let distance = |q: i128| (q * d - n).abs();
                assert!(distance(result) <= distance(result - 1));
                assert!(distance(result) <= distance(result + 1));
                let other = [result - 1, result + 1]
                    .into_iter()
                    .find(|&q| distance(q) == distance(result));
                match (rounding, other) {
                    (_, None) => {}
                    (Rounding::HalfUp, Some(other)) => assert!(other < result),
                    (Rounding::HalfEven, Some(_)) => assert_eq!(result & 1, 0),
                    (Rounding::HalfAway, Some(other)) => assert!(other.abs() < result.abs()),
                    (Rounding::Floor, Some(_)) => unreachable!("not among the modes"),
                }
            }
            assert_eq!(divide(n, d, Rounding::Floor), n.div_euclid(d));
        }
    }

    #[test]
    fn what_lies_between_two_multiples_is_above_the_lower() {
        let between = |value| Fixed {
            value,
            is_between: true,
        };
        // 2 + rest over 4 is above a half, −2 + rest too: the floor of the latter is −1.
        for rounding in [Rounding::HalfUp, Rounding::HalfEven, Rounding::HalfAway] {
            assert_eq!(between(2).round(4, rounding), 1);
            assert_eq!(between(-2).round(4, rounding), 0);
            assert_eq!(between(1).round(4, rounding), 0);
        }
        assert_eq!(between(-1).round(4, Rounding::Floor), -1);
        assert_eq!(between(-2).clamp(-2, 3), between(-2));
        assert_eq!(between(-3).clamp(-2, 3), Fixed::exact(-2));
        assert_eq!(between(3).clamp(-2, 3), Fixed::exact(3));
    }

    #[test]
    fn remainders_are_those_of_a_number_a_quarter_above_its_floor() {
        // In quarters.
        let real = |n: Fixed| 4 * n.value + i128::from(n.is_between);
        for (value, modulus) in (-50..50_i128).flat_map(|v| (1..9).map(move |m| (v, m))) {
            for is_between in [false, true] {
                let number = Fixed { value, is_between };
                let floor = number.above_floor(modulus);
                assert_eq!(real(floor), real(number).rem_euclid(4 * modulus));
                let zero = number.beyond_zero(modulus);
                assert_eq!(real(zero), real(number) % (4 * modulus));
            }
        }
    }
}
