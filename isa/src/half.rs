//! Half: IEEE 754 binary16 numbers, and the sums that an fp16 layer makes of them.
//!
//! The only module of this crate that computes with floats, and then only with `f32` products that
//! are exact and `f32` additions, which Rust defines as IEEE 754 `roundTiesToEven`. The host's own
//! fp16 is never used.
//!
//! A conversion to fp16 *saturates* at ±65504 instead of overflowing, so from finite numbers come
//! finite numbers only: no infinity and no NaN can arise in a validated asset. A layer has at most
//! 1024 inputs, so an `f32` sum stays below 2^43.

use crate::round::Rounding;

/// A binary16 number, by its bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Half(u16);

/// 65504, the largest finite number.
const LARGEST: u16 = 0x7bff;
const SIGN: u16 = 0x8000;

impl Half {
    /// +0.
    pub const ZERO: Half = Half(0);
    /// 1.
    pub const ONE: Half = Half(0x3c00);
    /// The largest finite number, 65504.
    pub const MAX: Half = Half(LARGEST);

    /// The number with these bits.
    #[must_use]
    pub const fn from_bits(bits: u16) -> Half {
        Half(bits)
    }

    /// Its bits.
    #[must_use]
    pub const fn bits(self) -> u16 {
        self.0
    }

    /// Neither an infinity nor a NaN.
    #[must_use]
    pub const fn is_finite(self) -> bool {
        self.0 & 0x7c00 != 0x7c00
    }

    const fn is_negative(self) -> bool {
        self.0 & SIGN != 0
    }

    /// The number as a multiple of 2^−24, exactly; a finite one, below 2^40 in magnitude.
    pub(crate) const fn multiple(self) -> i64 {
        let exponent = (self.0 >> 10 & 0x1f) as u32;
        let fraction = (self.0 & 0x3ff) as i64;
        let magnitude = if exponent == 0 {
            fraction
        } else {
            (fraction | 0x400) << (exponent - 1)
        };
        if self.is_negative() {
            -magnitude
        } else {
            magnitude
        }
    }

    /// The same number as `f32`, exactly. Of a finite number.
    #[must_use]
    pub const fn to_f32(self) -> f32 {
        let sign = ((self.0 & SIGN) as u32) << 16;
        let magnitude = self.multiple().unsigned_abs();
        if magnitude == 0 {
            return f32::from_bits(sign);
        }
        let top = 63 - magnitude.leading_zeros();
        // 2^−24 times 2^top; the fraction has at most ten bits below the leading one.
        let exponent = (top + 127 - 24) << 23;
        let fraction = ((magnitude << (40 - top) >> 17) as u32) & 0x007f_ffff;
        f32::from_bits(sign | exponent | fraction)
    }

    /// The nearest number to `f32`, ties to even, saturated at ±65504; a NaN gives +0.
    #[must_use]
    pub const fn round(number: f32) -> Half {
        let bits = number.to_bits();
        let exponent = (bits >> 23 & 0xff) as i32;
        let fraction = (bits & 0x007f_ffff) as i64;
        let sign = (bits >> 16) as u16 & SIGN;
        if exponent == 0xff {
            return if fraction == 0 {
                Half(sign | LARGEST)
            } else {
                Half::ZERO
            };
        }
        let significand = if exponent == 0 {
            fraction
        } else {
            fraction | 0x0080_0000
        };
        let log2 = if exponent == 0 { -149 } else { exponent - 150 };
        Half::nearest(sign, significand as u128, log2)
    }

    /// The nearest number to `value / 2^fraction_bits`, ties to even, saturated at ±65504.
    ///
    /// `|value|` is below 2^126.
    #[must_use]
    pub const fn from_fixed(value: i128, fraction_bits: u32) -> Half {
        let sign = if value < 0 { SIGN } else { 0 };
        Half::nearest(sign, value.unsigned_abs(), -(fraction_bits as i32))
    }

    /// The nearest number to `magnitude · 2^log2`, with this sign.
    const fn nearest(sign: u16, magnitude: u128, log2: i32) -> Half {
        if magnitude == 0 {
            return Half(sign);
        }
        let top = 127 - magnitude.leading_zeros() as i32 + log2;
        if top > 15 {
            return Half(sign | LARGEST);
        }
        // The weight of the last of eleven bits; subnormals end at 2^−24.
        let last = if top < -14 { -24 } else { top - 10 };
        let drop = last - log2;
        let kept = if drop <= 0 {
            // At most eleven bits are left, so nothing is lost to the left.
            magnitude << -drop
        } else if drop > 127 {
            0
        } else {
            let kept = magnitude >> drop;
            let rest = magnitude - (kept << drop);
            let half = 1_u128 << (drop - 1);
            let up = rest > half || (rest == half && kept & 1 == 1);
            kept + up as u128
        };
        // A carry out of the fraction is a carry into the exponent, as the encoding wants it.
        let encoded = if top < -14 {
            kept
        } else {
            kept + (((top + 14) as u128) << 10)
        };
        if encoded > LARGEST as u128 {
            Half(sign | LARGEST)
        } else {
            Half(sign | encoded as u16)
        }
    }

