//! Pack: an asset as the buffers that `wgsl/bindings.wgsl` declares.

use crate::source::STEP_LANES;
use crate::spec::activation_code;
use crate::taps::TapLayout;
use ntmu_isa::Asset;
use ntmu_isa::activation::Activation;
use ntmu_isa::layer::Layer;
use ntmu_isa::layout::Layout;
use ntmu_isa::limits::{MAX_CHANNELS, MAX_LAYERS};
use ntmu_isa::rescale::Multiplier;

/// Rows that the shader computes together.
const QUAD: usize = 4;

/// Bias, mantissa and shift of one row.
pub(crate) type Row = [u32; 3];

/// The contents of every buffer of an asset.
pub(crate) struct Packed {
    /// `Header`, word by word.
    pub(crate) header: Vec<u32>,
    /// The packed codes of each grid, padded to a word.
    pub(crate) grids: [Vec<u8>; 2],
    /// Every layer's rows, each layer padded to a multiple of four.
    pub(crate) rows: Vec<Row>,
    /// Every layer's weights, padded with zeros to whole steps and quads.
    pub(crate) weights: Vec<u8>,
}

impl Packed {
    pub(crate) fn of(asset: &Asset, taps: &TapLayout) -> Packed {
        let mut packed = Packed {
            header: header(asset, taps),
            grids: [0, 1].map(|index| grid_codes(asset, index)),
            rows: Vec::new(),
            weights: Vec::new(),
        };
        for (index, layer) in asset.layers.iter().enumerate() {
            let words = packed.layer(asset, index, layer, taps.layers[index].start);
            packed.header.extend(words);
            packed.rows(layer);
            packed.weights(layer);
        }
        packed.header.resize(header_words(), 0);
        packed
    }

    /// `Layer`, word by word; its rows and weights come next in their buffers.
    fn layer(&self, asset: &Asset, index: usize, layer: &Layer, tap: u32) -> [u32; LAYER_WORDS] {
        let (leak_shift, gate) = match layer.activation {
            Activation::Identity | Activation::Relu => (0, None),
            Activation::Leaky { shift } => (u32::from(shift), None),
            Activation::HardGelu { scale } => (0, Some(scale)),
        };
        let skip = layer.skip.map(|skip| {
            let source = &asset.layers[index - usize::from(skip.span)];
            (u32::from(skip.span), skip.scale, source.zero_point)
        });
        let [gate_mantissa, gate_shift] = multiplier(gate);
        let [skip_mantissa, skip_shift] = multiplier(skip.map(|(_, scale, _)| scale));
        [
            u32::from(layer.inputs).div_ceil(STEP_LANES),
            u32::from(layer.outputs),
            self.rows.len() as u32,
            (self.weights.len() / STEP_LANES as usize) as u32,
            activation_code(&layer.activation),
            leak_shift,
            gate_mantissa,
            gate_shift,
            i32::from(layer.zero_point) as u32,
            skip.map_or(0, |(span, _, _)| span),
            skip_mantissa,
            skip_shift,
            skip.map_or(0, |(_, _, zero_point)| i32::from(zero_point)) as u32,
            tap,
            0,
            0,
        ]
    }

    fn rows(&mut self, layer: &Layer) {
        for (bias, &scale) in layer.bias.iter().zip(&layer.scales) {
            let [mantissa, shift] = multiplier(Some(scale));
            self.rows.push([*bias as u32, mantissa, shift]);
        }
        let [mantissa, shift] = multiplier(None);
        let padded = self.rows.len().next_multiple_of(QUAD);
        self.rows.resize(padded, [0, mantissa, shift]);
    }

    fn weights(&mut self, layer: &Layer) {
        let step = STEP_LANES as usize;
        let steps = usize::from(layer.inputs).div_ceil(step);
        let rows = usize::from(layer.outputs).next_multiple_of(QUAD);
        let start = self.weights.len();
        self.weights.resize(start + rows * steps * step, 0);
        for row in 0..usize::from(layer.outputs) {
            for (k, &weight) in layer.row(row).iter().enumerate() {
                let element = (row / QUAD * steps + k / step) * QUAD + row % QUAD;
                self.weights[start + element * step + k % step] = weight as u8;
            }
        }
    }
}

/// Words of `Layer`.
const LAYER_WORDS: usize = 16;
/// Words of `Header` before its grids.
const HEAD_WORDS: usize = 12;
/// Words of `Grid`.
const GRID_WORDS: usize = 8;

/// Words of `Header`.
pub(crate) const fn header_words() -> usize {
    HEAD_WORDS + 2 * GRID_WORDS + MAX_CHANNELS as usize + MAX_LAYERS as usize * LAYER_WORDS
}

/// `Header` up to its layers.
fn header(asset: &Asset, taps: &TapLayout) -> Vec<u32> {
    let shape = &asset.shape;
    let mut words = vec![
        u32::from(shape.mip_count),
        u32::from(shape.octaves),
        u32::from(shape.snap.code()),
        u32::from(shape.address_mode.code()),
        u32::from(shape.channel_count()),
        asset.layers.len() as u32,
        taps.inputs.start,
        taps.codes.start,
        taps.words,
        0,
        0,
        0,
    ];
    for (index, grid) in shape.grids.iter().enumerate() {
        let (width, height) = shape.grid_size(index);
        words.extend([
            width,
            height,
            u32::from(grid.channels),
            u32::from(grid.format.bits()),
            u32::from(grid.scale_log2),
            Layout::cell_bytes(shape, index) as u32,
            taps.grids[index].start,
            0,
        ]);
    }
    words.extend(shape.outputs.iter().map(|format| u32::from(format.code())));
    words.resize(HEAD_WORDS + 2 * GRID_WORDS + usize::from(MAX_CHANNELS), 0);
    words
}

/// Bytes of a grid's packed codes, padded to a word.
pub(crate) fn grid_bytes(asset: &Asset, grid: usize) -> u64 {
    Layout::Linear
        .grid_bytes(&asset.shape, grid)
        .next_multiple_of(4)
}

/// The packed codes of a grid: cells row after row, each from its least significant bit and padded
/// to a byte.
fn grid_codes(asset: &Asset, grid: usize) -> Vec<u8> {
    let shape = asset.shape.grids[grid];
    let bits = usize::from(shape.format.bits());
    let cell_bytes = Layout::cell_bytes(&asset.shape, grid) as usize;
    let mut bytes = Vec::with_capacity(grid_bytes(asset, grid) as usize);
    for cell in asset.grids[grid].chunks_exact(usize::from(shape.channels)) {
        let start = bytes.len();
        bytes.resize(start + cell_bytes, 0);
        for (channel, &code) in cell.iter().enumerate() {
            let (byte, bit) = (start + channel * bits / 8, channel * bits % 8);
            let field = u16::from(code) << bit;
            bytes[byte] |= field as u8;
            if bit + bits > 8 {
                bytes[byte + 1] |= (field >> 8) as u8;
            }
        }
    }
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    bytes
}

/// Mantissa and shift; for rows and paths that are not there, ones that no shift objects to.
fn multiplier(scale: Option<Multiplier>) -> [u32; 2] {
    let scale = scale.unwrap_or(Multiplier::power_of_two(0));
    [scale.mantissa() as u32, u32::from(scale.shift())]
}
