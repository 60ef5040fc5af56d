//! Probe: whoever watches a texel being decoded.

use super::position::Corners;
use crate::trace::Fetch;

/// Sees the intermediate values of one decode, in the order in which they arise.
///
/// Every method does nothing unless it is overridden; `()` sees nothing and costs nothing. A probe
/// cannot change a value.
pub trait Probe {
    /// A grid's corners, strides and phases.
    fn position(&mut self, _grid: usize, _corners: &Corners) {}
    /// The memory that a fetch touches.
    fn fetch(&mut self, _fetch: &Fetch) {}
    /// The codes of a grid's four corners, one corner after the other.
    fn codes(&mut self, _grid: usize, _codes: &[u8]) {}
    /// Inputs written by `stage` (`concat`, `lerp`, `wave`, `saw`, `level`, `zero`) from lane `lane`
    /// on.
    fn embedded(&mut self, _stage: &'static str, _lane: u16, _inputs: &[i16]) {}
    /// An integer layer's accumulators: bias plus products.
    fn accumulators(&mut self, _layer: u16, _accumulators: &[i32]) {}
    /// The same accumulators after the activation, where there is one.
    fn activated(&mut self, _accumulators: &[i32]) {}
    /// An fp16 layer's sums: bias plus products.
    fn sums(&mut self, _layer: u16, _sums: &[f32]) {}
    /// The same sums after the activation, where there is one, and before the skip path.
    fn activated_sums(&mut self, _sums: &[f32]) {}
    /// What a hidden layer writes to its register: integers, or the bits of halves.
    fn outputs(&mut self, _layer: u16, _values: &[i16]) {}
    /// The channel codes of one decode of a sample, on their way to the filter.
    fn collected(&mut self, _codes: &[i32]) {}
    /// The channel codes that leave the unit.
    fn emitted(&mut self, _codes: &[i32]) {}
}

impl Probe for () {}