    /// `self · factor + addend` with one rounding, as IEEE 754 `fusedMultiplyAdd`, saturated. Of
    /// finite numbers.
    #[must_use]
    pub const fn fused(self, factor: Half, addend: Half) -> Half {
        let product = self.multiple() as i128 * factor.multiple() as i128;
        let sum = product + ((addend.multiple() as i128) << 24);
        if sum == 0 {
            // Zeros of one sign keep it; all else that cancels is +0.
            let product_sign = (self.0 ^ factor.0) & SIGN;
            let is_negative = product == 0 && product_sign != 0 && addend.is_negative();
            return Half(if is_negative { SIGN } else { 0 });
        }
        Half::from_fixed(sum, 48)
    }
}

/// How an fp16 layer sums its products.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, serde::Serialize, serde::Deserialize,
)]
#[serde(rename_all = "kebab-case")]
pub enum SumOrder {
    /// In f32: the bias, then product by product, k ascending. Normative.
    Sequential,
    /// In fp16: as sequential, every step a fused multiply-add rounded to fp16.
    Fused,
    /// In f32: four products as (p0 + p1) + (p2 + p3), then added to the sum, bias first.
    Tree4,
    /// In f32: eight products as a balanced tree, then added to the sum, bias first.
    Tree8,
}

impl SumOrder {
    /// Every order, in the order of its code in a file.
    pub const ALL: [SumOrder; 4] = [
        SumOrder::Sequential,
        SumOrder::Fused,
        SumOrder::Tree4,
        SumOrder::Tree8,
    ];

    /// The name in tables and profiles.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            SumOrder::Sequential => "sequential",
            SumOrder::Fused => "fused",
            SumOrder::Tree4 => "tree4",
            SumOrder::Tree8 => "tree8",
        }
    }

    /// The code in a file.
    #[must_use]
    pub const fn code(self) -> u8 {
        self as u8
    }

    /// The order with this code, if there is one.
    #[must_use]
    pub fn from_code(code: u8) -> Option<SumOrder> {
        SumOrder::ALL.get(usize::from(code)).copied()
    }

    /// bias + Σ weight·input. Products of two halves have 22 bits and are exact in f32, so a fused
    /// and a separate addition give the same bits.
    ///
    /// A tree whose last group is short is filled with products of +0.
    #[must_use]
    pub fn dot(self, bias: Half, weights: &[Half], inputs: &[Half]) -> f32 {
        let products = weights
            .iter()
            .zip(inputs)
            .map(|(w, x)| w.to_f32() * x.to_f32());
        match self {
            SumOrder::Sequential => products.fold(bias.to_f32(), |sum, product| sum + product),
            SumOrder::Fused => weights
                .iter()
                .zip(inputs)
                .fold(bias, |sum, (&w, &x)| w.fused(x, sum))
                .to_f32(),
            SumOrder::Tree4 => grouped::<4>(bias, products),
            SumOrder::Tree8 => grouped::<8>(bias, products),
        }
    }
}

/// Groups of N products, each summed by halves, added to the bias one after the other.
fn grouped<const N: usize>(bias: Half, mut products: impl Iterator<Item = f32>) -> f32 {
    let mut sum = bias.to_f32();
    while let Some(first) = products.next() {
        let mut group = [0.0_f32; N];
        group[0] = first;
        for (slot, product) in group[1..].iter_mut().zip(&mut products) {
            *slot = product;
        }
        let mut width = N;
        while width > 1 {
            width /= 2;
            for i in 0..width {
                group[i] = group[2 * i] + group[2 * i + 1];
            }
        }
        sum += group[0];
    }
    sum
}

