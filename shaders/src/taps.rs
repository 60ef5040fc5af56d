//! Taps: every intermediate value of one texel, as the shader kept it.
//!
//! The fields are those of the specification, in its order, so that the first that differs from
//! another decoder's names the stage that broke.

use crate::source::TAP_CORNER_WORDS;
use ntmu_isa::Asset;
use ntmu_isa::position::{AxisPosition, PHASE_BITS};

/// What one grid contributed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GridTap {
    /// First corner, stride and phase along x.
    pub x: AxisPosition,
    /// First corner, stride and phase along y.
    pub y: AxisPosition,
    /// The columns of the two corners along x, within the grid.
    pub columns: [u32; 2],
    /// The rows of the two corners along y, within the grid.
    pub rows: [u32; 2],
    /// The codes of the corners (0,0), (1,0), (0,1), (1,1), one corner after the other.
    pub codes: Vec<u8>,
}

/// What one layer made. Of an fp16 layer the sums are binary32 numbers by their bits, and the
/// outputs, where they are halves, binary16 numbers by theirs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LayerTap {
    /// Bias plus products, one for each row.
    pub accumulators: Vec<i32>,
    /// The sums after the activation and before the skip path: unchanged by the identity; of an
    /// integer layer the gate's products of a hard GELU, and the entries of a table.
    pub activated: Vec<i32>,
    /// The layer's output values; empty in the last layer, which makes the channel codes.
    pub outputs: Vec<i16>,
}

/// Every intermediate value of one texel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Taps {
    /// x, y, mip.
    pub request: (u32, u32, u8),
    /// Grid 0 and grid 1.
    pub grids: [GridTap; 2],
    /// The inputs of the synthesizer, all lanes.
    pub inputs: Vec<i16>,
    /// Layer by layer.
    pub layers: Vec<LayerTap>,
    /// The channel codes.
    pub codes: Vec<i32>,
}

/// A run of words in one texel's taps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Run {
    /// Words before it.
    pub(crate) start: u32,
    /// Lanes, rows or codes; where a run holds several of a kind, of each.
    pub(crate) length: u32,
}

impl Run {
    fn of(self, words: &[i32], skipped: u32) -> &[i32] {
        let start = (self.start + skipped) as usize;
        &words[start..start + self.length as usize]
    }
}

/// Where the taps of one texel lie.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct TapLayout {
    /// Per grid: [`TAP_CORNER_WORDS`], then this many codes.
    pub(crate) grids: [Run; 2],
    /// The inputs.
    pub(crate) inputs: Run,
    /// Per layer: accumulators, activated, and (but for the last) outputs, of this length each.
    pub(crate) layers: Vec<Run>,
    /// The channel codes.
    pub(crate) codes: Run,
    /// Words of one texel.
    pub(crate) words: u32,
}

impl TapLayout {
    pub(crate) fn of(asset: &Asset) -> TapLayout {
        let mut words = 0_u32;
        let mut take = |length: u32, taken: u32| {
            let start = words;
            words += taken;
            Run { start, length }
        };
        let grids = asset.shape.grids.map(|grid| {
            let codes = 4 * u32::from(grid.channels);
            take(codes, TAP_CORNER_WORDS + codes)
        });
        let lanes = asset.shape.input_count();
        let inputs = take(lanes, lanes);
        let last = asset.layers.len() - 1;
        let layers = asset
            .layers
            .iter()
            .enumerate()
            .map(|(index, layer)| {
                let kinds = if index == last { 2 } else { 3 };
                let rows = u32::from(layer.outputs);
                take(rows, kinds * rows)
            })
            .collect();
        let channels = u32::from(asset.shape.channel_count());
        let codes = take(channels, channels);
        TapLayout {
            grids,
            inputs,
            layers,
            codes,
            words,
        }
    }

    /// The taps in one texel's words.
    pub(crate) fn read(&self, request: (u32, u32, u8), words: &[i32]) -> Taps {
        let last = self.layers.len() - 1;
        let layer = |(index, run): (usize, &Run)| LayerTap {
            accumulators: run.of(words, 0).to_vec(),
            activated: run.of(words, run.length).to_vec(),
            outputs: if index == last {
                Vec::new()
            } else {
                narrow(run.of(words, 2 * run.length))
            },
        };
        Taps {
            request,
            grids: self.grids.map(|run| read_grid(run, words)),
            inputs: narrow(self.inputs.of(words, 0)),
            layers: self.layers.iter().enumerate().map(layer).collect(),
            codes: self.codes.of(words, 0).to_vec(),
        }
    }
}

fn read_grid(run: Run, words: &[i32]) -> GridTap {
    let corners = &words[run.start as usize..][..TAP_CORNER_WORDS as usize];
    let axis = |at: usize| AxisPosition {
        first: corners[at],
        stride: corners[at + 1] as u32,
        phase: corners[at + 2].clamp(0, i32::from(u16::MAX)) as u16,
        phase_bits: PHASE_BITS,
    };
    let pair = |at: usize| [corners[at] as u32, corners[at + 1] as u32];
    let codes = run.of(words, TAP_CORNER_WORDS);
    GridTap {
        x: axis(0),
        y: axis(3),
        columns: pair(6),
        rows: pair(8),
        codes: codes.iter().map(|&code| byte(code)).collect(),
    }
}

/// A word that should fit a byte. One that does not is shown as the nearest that does: cutting it
/// could make a wrong word look right.
fn byte(word: i32) -> u8 {
    word.clamp(0, i32::from(u8::MAX)) as u8
}

/// As [`byte`], for lanes.
fn narrow(words: &[i32]) -> Vec<i16> {
    let (low, high) = (i32::from(i16::MIN), i32::from(i16::MAX));
    words.iter().map(|w| (*w).clamp(low, high) as i16).collect()
}
