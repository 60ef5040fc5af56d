//! Floats: fp16 and f32 as exact multiples of powers of two, rounded where the specification says.
//!
//! No float of the host is used. A number is an integer times a power of two, sums and products are
//! exact, and a rounding is written out.

use super::number::{divide, power};
use ntmu_isa::half::Half;
use ntmu_isa::round::Rounding;

/// ±magnitude · 2^exponent; zeros have a sign.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Number {
    /// The sign, also of a zero.
    pub is_negative: bool,
    /// Below 2^100.
    pub magnitude: i128,
    /// log2 of the magnitude's unit.
    pub exponent: i32,
}

impl Number {
    /// +0.
    pub const ZERO: Number = Number {
        is_negative: false,
        magnitude: 0,
        exponent: 0,
    };

    /// An integer.
    #[must_use]
    pub fn integer(value: i128) -> Number {
        Number {
            is_negative: value < 0,
            magnitude: value.abs(),
            exponent: 0,
        }
    }

    /// A number by its fp16 bits: sign, five bits of exponent, ten of fraction.
    #[must_use]
    pub fn from_half(half: Half) -> Number {
        let bits = half.bits();
        let (exponent, fraction) = (i32::from(bits / 1024 % 32), i128::from(bits % 1024));
        let (magnitude, exponent) = if exponent == 0 {
            (fraction, -24)
        } else {
            (fraction + 1024, exponent - 25)
        };
        Number {
            is_negative: bits >= 32_768,
            magnitude,
            exponent,
        }
    }

    fn signed(self) -> i128 {
        if self.is_negative {
            -self.magnitude
        } else {
            self.magnitude
        }
    }

    /// The exact product.
    #[must_use]
    pub fn times(self, other: Number) -> Number {
        Number {
            is_negative: self.is_negative != other.is_negative,
            magnitude: self.magnitude * other.magnitude,
            exponent: self.exponent + other.exponent,
        }
    }

    /// The exact sum; what cancels is +0, and so is the sum of zeros of both signs.
    ///
    /// In a layer both are multiples of 2^−100 and below 2^44; of numbers farther apart the larger one.
    #[must_use]
    pub fn plus(self, other: Number) -> Number {
        if self.magnitude == 0 && other.magnitude == 0 {
            return Number {
                is_negative: self.is_negative && other.is_negative,
                ..Number::ZERO
            };
        }
        let is_lost = !self.fits_beside(other);
        if self.magnitude == 0 || (is_lost && self.is_smaller(other)) {
            return other;
        }
        if other.magnitude == 0 || is_lost {
            return self;
        }
        let exponent = self.exponent.min(other.exponent);
        let aligned = |n: Number| n.signed() * power((n.exponent - exponent) as u32);
        let sum = aligned(self) + aligned(other);
        Number {
            is_negative: sum < 0,
            magnitude: sum.abs(),
            exponent,
        }
    }

    /// Whether both can be written as multiples of one power of two in 126 bits.
    fn fits_beside(self, other: Number) -> bool {
        let lowest = self.exponent.min(other.exponent);
        let width = |n: Number| n.exponent - lowest + bits(n.magnitude);
        width(self).max(width(other)) <= 126
    }

    fn is_smaller(self, other: Number) -> bool {
        bits(self.magnitude) + self.exponent < bits(other.magnitude) + other.exponent
    }

    /// The nearest number with `precision` significant bits that is a multiple of 2^`last`, ties to
    /// even; the sign stays.
    fn rounded(self, precision: i32, last: i32) -> Number {
        let drop = (bits(self.magnitude) - precision).max(last - self.exponent);
        if drop <= 0 || self.magnitude == 0 {
            return self;
        }
        let magnitude = if drop > 120 {
            0
        } else {
            divide(self.magnitude, power(drop as u32), Rounding::HalfEven)
        };
        Number {
            magnitude,
            exponent: self.exponent + drop,
            ..self
        }
    }

    /// The nearest f32. None of ours is too large for it.
    #[must_use]
    pub fn to_single(self) -> Number {
        self.rounded(24, -149)
    }

    /// The nearest fp16 number, saturated at ±65504, and whether it was.
    #[must_use]
    pub fn to_half(self) -> (Number, bool) {
        let rounded = self.rounded(11, -24);
        let largest = Number::integer(65_504);
        let is_beyond = rounded.is_above(largest);
        let number = if is_beyond {
            Number {
                is_negative: self.is_negative,
                ..largest
            }
        } else {
            rounded
        };
        (number, is_beyond)
    }

    /// Whether its magnitude is above another's.
    fn is_above(self, other: Number) -> bool {
        let lowest = self.exponent.min(other.exponent);
        let order = |n: Number| n.exponent + bits(n.magnitude);
        if self.magnitude == 0 || order(self) != order(other) {
            return self.magnitude != 0 && order(self) > order(other);
        }
        // Of the same order of magnitude, and both have few bits.
        let aligned = |n: Number| n.magnitude * power((n.exponent - lowest) as u32);
        aligned(self) > aligned(other)
    }