/// `number · factor · 2^exponent`, rounded once to an integer and saturated to ±2^31.
///
/// The product is exact: 24 bits of a finite f32 times 16 bits.
#[must_use]
pub const fn to_integer(number: f32, factor: u16, exponent: i32, rounding: Rounding) -> i64 {
    const LIMIT: i64 = 1 << 31;
    let bits = number.to_bits();
    let biased = (bits >> 23 & 0xff) as i32;
    let fraction = (bits & 0x007f_ffff) as i64;
    let (significand, log2) = if biased == 0 {
        (fraction, -149)
    } else {
        (fraction | 0x0080_0000, biased - 150)
    };
    let magnitude = significand * factor as i64;
    let value = if bits >> 31 == 1 {
        -magnitude
    } else {
        magnitude
    };
    let shift = log2 + exponent;
    if value == 0 {
        return 0;
    }
    let result = if shift >= 0 {
        // A normal number times 2^0 or more with 24 bits: anything shifted this far saturates.
        if shift > 22 {
            if value < 0 { -LIMIT } else { LIMIT }
        } else {
            value << shift
        }
    } else if shift < -62 {
        // Below 2^40 / 2^63: nearer to 0 than to ±½.
        rounding.shift(if value < 0 { -1 } else { 1 }, 2)
    } else {
        rounding.shift(value, (-shift) as u32)
    };
    if result > LIMIT {
        LIMIT
    } else if result < -LIMIT {
        -LIMIT
    } else {
        result
    }
}

/// Activations of an fp16 layer, on its f32 sums.
pub mod activation {
    /// max(x, 0); a zero of either sign gives +0.
    #[must_use]
    pub const fn relu(sum: f32) -> f32 {
        if sum > 0.0 { sum } else { 0.0 }
    }

    /// x for x ≥ 0, x / 2^shift below. Exact: a sum is a multiple of 2^−48.
    #[must_use]
    pub const fn leaky(sum: f32, shift: u8) -> f32 {
        if sum < 0.0 {
            sum * f32::from_bits((127 - shift as u32) << 23)
        } else {
            sum
        }
    }

    /// The f32 nearest to 1/6.
    pub const SIXTH: f32 = f32::from_bits(0x3e2a_aaab);

