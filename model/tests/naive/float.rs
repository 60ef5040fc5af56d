//! Floats made of integers: exact sums and products, and the roundings by their definitions.

use ntmu_isa::round::Rounding;

/// ±magnitude · 2^exponent, exactly. An f32 has at most 24 bits between its first and last one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Float {
    is_negative: bool,
    magnitude: u128,
    exponent: i32,
}

/// The magnitude of a finite half in units of 2^−24.
fn half_magnitude(bits: u16) -> u128 {
    let (exponent, fraction) = (bits >> 10 & 0x1f, u128::from(bits & 0x3ff));
    match exponent {
        0 => fraction,
        normal => (1024 + fraction) << (normal - 1),
    }
}

const LARGEST_HALF: u16 = 0x7bff;

impl Float {
    pub(crate) fn of_half(bits: u16) -> Float {
        Float {
            is_negative: bits >> 15 == 1,
            magnitude: half_magnitude(bits),
            exponent: -24,
        }
    }

    pub(crate) fn of_integer(value: i64, fraction_bits: i32) -> Float {
        Float {
            is_negative: value < 0,
            magnitude: u128::from(value.unsigned_abs()),
            exponent: -fraction_bits,
        }
    }

    /// −1, 0 or 1.
    pub(crate) fn sign(self) -> i32 {
        match (self.magnitude, self.is_negative) {
            (0, _) => 0,
            (_, true) => -1,
            (_, false) => 1,
        }
    }

    pub(crate) fn times_power(self, exponent: i32) -> Float {
        Float {
            exponent: self.exponent + exponent,
            ..self
        }
    }

    /// The exact product. Both have at most 64 bits.
    pub(crate) fn times(self, other: Float) -> Float {
        Float {
            is_negative: self.is_negative != other.is_negative,
            magnitude: self.magnitude * other.magnitude,
            exponent: self.exponent + other.exponent,
        }
    }

    /// The exact sum, with the sign that IEEE 754 gives to a zero.
    pub(crate) fn plus(self, other: Float) -> Float {
        if self.magnitude == 0 && other.magnitude == 0 {
            return Float {
                is_negative: self.is_negative && other.is_negative,
                ..self
            };
        }
        if self.magnitude == 0 || other.magnitude == 0 {
            return if self.magnitude == 0 { other } else { self };
        }
        let exponent = self.exponent.min(other.exponent);
        let signed = |x: Float| {
            let shift = (x.exponent - exponent) as u32;
            assert!(x.magnitude.leading_zeros() > shift + 1, "too wide to add");
            let magnitude = (x.magnitude << shift) as i128;
            if x.is_negative { -magnitude } else { magnitude }
        };
        let sum = signed(self) + signed(other);
        Float {
            is_negative: sum < 0,
            magnitude: sum.unsigned_abs(),
            exponent,
        }
    }

    /// The nearest f32, ties to even. Of a number that is neither too large nor subnormal.
    pub(crate) fn rounded(self) -> Float {
        let width = 128 - self.magnitude.leading_zeros();
        if width <= 24 {
            return self;
        }
        let unit = 1_u128 << (width - 24);
        let (below, rest) = (self.magnitude / unit, self.magnitude % unit);
        let up = 2 * rest > unit || (2 * rest == unit && below % 2 == 1);
        Float {
            magnitude: below + u128::from(up),
            exponent: self.exponent + (width - 24) as i32,
            ..self
        }
    }

    /// The bits of an f32.
    pub(crate) fn bits(self) -> u32 {
        let sign = u32::from(self.is_negative) << 31;
        if self.magnitude == 0 {
            return sign;
        }
        let top = 127 - self.magnitude.leading_zeros() as i32;
        let power = self.exponent + top;
        assert!((-126..=127).contains(&power), "no normal f32");
        let (mut significand, mut dropped) = (self.magnitude, 0);
        if top > 23 {
            dropped = significand & ((1 << (top - 23)) - 1);
            significand >>= top - 23;
        } else {
            significand <<= 23 - top;
        }
        assert_eq!(dropped, 0, "no f32");
        sign | ((power + 127) as u32) << 23 | (significand as u32 & 0x007f_ffff)
    }

    /// The bits of the nearest half, found among all of them; saturated.
    pub(crate) fn nearest_half(self) -> u16 {
        let sign = u16::from(self.is_negative) << 15;
        // Both sides in units of 2^−24 or finer.
        let fine = (-24 - self.exponent).max(0) as u32;
        let coarse = (self.exponent + 24).max(0) as u32;
        if 128 - self.magnitude.leading_zeros() + coarse > 100 {
            return sign | LARGEST_HALF;
        }
        let number = self.magnitude << coarse;
        let at = |bits: u16| half_magnitude(bits) << fine;
        let above: Vec<u16> = (0..=LARGEST_HALF).collect();
        let count = above.partition_point(|&bits| at(bits) <= number) as u16;
        let below = count - 1;
        if below == LARGEST_HALF {
            return sign | LARGEST_HALF;
        }
        let (down, up) = (number - at(below), at(below + 1) - number);
        let nearest = match down.cmp(&up) {
            std::cmp::Ordering::Less => below,
            std::cmp::Ordering::Greater => below + 1,
            std::cmp::Ordering::Equal => below + below % 2,
        };
        sign | nearest
    }

    /// The number · factor to an integer, within ±2^31.
    pub(crate) fn integer(self, factor: i32, rounding: Rounding) -> i64 {
        let limit = 1_i128 << 31;
        let magnitude = self.magnitude * factor as u128;
        let signed = |magnitude: u128| {
            let value = magnitude as i128;
            if self.is_negative { -value } else { value }
        };
        if magnitude == 0 {
            return 0;
        }
        if self.exponent >= 0 {
            let is_large = self.exponent > 40 || magnitude >> 60 > 0;
            let value = if is_large {
                signed(1 << 40)
            } else {
                signed(magnitude << self.exponent)
            };
            return value.clamp(-limit, limit) as i64;
        }
        // Below 2^−60 it is only a little more or less than nothing.
        let shift = (-self.exponent) as u32;
        let (value, shift) = if shift > 120 {
            assert!(magnitude >> 60 == 0);
            (signed(1), 62)
        } else {
            (signed(magnitude), shift)
        };
        let unit = 1_i128 << shift;
        let (below, rest) = (value.div_euclid(unit), 2 * value.rem_euclid(unit));
        let up = match rounding {
            Rounding::Floor => false,
            Rounding::HalfUp => rest >= unit,
            Rounding::HalfEven => rest > unit || (rest == unit && below % 2 != 0),
            Rounding::HalfAway => rest > unit || (rest == unit && value > 0),
        };
        (below + i128::from(up)).clamp(-limit, limit) as i64
    }
}
