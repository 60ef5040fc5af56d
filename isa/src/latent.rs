//! Latents: what a stored code of a grid stands for.

/// The width of a latent: B bits, 1 ≤ B ≤ 8.
///
/// Codes are 0..2^B, the zero point is z = 2^(B−1) − 1, `value = code − z`, and the real is
/// `value / 2^B`: the range [−(2^B−1)/2^(B+1), 1/2] of the CNTC paper (section 4.2) with zero
/// representable. For B = 4 the reals are −7..=8 sixteenths.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct LatentFormat {
    bits: u8,
}

impl LatentFormat {
    /// The format with this many bits, if it is 1..=8.
    #[must_use]
    pub const fn new(bits: u8) -> Option<LatentFormat> {
        if bits >= 1 && bits <= 8 {
            Some(LatentFormat { bits })
        } else {
            None
        }
    }

    /// B.
    #[must_use]
    pub const fn bits(self) -> u8 {
        self.bits
    }

    /// The code whose value is zero.
    #[must_use]
    pub const fn zero_point(self) -> u8 {
        ((1_u16 << (self.bits - 1)) - 1) as u8
    }

    /// The largest code, 2^B − 1.
    #[must_use]
    pub const fn max_code(self) -> u8 {
        ((1_u16 << self.bits) - 1) as u8
    }

    /// The smallest value, 1 − 2^(B−1).
    #[must_use]
    pub const fn min_value(self) -> i32 {
        -(self.zero_point() as i32)
    }

    /// The largest value, 2^(B−1).
    #[must_use]
    pub const fn max_value(self) -> i32 {
        self.max_code() as i32 - self.zero_point() as i32
    }

    /// The value of a code. Total: a code above [`LatentFormat::max_code`] cannot come out of a
    /// validated grid.
    #[must_use]
    pub const fn value(self, code: u8) -> i32 {
        code as i32 - self.zero_point() as i32
    }

    /// The code of a value, saturated to the format.
    #[must_use]
    pub const fn code(self, value: i32) -> u8 {
        let code = value + self.zero_point() as i32;
        if code < 0 {
            0
        } else if code > self.max_code() as i32 {
            self.max_code()
        } else {
            code as u8
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_code_of_every_width_returns() {
        for bits in 1..=8 {
            let format = LatentFormat::new(bits).unwrap();
            for code in 0..=format.max_code() {
                assert_eq!(format.code(format.value(code)), code);
            }
            assert_eq!(format.value(format.zero_point()), 0);
            // The top of the range is one half: 2^(B-1) / 2^B.
            assert_eq!(format.max_value() * 2, 1 << bits);
        }
        assert_eq!(LatentFormat::new(0), None);
        assert_eq!(LatentFormat::new(9), None);
    }

    #[test]
    fn four_bits_are_minus_seven_to_eight() {
        let four = LatentFormat::new(4).unwrap();
        assert_eq!((four.min_value(), four.max_value()), (-7, 8));
        assert_eq!((four.code(-100), four.code(100)), (0, 15));
    }
}