    /// Hard GELU, x · clamp(x/3 + ½, 0, 1), as four f32 operations, each rounded to nearest even:
    /// `(x · clamp(2x + 3, 0, 6)) · SIXTH`. If `is_clamped`, x is first limited to 3.
    #[must_use]
    pub const fn hard_gelu(sum: f32, is_clamped: bool) -> f32 {
        let x = if is_clamped && sum > 3.0 { 3.0 } else { sum };
        let six_gates = 2.0 * x + 3.0;
        let six_gates = if six_gates < 0.0 {
            0.0
        } else if six_gates > 6.0 {
            6.0
        } else {
            six_gates
        };
        (x * six_gates) * SIXTH
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all_finite() -> impl Iterator<Item = Half> {
        (0..=u16::MAX)
            .map(Half::from_bits)
            .filter(|h| h.is_finite())
    }

    #[test]
    fn every_finite_half_returns_from_f32() {
        assert_eq!(all_finite().count(), 2 * 0x7c00);
        for half in all_finite() {
            assert_eq!(Half::round(half.to_f32()), half, "{:04x}", half.bits());
        }
    }

    #[test]
    fn f32_values_are_those_of_the_definition() {
        for half in all_finite() {
            let bits = half.bits();
            let (exponent, fraction) = (i32::from(bits >> 10 & 0x1f), f64::from(bits & 0x3ff));
            let magnitude = if exponent == 0 {
                fraction * 2_f64.powi(-24)
            } else {
                (1.0 + fraction / 1024.0) * 2_f64.powi(exponent - 15)
            };
            let sign = if bits & SIGN == 0 { 1.0 } else { -1.0 };
            assert_eq!(
                f64::from(half.to_f32()).to_bits(),
                (sign * magnitude).to_bits()
            );
        }
    }

    #[test]
    fn between_two_neighbours_the_nearer_wins_and_a_tie_goes_to_the_even_one() {
        for bits in 0..LARGEST {
            let (low, high) = (Half(bits), Half(bits + 1));
            let middle = (low.to_f32() + high.to_f32()) / 2.0;
            let even = if bits & 1 == 0 { low } else { high };
            assert_eq!(Half::round(middle), even);
            assert_eq!(Half::round(middle.next_down()), low);
            assert_eq!(Half::round(middle.next_up()), high);
            assert_eq!(Half::round(-middle), Half(even.0 | SIGN));
        }
    }

    #[test]
    fn what_is_too_large_saturates() {
        for number in [65_504.0, 65_519.9, 65_520.0, 1e9, f32::INFINITY] {
            assert_eq!(Half::round(number), Half::MAX);
            assert_eq!(Half::round(-number), Half(LARGEST | SIGN));
        }
        assert_eq!(Half::from_fixed(1 << 100, 3), Half::MAX);
        assert_eq!(Half::round(f32::NAN), Half::ZERO);
    }

    #[test]
    fn fused_multiply_add_gives_the_known_answers() {
        let fused = |a, b, c| Half(a).fused(Half(b), Half(c)).bits();
        assert_eq!(fused(0x5d00, 0x5802, 0x0001), 0x7903);
        assert_eq!(fused(0x0fae, 0x1240, 0x9000), 0x8fff);
        assert_eq!(fused(0x8000, 0x3c00, 0x8000), 0x8000);
        assert_eq!(fused(0x8000, 0x3c00, 0x0000), 0x0000);
        assert_eq!(fused(0x3c00, 0x3c00, 0xbc00), 0x0000);
    }

    #[test]
    fn a_fused_step_with_one_or_zero_returns_every_half() {
        for half in all_finite() {
            let minus_zero = Half(SIGN);
            assert_eq!(half.fused(Half::ONE, minus_zero), half);
            let sum = Half::ZERO.fused(Half::ONE, half);
            assert_eq!(sum, if half == minus_zero { Half::ZERO } else { half });
        }
    }

    #[test]
    fn orders_differ_where_rounding_does() {
        // 2^24 + 1 + 1 + 1 + 1: one by one, each 1 is lost to a tie; four together are not.
        let h = |x: f32| Half::round(x);
        let weights = [
            h(4096.0),
            h(1.0),
            h(1.0),
            h(1.0),
            h(1.0),
            h(0.0),
            h(0.0),
            h(0.0),
        ];
        let inputs = [
            h(4096.0),
            h(1.0),
            h(1.0),
            h(1.0),
            h(1.0),
            h(0.0),
            h(0.0),
            h(0.0),
        ];
        let dot = |order: SumOrder| order.dot(Half::ZERO, &weights, &inputs);
        assert_eq!(dot(SumOrder::Sequential), 16_777_216.0);
        assert_eq!(dot(SumOrder::Tree4), 16_777_220.0);
        assert_eq!(dot(SumOrder::Tree8), 16_777_220.0);
        assert_eq!(dot(SumOrder::Fused), 65_504.0);
    }

    #[test]
    fn integers_of_every_half_are_those_of_the_definition() {
        for half in all_finite() {
            let x = f64::from(half.to_f32());
            for (factor, exponent) in [(1, 0), (255, 0), (65_535, 0), (1, 7), (1, -3)] {
                // Every product is exact in f64.
                let real = x * f64::from(factor) * 2_f64.powi(exponent);
                let limit = 2_f64.powi(31);
                let expected = |real: f64| real.clamp(-limit, limit) as i64;
                let at = |rounding| to_integer(half.to_f32(), factor, exponent, rounding);
                assert_eq!(at(Rounding::HalfEven), expected(real.round_ties_even()));
                assert_eq!(at(Rounding::Floor), expected(real.floor()));
                assert_eq!(at(Rounding::HalfUp), expected((real + 0.5).floor()));
                assert_eq!(at(Rounding::HalfAway), expected(real.round()));
            }
        }
    }

    #[test]
    fn very_small_and_very_large_floats_become_integers() {
        let at = |x: f32, rounding| to_integer(x, 255, 0, rounding);
        assert_eq!(at(f32::MIN_POSITIVE / 8.0, Rounding::HalfUp), 0);
        assert_eq!(at(-f32::MIN_POSITIVE, Rounding::Floor), -1);
        assert_eq!(at(1e30, Rounding::HalfEven), 1 << 31);
        assert_eq!(at(-1e30, Rounding::HalfEven), -(1 << 31));
    }

    #[test]
    fn the_hard_gelu_of_every_half_is_near_its_real() {
        for half in all_finite() {
            let x = f64::from(half.to_f32());
            for is_clamped in [false, true] {
                let limited = if is_clamped { x.min(3.0) } else { x };
                let real = limited * (limited / 3.0 + 0.5).clamp(0.0, 1.0);
                let found = f64::from(activation::hard_gelu(half.to_f32(), is_clamped));
                // The gate's sum is rounded by 2^−22 at most, relative to one; the two products
                // and the constant by 2^−24 of the result each.
                let bound = limited.abs() * 2_f64.powi(-23) + real.abs() * 2_f64.powi(-22);
                assert!((found - real).abs() <= bound, "{x}: {found} for {real}");
            }
        }
    }
}
