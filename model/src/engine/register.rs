//! Register: the lanes that one layer of a tile writes and others read.

use super::BYTE_BITS;
use super::kernel::{Halves, Integers, Kernels, Pair, Quad, Sums};
use ntmu_isa::Asset;
use ntmu_isa::layer::Parameters;
use ntmu_isa::shape::LaneFormat;

/// Vector registers. A layer reads one and writes the next; a skip path spans at most three layers,
/// so four are never in each other's way.
pub(super) const REGISTERS: usize = 4;

/// How the lanes of a register are held.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Held {
    /// Integers of up to 8 bits, as stored bytes.
    Bytes,
    /// Integers of up to 16 bits.
    Words,
    /// fp16 values as `f32`.
    Halves,
}

impl Held {
    /// How lanes of a format are held.
    pub(super) fn of(format: LaneFormat) -> Held {
        match format {
            LaneFormat::Integer { bits, .. } if bits <= BYTE_BITS => Held::Bytes,
            LaneFormat::Integer { .. } => Held::Words,
            LaneFormat::Half => Held::Halves,
        }
    }
}

/// The most lanes that an asset holds in each way, and the most rows of a layer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Widths {
    bytes: usize,
    words: usize,
    halves: usize,
    /// Of the inputs of the synthesizer.
    input_bytes: usize,
    input_words: usize,
    pub(super) rows: usize,
}

impl Widths {
    pub(super) fn of(asset: &Asset) -> Widths {
        let mut widths = Widths::default();
        let inputs = asset.shape.input_count() as usize;
        match Held::of(asset.shape.input_format()) {
            Held::Bytes | Held::Halves => widths.input_bytes = inputs,
            Held::Words => widths.input_words = inputs,
        }
        for (index, layer) in asset.layers.iter().enumerate() {
            let lanes = usize::from(layer.inputs);
            let held = match Held::of(asset.input_format(index)) {
                Held::Bytes => &mut widths.bytes,
                Held::Words => &mut widths.words,
                Held::Halves => &mut widths.halves,
            };
            *held = lanes.max(*held);
            // An fp16 layer turns the integers that it reads into halves.
            if let Parameters::Half(_) = layer.parameters {
                widths.halves = lanes.max(widths.halves);
            }
            widths.rows = usize::from(layer.outputs).max(widths.rows);
        }
        widths
    }

    /// The most lanes of bytes or rows.
    pub(super) fn lanes(self) -> usize {
        self.bytes.max(self.rows)
    }

    /// The most integers, and the most halves, that one layer reads.
    pub(super) fn scratch_lanes(self) -> (usize, usize) {
        (self.bytes.max(self.words), self.halves)
    }
}

/// One register of a tile; of the three forms one is in use.
#[derive(Clone, Debug, Default)]
pub(super) struct Register {
    pub(super) quads: Vec<Quad>,
    pub(super) pairs: Vec<Pair>,
    pub(super) halves: Vec<Halves>,
}

impl Register {
    pub(super) fn new(widths: Widths) -> Register {
        Register {
            quads: vec![Quad::ZERO; widths.bytes.div_ceil(4)],
            pairs: vec![Pair::ZERO; widths.words.div_ceil(2)],
            halves: vec![Halves::ZERO; widths.halves],
        }
    }

    /// A register for the inputs of the synthesizer alone.
    pub(super) fn inputs(widths: Widths) -> Register {
        Register::new(Widths {
            bytes: widths.input_bytes,
            words: widths.input_words,
            ..Widths::default()
        })
    }

    /// Takes the integers of a register that is no wider.
    pub(super) fn copy(&mut self, from: &Register) {
        self.quads[..from.quads.len()].copy_from_slice(&from.quads);
        self.pairs[..from.pairs.len()].copy_from_slice(&from.pairs);
    }

    /// Puts rows of results in, within a range.
    pub(super) fn store(&mut self, kernels: Kernels, held: Held, rows: &[Sums], range: (i32, i32)) {
        match held {
            Held::Bytes => kernels.pack_quads(rows, range, &mut self.quads),
            Held::Words => kernels.pack_pairs(rows, range, &mut self.pairs),
            // Integers are never held as halves.
            Held::Halves => {}
        }
    }

    /// Its integers; none where it holds halves.
    pub(super) fn integers(&self, held: Held) -> Integers<'_> {
        match held {
            Held::Bytes => Integers::Quads(&self.quads),
            Held::Words => Integers::Pairs(&self.pairs),
            Held::Halves => Integers::Quads(&[]),
        }
    }
}
