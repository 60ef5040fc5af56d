//! Epilogue: what follows the product of a layer, element by element, with its derivative.

pub(crate) mod half;
pub(crate) mod integer;
pub(crate) mod real;

use crate::kernel::{Vectorised, vectorised};

/// What happens to one sum of column `o`: its output and its slope.
pub(crate) trait Element {
    /// Whether a sum started with its bias; otherwise the bias is added first.
    const STARTS_WITH_BIAS: bool = false;

    fn of(&self, value: f32, o: usize) -> (f32, f32);
}

struct Each<'a, E> {
    element: E,
    bias: &'a [f32],
    out: &'a mut [f32],
    slope: &'a mut [f32],
}

pub(crate) fn each<E: Element>(element: E, bias: &[f32], out: &mut [f32], slope: &mut [f32]) {
    vectorised(Each {
        element,
        bias,
        out,
        slope,
    });
}

impl<E: Element> Vectorised for Each<'_, E> {
    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let columns = self.bias.len();
        for (out, slope) in self
            .out
            .chunks_exact_mut(columns)
            .zip(self.slope.chunks_exact_mut(columns))
        {
            for o in 0..columns {
                let sum = if E::STARTS_WITH_BIAS {
                    out[o]
                } else {
                    out[o] + self.bias[o]
                };
                let (value, derivative) = self.element.of(sum, o);
                out[o] = value;
                slope[o] = derivative;
            }
        }
    }
}
