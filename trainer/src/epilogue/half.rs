//! In fp16: isa's f32 activation, skip path, and the rounding to halves, integers or codes.
//!
//! The f32 sum that arrives is isa's to the bit: it started with its bias and products of halves
//! are exact. The operations here are those of [`ntmu_isa::half`], in its order.

use super::integer::Saturation;
use super::real::{RealIdentity, RealLeaky};
use super::{Element, each};
use crate::choices::ActivationKind;
use crate::half::round_half;
use crate::kernel::{Vectorised, vectorised};
use ntmu_isa::half::activation::SIXTH;

/// What becomes of a row's real.
#[derive(Clone, Debug)]
pub(crate) enum Ending {
    /// The nearest half.
    Round,
    /// Integers for an integer layer, `factor` for the real 1.
    Quantise { factor: f64, saturation: Saturation },
    /// In the last layer: the smallest and the largest code of each channel (0 in the padding);
    /// the largest stands for the real 1.
    Codes(Vec<(f64, f64)>),
}

/// What follows the sums of a layer: its activation or the end of a skip path, and its ending.
pub(crate) fn finish_half(
    ending: &Ending,
    activation: Option<ActivationKind>,
    source: Option<&[f32]>,
    columns: usize,
    out: &mut [f32],
    slope: &mut [f32],
) {
    let layer = Layer {
        columns,
        out,
        slope,
    };
    match ending {
        Ending::Round => layer.finish(Round, activation, source),
        Ending::Quantise { factor, saturation } => {
            let end = Quantise {
                factor: *factor,
                saturation: *saturation,
            };
            layer.finish(end, activation, source);
        }
        Ending::Codes(codes) => layer.finish(Codes(&codes[..columns]), activation, source),
    }
}

struct Layer<'a> {
    columns: usize,
    out: &'a mut [f32],
    slope: &'a mut [f32],
}

impl Layer<'_> {
    fn finish<E: End>(self, end: E, activation: Option<ActivationKind>, source: Option<&[f32]>) {
        if let Some(source) = source {
            let Layer {
                columns,
                out,
                slope,
            } = self;
            vectorised(Skip {
                end,
                columns,
                source,
                out,
                slope,
            });
            return;
        }
        match activation {
            None => self.each(end, RealIdentity),
            // A slope of 0 gives −0 where isa gives +0: the same number.
            Some(ActivationKind::Relu) => self.each(end, RealLeaky(0.0)),
            Some(ActivationKind::Leaky { shift }) => {
                self.each(end, RealLeaky(1.0 / f32::from(1_u8 << shift)));
            }
            Some(ActivationKind::HardGelu) => self.each(end, HalfGelu::<false>),
            Some(ActivationKind::ClampedHardGelu) => self.each(end, HalfGelu::<true>),
        }
    }

    fn each<E: End, A: Element>(self, end: E, activation: A) {
        // The sums have their biases already; only the number of columns is read.
        let bias = vec![0.0; self.columns];
        each(Ended { activation, end }, &bias, self.out, self.slope);
    }
}

/// From the real of column `o` to what is kept, and the derivative.
trait End {
    fn of(&self, real: f32, o: usize) -> (f32, f32);
}

struct Round;

impl End for Round {
    #[inline(always)]
    fn of(&self, real: f32, _: usize) -> (f32, f32) {
        (round_half(real), 1.0)
    }
}

struct Quantise {
    factor: f64,
    saturation: Saturation,
}

impl End for Quantise {
    #[inline(always)]
    fn of(&self, real: f32, _: usize) -> (f32, f32) {
        // A power of two: the product is exact.
        let nearest = (f64::from(real) * self.factor).round_ties_even();
        let (out, inside) = self.saturation.of(nearest);
        (out, inside * self.factor as f32)
    }
}

struct Codes<'a>(&'a [(f64, f64)]);

impl End for Codes<'_> {
    #[inline(always)]
    fn of(&self, real: f32, o: usize) -> (f32, f32) {
        let (low, high) = self.0[o];
        // 24 bits times 16: exact.
        let code = (f64::from(real) * high).round_ties_even();
        (code.max(low).min(high) as f32, high as f32)
    }
}

struct Ended<A, E> {
    activation: A,
    end: E,
}

impl<A: Element, E: End> Element for Ended<A, E> {
    const STARTS_WITH_BIAS: bool = true;

    #[inline(always)]
    fn of(&self, sum: f32, o: usize) -> (f32, f32) {
        let (real, inner) = self.activation.of(sum, o);
        let (out, outer) = self.end.of(real, o);
        (out, outer * inner)
    }
}

/// isa's hard GELU in f32, `CLAMPED` of min(x, 3).
struct HalfGelu<const CLAMPED: bool>;

impl<const CLAMPED: bool> Element for HalfGelu<CLAMPED> {
    #[inline(always)]
    fn of(&self, sum: f32, _: usize) -> (f32, f32) {
        let x = if CLAMPED { sum.min(3.0) } else { sum };
        let open = 2.0 * x + 3.0;
        let gates = open.clamp(0.0, 6.0);
        let inner = if gates == open { 2.0 * x } else { 0.0 };
        let flat = CLAMPED && sum > 3.0;
        let slope = if flat { 0.0 } else { (gates + inner) * SIXTH };
        ((x * gates) * SIXTH, slope)
    }
}

/// No activation, and the end of a skip path.
struct Skip<'a, E> {
    end: E,
    columns: usize,
    source: &'a [f32],
    out: &'a mut [f32],
    slope: &'a mut [f32],
}

impl<E: End> Vectorised for Skip<'_, E> {
    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let columns = self.columns;
        let rows = self
            .out
            .chunks_exact_mut(columns)
            .zip(self.slope.chunks_exact_mut(columns));
        for ((out, slope), source) in rows.zip(self.source.chunks_exact(columns)) {
            for o in 0..columns {
                (out[o], slope[o]) = self.end.of(out[o] + source[o], o);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ntmu_isa::half::activation::{hard_gelu, leaky, relu};

    #[test]
    fn activations_are_isas_numbers() {
        let sums = (-60_000..60_000).map(|i| i as f32 * 1.7e-4);
        for sum in sums.chain([3.0, -1.5, 1.5, f32::MIN_POSITIVE, -1e30, 1e30]) {
            assert_eq!(HalfGelu::<false>.of(sum, 0).0, hard_gelu(sum, false));
            assert_eq!(HalfGelu::<true>.of(sum, 0).0, hard_gelu(sum, true));
            assert_eq!(RealLeaky(0.0).of(sum, 0).0, relu(sum));
            assert_eq!(RealLeaky(0.125).of(sum, 0).0, leaky(sum, 3));
        }
    }
}
