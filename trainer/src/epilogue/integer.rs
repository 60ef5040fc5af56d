//! In integers held in floats: bias, isa's activation, rescaling, skip path, zero point, saturation.

use super::Element;
use crate::kernel::Vectorised;
use ntmu_isa::activation::{GATE_FRACTION_BITS, GATE_RANGE};

/// The largest argument of a clamped hard GELU: 3.
const CLAMP: f64 = (3 << GATE_FRACTION_BITS) as f64;

/// A rounding to the nearest integer, ties up: isa's `HalfUp` and `Requantizer::Single`.
#[inline(always)]
fn nearest(value: f64) -> f64 {
    (value + 0.5).floor()
}

/// The end of every hidden layer: zero point, saturation, and the zero point away again.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Saturation {
    pub(crate) zero: f64,
    /// The smallest and the largest value, zero point included.
    pub(crate) range: (f64, f64),
}

impl Saturation {
    /// The value without its zero point, and 1 where nothing was cut, 0 elsewhere.
    #[inline(always)]
    pub(crate) fn of(self, value: f64) -> (f32, f32) {
        let (low, high) = self.range;
        let shifted = value + self.zero;
        let kept = shifted.max(low).min(high);
        (
            (kept - self.zero) as f32,
            if kept == shifted { 1.0 } else { 0.0 },
        )
    }
}

/// Identity (leak 1), ReLU (leak 0) or leaky ReLU, rescaled.
pub(crate) struct IntegerLeaky<'a> {
    pub(crate) scales: &'a [f64],
    pub(crate) saturation: Saturation,
    pub(crate) leak: f64,
}

impl Element for IntegerLeaky<'_> {
    #[inline(always)]
    fn of(&self, value: f32, o: usize) -> (f32, f32) {
        let value = f64::from(value);
        // The rounding of a leak of 1 or 0 changes nothing.
        let (value, leak) = if value >= 0.0 {
            (value, 1.0)
        } else {
            (nearest(value * self.leak), self.leak)
        };
        let (out, inside) = self.saturation.of(nearest(value * self.scales[o]));
        (out, inside * (leak * self.scales[o]) as f32)
    }
}

/// Hard GELU, `CLAMPED` of min(x, 3).
pub(crate) struct IntegerGelu<'a, const CLAMPED: bool> {
    pub(crate) scales: &'a [f64],
    pub(crate) saturation: Saturation,
    pub(crate) gate: f64,
}

impl<const CLAMPED: bool> Element for IntegerGelu<'_, CLAMPED> {
    #[inline(always)]
    fn of(&self, value: f32, o: usize) -> (f32, f32) {
        let one = f64::from(6 << GATE_FRACTION_BITS);
        let (low, high) = (f64::from(GATE_RANGE.0), f64::from(GATE_RANGE.1));
        let high = if CLAMPED { CLAMP } else { high };
        let rescaled = nearest(f64::from(value) * self.scales[o]);
        let argument = rescaled.max(low).min(high);
        let open = 2.0 * argument + one / 2.0;
        let gates = open.max(0.0).min(one);
        let inner = if gates == open { 2.0 * argument } else { 0.0 };
        let (out, inside) = self.saturation.of(nearest(argument * gates * self.gate));
        let slope = inside * ((gates + inner) * self.gate * self.scales[o]) as f32;
        let flat = CLAMPED && rescaled > CLAMP;
        (out, if flat { 0.0 } else { slope })
    }
}

/// The last layer: codes.
pub(crate) struct IntegerCodes<'a> {
    pub(crate) scales: &'a [f64],
    pub(crate) codes: &'a [(f64, f64)],
}

impl Element for IntegerCodes<'_> {
    #[inline(always)]
    fn of(&self, value: f32, o: usize) -> (f32, f32) {
        let (low, high) = self.codes[o];
        let code = nearest(f64::from(value) * self.scales[o])
            .max(low)
            .min(high);
        (code as f32, self.scales[o] as f32)
    }
}

/// No activation, and the end of a skip path.
pub(crate) struct IntegerSkip<'a> {
    pub(crate) bias: &'a [f32],
    pub(crate) scales: &'a [f64],
    pub(crate) skip: f64,
    pub(crate) saturation: Saturation,
    pub(crate) source: &'a [f32],
    pub(crate) out: &'a mut [f32],
    pub(crate) slope: &'a mut [f32],
}

impl Vectorised for IntegerSkip<'_> {
    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let columns = self.bias.len();
        let scales = &self.scales[..columns];
        let rows = self
            .out
            .chunks_exact_mut(columns)
            .zip(self.slope.chunks_exact_mut(columns));
        for ((out, slope), source) in rows.zip(self.source.chunks_exact(columns)) {
            for o in 0..columns {
                let main = nearest(f64::from(out[o] + self.bias[o]) * scales[o]);
                let (value, inside) = self
                    .saturation
                    .of(main + nearest(f64::from(source[o]) * self.skip));
                out[o] = value;
                slope[o] = inside;
            }
        }
    }
}
