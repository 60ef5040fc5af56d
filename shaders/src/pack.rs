//! Pack: an asset as the buffers that `wgsl/bindings.wgsl` declares.

use crate::part::QUAD;
use crate::taps::TapLayout;
use crate::variant::{Arithmetic, Lanes};
use ntmu_isa::Asset;
use ntmu_isa::activation::Activation;
use ntmu_isa::layer::{Layer, Parameters};
use ntmu_isa::layout::Layout;
use ntmu_isa::limits::{MAX_CHANNELS, MAX_LAYERS, MAX_LEVELS};
use ntmu_isa::rescale::Multiplier;
use ntmu_isa::shape::LaneFormat;

/// Bytes of one element of the weights.
const ELEMENT: usize = 16;

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
    /// Every layer's weights, padded with zeros to whole steps and quads; then its table.
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
            packed.table(layer);
        }
        packed.header.resize(header_words(), 0);
        packed
    }

    /// `Layer`, word by word; its rows and weights come next in their buffers.
    fn layer(&self, asset: &Asset, index: usize, layer: &Layer, tap: u32) -> [u32; LAYER_WORDS] {
        let arithmetic = Arithmetic::of(layer);
        let steps = steps(layer);
        let quads = u32::from(layer.outputs).div_ceil(QUAD);
        let weight = (self.weights.len() / ELEMENT) as u32;
        let (leak_shift, gate) = match layer.activation {
            Activation::Identity | Activation::Relu | Activation::Table => (0, None),
            Activation::Leaky { shift } => (u32::from(shift), None),
            Activation::HardGelu { scale, .. } => (0, Some(scale)),
        };
        let quantize_exponent = layer.half().and_then(|half| half.quantize);
        let [gate_mantissa, gate_shift] = multiplier(gate);
        let [input_lanes, input_bits, input_zero_point] = lanes(asset.input_format(index));
        let [output_lanes, output_bits, zero_point] = lanes(layer.output_format());
        let source = asset.skip_source(index).map(|at| &asset.layers[at]);
        let [skip_lanes, _, skip_zero_point] =
            source.map_or([0; 3], |source| lanes(source.output_format()));
        let [skip_mantissa, skip_shift] = multiplier(layer.skip.map(|skip| skip.scale));
        [
            u32::from(layer.inputs),
            u32::from(layer.outputs),
            arithmetic.code(),
            steps,
            self.rows.len() as u32,
            weight,
            weight + quads * QUAD * steps,
            tap,
            input_lanes,
            input_bits,
            input_zero_point,
            u32::from(layer.activation.code()),
            leak_shift,
            gate_mantissa,
            gate_shift,
            output_lanes,
            output_bits,
            zero_point,
            quantize_exponent.map_or(0, |q| i32::from(q.exponent) as u32),
            layer.skip.map_or(0, |skip| u32::from(skip.span)),
            skip_lanes,
            skip_zero_point,
            skip_mantissa,
            skip_shift,
        ]
    }

    fn rows(&mut self, layer: &Layer) {
        match &layer.parameters {
            Parameters::Integer(integer) => {
                let rows = integer.bias.iter().zip(&integer.scales);
                self.rows.extend(rows.map(|(&bias, &scale)| {
                    let [mantissa, shift] = multiplier(Some(scale));
                    [bias as u32, mantissa, shift]
                }));
            }
            Parameters::Half(half) => self.rows.extend(half.bias.iter().map(|bias| {
                let [mantissa, shift] = multiplier(None);
                [u32::from(bias.bits()), mantissa, shift]
            })),
        }
        let [mantissa, shift] = multiplier(None);
        let padded = self.rows.len().next_multiple_of(QUAD as usize);
        self.rows.resize(padded, [0, mantissa, shift]);
    }

    fn weights(&mut self, layer: &Layer) {
        let quad = QUAD as usize;
        let steps = steps(layer) as usize;
        let rows = usize::from(layer.outputs).next_multiple_of(quad);
        let start = self.weights.len();
        self.weights.resize(start + rows * steps * ELEMENT, 0);
        for row in 0..usize::from(layer.outputs) {
            let bytes: Vec<u8> = match &layer.parameters {
                Parameters::Integer(integer) => {
                    let weights = integer.row(row, layer.inputs).iter();
                    weights.map(|&weight| weight as u8).collect()
                }
                Parameters::Half(half) => {
                    let weights = half.row(row, layer.inputs).iter();
                    weights.flat_map(|w| w.bits().to_le_bytes()).collect()
                }
            };
            for (step, chunk) in bytes.chunks(ELEMENT).enumerate() {
                let element = (row / quad * steps + step) * quad + row % quad;
                let at = start + element * ELEMENT;
                self.weights[at..at + chunk.len()].copy_from_slice(chunk);
            }
        }
    }

    fn table(&mut self, layer: &Layer) {
        let entries = layer.integer().map_or(&[][..], |integer| &integer.table);
        self.weights
            .extend(entries.iter().flat_map(|entry| entry.to_le_bytes()));
    }
}