    /// Greater than zero.
    #[must_use]
    pub fn is_positive(self) -> bool {
        self.magnitude > 0 && !self.is_negative
    }

    /// Less than zero.
    #[must_use]
    pub fn is_below_zero(self) -> bool {
        self.magnitude > 0 && self.is_negative
    }

    /// Greater than an integer.
    #[must_use]
    pub fn exceeds(self, limit: i128) -> bool {
        self.plus(Number::integer(-limit)).is_positive()
    }

    /// A hard GELU as four f32 operations: (x · clamp(2x + 3, 0, 6)) · the f32 nearest to 1/6, of an x
    /// limited to 3 if it is clamped. The number is an f32.
    #[must_use]
    pub fn hard_gelu(self, is_clamped: bool) -> Number {
        let x = if is_clamped && self.exceeds(3) {
            Number::integer(3)
        } else {
            self
        };
        let doubled = Number {
            exponent: x.exponent + 1,
            ..x
        };
        let gates = doubled.plus(Number::integer(3)).to_single();
        let gates = if gates.is_below_zero() {
            Number::ZERO
        } else if gates.exceeds(6) {
            Number::integer(6)
        } else {
            gates
        };
        // 11184811 / 2^26, the f32 nearest to 1/6.
        let sixth = Number {
            magnitude: 11_184_811,
            exponent: -26,
            ..Number::ZERO
        };
        x.times(gates).to_single().times(sixth).to_single()
    }

    /// number · factor · 2^exponent as an integer within 32 bits and a sign.
    #[must_use]
    pub fn to_integer(self, factor: i128, exponent: i32, mode: Rounding) -> i128 {
        let value = self.signed() * factor;
        let shift = self.exponent + exponent;
        let limit = power(31);
        let result = if value == 0 {
            0
        } else if shift >= 0 {
            // 24 bits times 16 bits; beyond 2^31 anything saturates.
            value * power(shift.min(40) as u32)
        } else if shift < -100 {
            divide(value.signum(), 4, mode)
        } else {
            divide(value, power((-shift) as u32), mode)
        };
        result.clamp(-limit, limit)
    }

    /// The bits of an f32. The number is one.
    #[must_use]
    pub fn single_bits(self) -> u32 {
        self.encode(24, 127) as u32
    }

    /// The bits of an fp16 number. The number is one.
    #[must_use]
    pub fn half_bits(self) -> u16 {
        self.encode(11, 15) as u16
    }

    /// Sign, exponent and fraction, as IEEE 754 interchange formats have them.
    fn encode(self, precision: i32, bias: i32) -> i128 {
        let width = if precision == 11 { 16 } else { 32 };
        let sign = if self.is_negative {
            power(width - 1)
        } else {
            0
        };
        if self.magnitude == 0 {
            return sign;
        }
        // One bit, or ten and one, or twenty-three and one: the leading bit is implied.
        let top = bits(self.magnitude) - 1 + self.exponent;
        let lowest = (top + 1 - precision).max(2 - bias - precision);
        let shift = self.exponent - lowest;
        let significand = if shift >= 0 {
            self.magnitude * power(shift as u32)
        } else {
            self.magnitude / power((-shift) as u32)
        };
        let leading = power(precision as u32 - 1);
        if significand < leading {
            return sign + significand;
        }
        sign + i128::from(top + bias) * leading + (significand - leading)
    }
}

/// Bits of a positive integer; 0 of zero.
fn bits(magnitude: i128) -> i32 {
    let (mut rest, mut bits) = (magnitude, 0);
    while rest > 0 {
        rest /= 2;
        bits += 1;
    }
    bits
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_finite_half_returns_from_its_number() {
        for half in (0..=u16::MAX)
            .map(Half::from_bits)
            .filter(|h| h.is_finite())
        {
            let number = Number::from_half(half);
            assert_eq!(number.half_bits(), half.bits());
            assert_eq!(number.to_half(), (number, false));
            assert_eq!(number.single_bits(), half.to_f32().to_bits());
        }
    }

    #[test]
    fn roundings_to_f32_are_the_hosts() {
        // Sums of halves far apart, which the host adds with one rounding too.
        let values = [
            0x0001, 0x03ff, 0x3c01, 0x5555, 0x7bff, 0xbc01, 0x8001, 0xfbff,
        ];
        let numbers = values.map(Half::from_bits);
        for (a, b, c) in numbers
            .into_iter()
            .flat_map(|a| numbers.map(|b| (a, b)))
            .flat_map(|(a, b)| numbers.map(|c| (a, b, c)))
        {
            let host = a.to_f32() * b.to_f32() + c.to_f32();
            let product = Number::from_half(a).times(Number::from_half(b));
            let sum = product.plus(Number::from_half(c)).to_single();
            assert_eq!(sum.single_bits(), host.to_bits(), "{a:?} {b:?} {c:?}");
        }
    }
}
