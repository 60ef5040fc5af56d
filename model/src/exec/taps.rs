//! Taps: every intermediate value of one texel, kept.

use super::position::Corners;
use super::probe::Probe;
use crate::request::Request;
use crate::trace::Fetch;

/// What one grid contributed.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct GridTap {
    /// The corners, as computed.
    pub corners: Corners,
    /// Where memory keeps them, if they were fetched.
    pub fetch: Option<Fetch>,
    /// The codes of the four corners, one corner after the other.
    pub codes: Vec<u8>,
}

/// What one layer made.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LayerTap {
    /// The layer.
    pub layer: u16,
    /// Bias plus products: accumulators, or the bits of an fp16 layer's f32 sums.
    pub accumulators: Vec<i32>,
    /// The same after the activation, before the skip path; equal where the activation is the
    /// identity.
    pub activated: Vec<i32>,
    /// What was written to the register, integers or the bits of halves; empty in the last layer.
    pub outputs: Vec<i16>,
}

/// Every intermediate value of one texel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Taps {
    /// The texel.
    pub request: Request,
    /// Per grid.
    pub grids: [GridTap; 2],
    /// The inputs of the synthesizer, all lanes.
    pub inputs: Vec<i16>,
    /// Per `dense` and `dense.half` of the program, in its order.
    pub layers: Vec<LayerTap>,
    /// The channel codes.
    pub codes: Vec<i32>,
}

impl Taps {
    /// Empty taps for a texel; a [`Probe`] that fills them.
    #[must_use]
    pub fn new(request: Request) -> Taps {
        Taps {
            request,
            grids: Default::default(),
            inputs: Vec::new(),
            layers: Vec::new(),
            codes: Vec::new(),
        }
    }
}

impl Probe for Taps {
    fn position(&mut self, grid: usize, corners: &Corners) {
        self.grids[grid].corners = *corners;
    }

    fn fetch(&mut self, fetch: &Fetch) {
        self.grids[usize::from(fetch.grid)].fetch = Some(*fetch);
    }

    fn codes(&mut self, grid: usize, codes: &[u8]) {
        self.grids[grid].codes = codes.to_vec();
    }

    fn embedded(&mut self, _stage: &'static str, lane: u16, inputs: &[i16]) {
        let end = usize::from(lane) + inputs.len();
        if self.inputs.len() < end {
            self.inputs.resize(end, 0);
        }
        self.inputs[usize::from(lane)..end].copy_from_slice(inputs);
    }

    fn accumulators(&mut self, layer: u16, accumulators: &[i32]) {
        self.layers.push(LayerTap {
            layer,
            accumulators: accumulators.to_vec(),
            activated: accumulators.to_vec(),
            outputs: Vec::new(),
        });
    }

    fn activated(&mut self, accumulators: &[i32]) {
        if let Some(tap) = self.layers.last_mut() {
            tap.activated = accumulators.to_vec();
        }
    }

    fn sums(&mut self, layer: u16, sums: &[f32]) {
        self.accumulators(layer, &bits(sums));
    }

    fn activated_sums(&mut self, sums: &[f32]) {
        self.activated(&bits(sums));
    }

    fn outputs(&mut self, _layer: u16, values: &[i16]) {
        if let Some(tap) = self.layers.last_mut() {
            tap.outputs = values.to_vec();
        }
    }

    fn emitted(&mut self, codes: &[i32]) {
        self.codes = codes.to_vec();
    }
}

fn bits(sums: &[f32]) -> Vec<i32> {
    sums.iter().map(|sum| sum.to_bits() as i32).collect()
}