/// Elements of a row's weights.
fn steps(layer: &Layer) -> u32 {
    u32::from(layer.inputs).div_ceil(Arithmetic::of(layer).weights_per_element())
}

/// Lanes, bits and zero point of a register; of halves the first only.
fn lanes(format: LaneFormat) -> [u32; 3] {
    let (bits, zero_point) = match format {
        LaneFormat::Integer { bits, zero_point } => (bits, zero_point),
        LaneFormat::Half => (16, 0),
    };
    [
        Lanes::of(format).code(),
        u32::from(bits),
        i32::from(zero_point) as u32,
    ]
}

/// Words of `Layer`.
const LAYER_WORDS: usize = 24;
/// Words of `Header` before its grids.
const HEAD_WORDS: usize = 12;
/// Words of `Grid` before its levels.
const GRID_HEAD_WORDS: usize = 8;
/// Words of `Grid`.
const GRID_WORDS: usize = GRID_HEAD_WORDS + 4 * MAX_LEVELS as usize;

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
        u32::from(shape.wave.code()),
        u32::from(shape.padding),
        u32::from(shape.pyramid.code()),
    ];
    for (index, grid) in shape.grids.iter().enumerate() {
        words.extend([
            u32::from(grid.channels),
            u32::from(grid.format.bits()),
            u32::from(grid.scale_log2),
            Layout::LINEAR.cell_bytes(shape, index) as u32,
            taps.grids[index].start,
            0,
            0,
            0,
        ]);
        let end = words.len() + 4 * usize::from(MAX_LEVELS);
        let mut before = 0;
        for level in 0..shape.level_count() {
            let (width, height) = shape.level_size(index, level);
            words.extend([width, height, before, 0]);
            before += width * height;
        }
        words.resize(end, 0);
    }
    words.extend(shape.outputs.iter().map(|format| u32::from(format.code())));
    words.resize(HEAD_WORDS + 2 * GRID_WORDS + usize::from(MAX_CHANNELS), 0);
    words
}

/// Bytes of a grid's packed codes, padded to a word.
pub(crate) fn grid_bytes(asset: &Asset, grid: usize) -> u64 {
    let shape = &asset.shape;
    let cells = shape.grid_latents(grid) / u64::from(shape.grids[grid].channels);
    (cells * Layout::LINEAR.cell_bytes(shape, grid)).next_multiple_of(4)
}

/// The packed codes of a grid: levels one after the other, of cells row after row, each from its least significant bit and padded
/// to a byte.
fn grid_codes(asset: &Asset, grid: usize) -> Vec<u8> {
    let shape = asset.shape.grids[grid];
    let bits = usize::from(shape.format.bits());
    let cell_bytes = Layout::LINEAR.cell_bytes(&asset.shape, grid) as usize;
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
