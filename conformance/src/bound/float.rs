//! Float: how far roundings to fp16 and f32 move a number.
//!
//! A rounding to p significant bits moves a number of magnitude in 2^e..2^(e+1) by half of its last
//! place at most, 2^(e−p). A sum whose terms are all multiples of g and which is at most 2^p·g needs
//! no rounding, if g is no finer than the format's last step: that is why the sums of an fp16 layer are often exact in f32, and it is what keeps
//! their bounds tight.

use ntmu_isa::half::SumOrder;

/// The significant bits of a format, and its smallest step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Precision {
    /// Significant bits, the leading one included.
    pub bits: i32,
    /// log2 of the distance between subnormal neighbours.
    pub last: i32,
}

/// IEEE 754 binary16.
pub const HALF: Precision = Precision {
    bits: 11,
    last: -24,
};

/// IEEE 754 binary32.
pub const SINGLE: Precision = Precision {
    bits: 24,
    last: -149,
};

/// Half the distance between neighbours at `magnitude`: what one rounding to the nearest moves at
/// most. 0 for 0, which needs no rounding.
#[must_use]
pub fn half_ulp(magnitude: f64, precision: Precision) -> f64 {
    if magnitude == 0.0 {
        return 0.0;
    }
    let step = exponent(magnitude) + 1 - precision.bits;
    2_f64.powi(step.max(precision.last) - 1)
}

/// e of a magnitude in 2^e..2^(e+1). Of normal numbers, which all of ours are.
fn exponent(magnitude: f64) -> i32 {
    (magnitude.abs().to_bits() >> 52) as i32 - 1023
}

/// The largest power of two that a real is a multiple of; infinite for 0, which is a multiple of all.
#[must_use]
pub fn grain(real: f64) -> f64 {
    if real == 0.0 {
        return f64::INFINITY;
    }
    let significand = (real.to_bits() & ((1 << 52) - 1)) | 1 << 52;
    2_f64.powi(exponent(real) - 52 + significand.trailing_zeros() as i32)
}

/// A number on the way to a sum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Partial {
    /// The smallest and the largest that the oracle's real can be.
    pub real: (f64, f64),
    /// How far the model's number may lie from the oracle's.
    pub error: f64,
    /// The variance of that distance, from the roundings of the sum alone.
    pub variance: f64,
    /// The model's number is a multiple of this.
    pub grain: f64,
    /// The largest magnitude of the model's number and of every number on the way to it.
    pub largest: f64,
}

impl Partial {
    /// An exact zero.
    pub const ZERO: Partial = Partial {
        real: (0.0, 0.0),
        error: 0.0,
        variance: 0.0,
        grain: f64::INFINITY,
        largest: 0.0,
    };

    /// A number that both sides hold exactly.
    #[must_use]
    pub fn exact(real: f64) -> Partial {
        Partial {
            real: (real, real),
            grain: grain(real),
            largest: real.abs(),
            ..Partial::ZERO
        }
    }

    /// The product with an exact number; products of halves are exact in f32.
    #[must_use]
    pub fn times(self, weight: f64) -> Partial {
        let ends = (self.real.0 * weight, self.real.1 * weight);
        Partial {
            real: (ends.0.min(ends.1), ends.0.max(ends.1)),
            error: self.error * weight.abs(),
            variance: self.variance * weight * weight,
            grain: if weight == 0.0 {
                f64::INFINITY
            } else {
                self.grain * grain(weight)
            },
            largest: self.largest * weight.abs(),
        }
    }

    /// The sum, rounded once.
    #[must_use]
    pub fn plus(self, other: Partial, precision: Precision) -> Partial {
        let real = (self.real.0 + other.real.0, self.real.1 + other.real.1);
        let error = self.error + other.error;
        let magnitude = real.0.abs().max(real.1.abs()) + error;
        let grain = self.grain.min(other.grain);
        let is_exact =
            grain >= 2_f64.powi(precision.last) && magnitude <= grain * 2_f64.powi(precision.bits);
        let rounding = if is_exact {
            0.0
        } else {
            half_ulp(magnitude, precision)
        };
        Partial {
            real,
            // Beside the model's rounding, the oracle's own: 2^−53 of its result.
            error: error
                + rounding
                + if is_exact {
                    0.0
                } else {
                    magnitude * 2_f64.powi(-52)
                },
            // A whole last place wide, uniform.
            variance: self.variance + other.variance + rounding * rounding / 3.0,
            grain,
            largest: (magnitude + rounding).max(self.largest).max(other.largest),
        }
    }

