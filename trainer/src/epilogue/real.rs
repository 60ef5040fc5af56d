//! In reals: bias and activation.

use super::Element;
use crate::kernel::Vectorised;

/// Nothing: a layer without an activation.
pub(crate) struct RealIdentity;

impl Element for RealIdentity {
    #[inline(always)]
    fn of(&self, value: f32, _: usize) -> (f32, f32) {
        (value, 1.0)
    }
}

/// Leaky ReLU with this slope; ReLU is the slope 0.
pub(crate) struct RealLeaky(pub(crate) f32);

impl Element for RealLeaky {
    #[inline(always)]
    fn of(&self, value: f32, _: usize) -> (f32, f32) {
        let slope = if value >= 0.0 { 1.0 } else { self.0 };
        (value * slope, slope)
    }
}

/// Hard GELU.
pub(crate) struct RealGelu;

impl Element for RealGelu {
    #[inline(always)]
    fn of(&self, value: f32, _: usize) -> (f32, f32) {
        let gate = (value * (1.0 / 3.0) + 0.5).clamp(0.0, 1.0);
        let inner = if gate > 0.0 && gate < 1.0 {
            value * (1.0 / 3.0)
        } else {
            0.0
        };
        (value * gate, gate + inner)
    }
}

/// Hard GELU of min(x, 3).
pub(crate) struct RealClampedGelu;

impl Element for RealClampedGelu {
    #[inline(always)]
    fn of(&self, value: f32, o: usize) -> (f32, f32) {
        let (out, slope) = RealGelu.of(value.min(3.0), o);
        (out, if value > 3.0 { 0.0 } else { slope })
    }
}

/// No activation, and the end of a skip path.
pub(crate) struct RealSkip<'a> {
    pub(crate) bias: &'a [f32],
    pub(crate) source: &'a [f32],
    pub(crate) out: &'a mut [f32],
    pub(crate) slope: &'a mut [f32],
}

impl Vectorised for RealSkip<'_> {
    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let columns = self.bias.len();
        let rows = self
            .out
            .chunks_exact_mut(columns)
            .zip(self.source.chunks_exact(columns));
        for (out, source) in rows {
            for ((out, source), bias) in out.iter_mut().zip(source).zip(self.bias) {
                *out += bias + source;
            }
        }
        self.slope.fill(1.0);
    }
}
