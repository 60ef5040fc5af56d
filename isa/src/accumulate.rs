//! Accumulators: the sums of an integer layer, and what happens where they are too narrow.

use crate::round::saturate;

/// What an accumulator does with a sum that it cannot hold.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, serde::Serialize, serde::Deserialize,
)]
#[serde(rename_all = "kebab-case")]
pub enum Overflow {
    /// Keeps the low bits: two's complement.
    Wrap,
    /// Stays at the nearest end of its range, after every product.
    Saturate,
}

impl Overflow {
    /// Every choice, in the order of its code in a file.
    pub const ALL: [Overflow; 2] = [Overflow::Wrap, Overflow::Saturate];

    /// The name in tables and profiles.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Overflow::Wrap => "wrap",
            Overflow::Saturate => "saturate",
        }
    }

    /// The code in a file.
    #[must_use]
    pub const fn code(self) -> u8 {
        self as u8
    }

    /// The choice with this code, if there is one.
    #[must_use]
    pub fn from_code(code: u8) -> Option<Overflow> {
        Overflow::ALL.get(usize::from(code)).copied()
    }
}

/// The accumulators of integer layers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Accumulator {
    /// Bits of a signed accumulator, 16..=32.
    pub bits: u8,
    /// What it does with a sum that it cannot hold.
    pub overflow: Overflow,
}

impl Accumulator {
    /// The smallest and the largest sum that it holds.
    #[must_use]
    pub const fn range(self) -> (i32, i32) {
        signed_range(self.bits)
    }

    /// The sum of an accumulator and a product, in its width.
    #[must_use]
    pub const fn add(self, sum: i32, product: i32) -> i32 {
        let exact = sum as i64 + product as i64;
        match self.overflow {
            Overflow::Wrap => wrap(exact, self.bits),
            Overflow::Saturate => {
                let (low, high) = self.range();
                saturate(exact, low, high)
            }
        }
    }

    /// bias + Σ weight·input: bias first, k ascending, in this width after every product.
    #[must_use]
    pub fn dot(self, bias: i32, weights: &[i8], inputs: &[i16]) -> i32 {
        weights.iter().zip(inputs).fold(bias, |sum, (&w, &x)| {
            self.add(sum, i32::from(w) * i32::from(x))
        })
    }
}

/// The smallest and the largest signed number of `bits` bits, 1..=32.
#[must_use]
pub const fn signed_range(bits: u8) -> (i32, i32) {
    let high = ((1_i64 << (bits - 1)) - 1) as i32;
    (-high - 1, high)
}

/// The signed number with the low `bits` bits of `value`, 1..=32.
#[must_use]
pub const fn wrap(value: i64, bits: u8) -> i32 {
    let unused = 64 - bits as u32;
    ((value << unused) >> unused) as i32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrapped_sum_is_congruent_and_in_range() {
        for bits in 16..=32 {
            let (low, high) = signed_range(bits);
            for value in [low, high].iter().flat_map(|&end| {
                (-3..=3_i64)
                    .flat_map(move |step| [i64::from(end) + step, i64::from(end) * 3 + step])
            }) {
                let wrapped = wrap(value, bits);
                assert!(wrapped >= low && wrapped <= high);
                assert_eq!((i64::from(wrapped) - value).rem_euclid(1 << bits), 0);
            }
        }
    }

    #[test]
    fn every_product_of_a_latent_and_a_weight_is_exact_in_sixteen_bits() {
        for bits in 16..=32 {
            for overflow in Overflow::ALL {
                let accumulator = Accumulator { bits, overflow };
                for input in -8..=8_i16 {
                    for weight in i8::MIN..=i8::MAX {
                        let exact = i32::from(input) * i32::from(weight);
                        assert_eq!(accumulator.dot(0, &[weight], &[input]), exact);
                    }
                }
            }
        }
    }

    #[test]
    fn saturation_depends_on_the_order_and_wrapping_does_not() {
        let narrow = |overflow| Accumulator { bits: 16, overflow };
        let dot = |overflow, inputs: &[i16]| narrow(overflow).dot(32_000, &[127; 3], inputs);
        assert_eq!(
            dot(Overflow::Saturate, &[100, -100, 5]),
            32_767 - 12_700 + 635
        );
        assert_eq!(dot(Overflow::Saturate, &[-100, 100, 5]), 32_635);
        assert_eq!(dot(Overflow::Wrap, &[100, -100, 5]), 32_635);
        assert_eq!(dot(Overflow::Wrap, &[-100, 100, 5]), 32_635);
    }
}