    /// The largest magnitude of the model's number.
    #[must_use]
    pub fn magnitude(&self) -> f64 {
        self.real.0.abs().max(self.real.1.abs()) + self.error
    }
}

/// bias + Σ products in an order, with every rounding on the way.
#[must_use]
pub fn dot(order: SumOrder, bias: f64, products: impl Iterator<Item = Partial>) -> Partial {
    let bias = Partial::exact(bias);
    match order {
        SumOrder::Sequential => products.fold(bias, |sum, product| sum.plus(product, SINGLE)),
        SumOrder::Fused => products.fold(bias, |sum, product| {
            // Of the product only its sum exists.
            let product = Partial {
                largest: 0.0,
                ..product
            };
            sum.plus(product, HALF)
        }),
        SumOrder::Tree4 => grouped::<4>(bias, products),
        SumOrder::Tree8 => grouped::<8>(bias, products),
    }
}

fn grouped<const N: usize>(bias: Partial, mut products: impl Iterator<Item = Partial>) -> Partial {
    let mut sum = bias;
    while let Some(first) = products.next() {
        let mut group = vec![first];
        group.extend(products.by_ref().take(N - 1));
        group.resize(N, Partial::ZERO);
        while let [one, other, ..] = group[..] {
            if group.len() == 2 {
                group = vec![one.plus(other, SINGLE)];
            } else {
                let pairs = group.chunks_exact(2);
                group = pairs.map(|pair| pair[0].plus(pair[1], SINGLE)).collect();
            }
        }
        sum = sum.plus(group[0], SINGLE);
    }
    sum
}

/// How far a hard GELU on an f32 sum moves by its own four roundings; `x` is the argument.
///
/// 2x is exact. 2x + 3 is rounded once, where it lies within 0..6 by 2^−22 at most; its product with
/// x, the constant (2^−25 of it off, relative) and the last product by 2^−24 of the result each, or
/// together by less than 2^−22.
#[must_use]
pub fn gelu_error(x: f64) -> f64 {
    let result = x * (x / 3.0 + 0.5).clamp(0.0, 1.0);
    let six_gates = 2.0 * x + 3.0;
    let moved = if !(-1.0..=7.0).contains(&six_gates) {
        // Shut or open, with or without a rounding.
        0.0
    } else {
        half_ulp(six_gates.abs().min(6.0), SINGLE)
    };
    // 2^−22 relative to the result leaves room for the products of two errors.
    (x.abs() * moved) / 6.0 + (result.abs() + x.abs() * moved) * 2_f64.powi(-22)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ntmu_isa::half::Half;

    #[test]
    fn half_an_ulp_is_half_the_way_to_the_next_half() {
        for bits in 0..Half::MAX.bits() {
            let (low, high) = (Half::from_bits(bits), Half::from_bits(bits + 1));
            let (low, high) = (f64::from(low.to_f32()), f64::from(high.to_f32()));
            let middle = (low + high) / 2.0;
            assert_eq!(half_ulp(middle, HALF), (high - low) / 2.0, "{bits:04x}");
        }
        assert_eq!(half_ulp(0.0, HALF), 0.0);
    }

    #[test]
    fn a_grain_divides_and_its_double_does_not() {
        for real in [1.0, 3.0, 0.375, -40.0, 5.0 / 4096.0, 65_504.0] {
            let grain = grain(real);
            assert_eq!((real / grain).fract(), 0.0);
            assert_ne!((real / grain / 2.0).fract(), 0.0);
        }
        assert_eq!(grain(0.0), f64::INFINITY);
    }

    #[test]
    fn a_sum_of_multiples_within_its_bits_is_exact_and_the_next_is_not() {
        let sum = |bias: f64, product: f64| {
            let products = [Partial::exact(product)].into_iter();
            dot(SumOrder::Sequential, bias, products).error
        };
        assert_eq!(sum(2048.0, 2_f64.powi(-12)), 0.0);
        assert!(sum(2048.0, 2_f64.powi(-13)) >= 2_f64.powi(-13));
        // The model's rounding and nothing beside it but the oracle's own.
        assert!(sum(2048.0, 2_f64.powi(-13)) <= 2_f64.powi(-13) * (1.0 + 2_f64.powi(-20)));
    }
}
