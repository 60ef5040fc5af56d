//! Half: what happens to the `f32` sums of an fp16 layer. fp16 values are held as `f32`.

use ntmu_isa::half::activation::SIXTH;

/// The activation of an fp16 layer, see `ntmu_isa::half::activation`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum HalfStep {
    /// Nothing.
    Identity,
    /// x where x > 0, else +0.
    Relu,
    /// x where x ≥ 0, else x · slope; the slope is a power of two, so the product is exact.
    Leaky {
        /// 2^−n.
        slope: f32,
    },
    /// A hard GELU, of x limited to `limit`: 3 or infinity.
    Gate {
        /// The largest x.
        limit: f32,
    },
}

impl HalfStep {
    #[inline(always)]
    pub(super) fn relu(x: f32) -> f32 {
        if x > 0.0 { x } else { 0.0 }
    }

    #[inline(always)]
    pub(super) fn leaky(x: f32, slope: f32) -> f32 {
        if x < 0.0 { x * slope } else { x }
    }

    #[inline(always)]
    pub(super) fn gate(x: f32, limit: f32) -> f32 {
        let x = if x > limit { limit } else { x };
        let six_gates = 2.0 * x + 3.0;
        let six_gates = if six_gates < 0.0 { 0.0 } else { six_gates };
        let six_gates = if six_gates > 6.0 { 6.0 } else { six_gates };
        (x * six_gates) * SIXTH
    }
}

/// From an fp16 layer's sum to an integer: `sum · factor`, to the nearest, ties to even, plus
/// `offset`, within `low..=high`, which lie within ±2^17.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfToInteger {
    /// A power of two from 2^−16 to 2^24, or an integer of 16 bits: a product with an `f32` is exact
    /// in `f64`.
    pub factor: f64,
    /// Added after the rounding, within ±2^15.
    pub offset: i32,
    /// The smallest result.
    pub low: i32,
    /// The largest result.
    pub high: i32,
}

impl HalfToInteger {
    /// Beyond 2^20 the result is at an end of its range in any case, so limiting the product there
    /// changes nothing and keeps it within 32 bits.
    #[inline(always)]
    pub(super) fn apply(self, sum: f32) -> i32 {
        const LIMIT: f64 = 1_048_576.0;
        let product = f64::from(sum) * self.factor;
        let product = if product < LIMIT { product } else { LIMIT };
        let product = if product > -LIMIT { product } else { -LIMIT };
        // With 1.5 * 2^52 added, the last bit of the sum counts ones: the addition rounds to the
        // nearest integer, ties to even because the offset is even, and the low bits are the result.
        const OFFSET: f64 = 6_755_399_441_055_744.0;
        let rounded = (product + OFFSET).to_bits() as i32;
        (rounded + self.offset).clamp(self.low, self.high)
    }
}

/// The largest finite fp16.
pub const LARGEST_HALF: f32 = 65_504.0;

/// The nearest fp16 to a finite `f32`, ties to even, saturated at ±65504; the sign of zero stays.
///
/// In the binade \[2^e, 2^(e+1)) an fp16 has steps of 2^(e−10), and so has an `f32` in the binade of
/// 2^(e+13). Adding that power to |x| therefore makes the addition itself round to fp16's step, to
/// even because the power is an even multiple of it, and taking it away again is exact. Below
/// 2^−14, where fp16 is subnormal, the step stays that of 2^−14.
#[inline(always)]
#[must_use]
pub fn round_to_half(x: f32) -> f32 {
    const EXPONENT: u32 = 0x7f80_0000;
    const SIGN: u32 = 0x8000_0000;
    // 2^-14 as bits, and thirteen binades.
    const SMALLEST_NORMAL: u32 = (127 - 14) << 23;
    const THIRTEEN_BINADES: u32 = 13 << 23;
    let bits = x.to_bits();
    let magnitude = f32::from_bits(bits & !SIGN);
    // Above 2^17 the result is 65504 whatever the step; the limit keeps the power finite.
    let magnitude = if magnitude < 131_072.0 {
        magnitude
    } else {
        131_072.0
    };
    let binade = magnitude.to_bits() & EXPONENT;
    let binade = if binade > SMALLEST_NORMAL {
        binade
    } else {
        SMALLEST_NORMAL
    };
    let power = f32::from_bits(binade + THIRTEEN_BINADES);
    let rounded = (magnitude + power) - power;
    let rounded = if rounded < LARGEST_HALF {
        rounded
    } else {
        LARGEST_HALF
    };
    f32::from_bits(rounded.to_bits() | (bits & SIGN))
}
