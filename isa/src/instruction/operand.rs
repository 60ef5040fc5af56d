//! Operand: a field of the word, what it names, and which numbers the unit has for it.

use crate::activation::MAX_LEAK_SHIFT;
use crate::embed::MAX_OCTAVES;
use crate::limits::{
    MAX_CHANNELS, MAX_LANES, MAX_LAYERS, MAX_PADDING, MAX_REPEATS, VECTOR_REGISTERS,
};

/// What an operand names. It decides how the operand is written in assembly and its range.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum OperandKind {
    /// A grid, `g0` or `g1`.
    Grid,
    /// A vector register of 16-bit lanes, integers or halves, `v0`..`v3`.
    Vector,
    /// A layer's parameters, `l0`..`l63`.
    Layer,
    /// The number of a lane.
    Lane,
    /// A number of lanes, accumulators or sums.
    Lanes,
    /// A number of channels.
    Channels,
    /// A number of octaves.
    Octaves,
    /// A number of lanes that are filled with zeros.
    Zeros,
    /// n of a slope 2^−n.
    Shift,
    /// No or yes.
    Flag,
    /// How often a loop's body runs.
    Times,
    /// Layers from one run of a loop's body to the next.
    Step,
}

impl OperandKind {
    /// What stands before the number in assembly.
    #[must_use]
    pub const fn prefix(self) -> &'static str {
        match self {
            OperandKind::Grid => "g",
            OperandKind::Vector => "v",
            OperandKind::Layer => "l",
            OperandKind::Lane
            | OperandKind::Lanes
            | OperandKind::Channels
            | OperandKind::Octaves
            | OperandKind::Zeros
            | OperandKind::Shift
            | OperandKind::Flag
            | OperandKind::Times
            | OperandKind::Step => "",
        }
    }

    /// The smallest and the largest number that the unit has.
    #[must_use]
    pub const fn range(self) -> (u16, u16) {
        match self {
            OperandKind::Grid | OperandKind::Flag => (0, 1),
            OperandKind::Vector => (0, VECTOR_REGISTERS - 1),
            OperandKind::Layer | OperandKind::Step => (0, MAX_LAYERS - 1),
            OperandKind::Lane => (0, MAX_LANES - 1),
            OperandKind::Lanes => (1, MAX_LANES),
            OperandKind::Channels => (1, MAX_CHANNELS),
            OperandKind::Octaves => (0, MAX_OCTAVES as u16),
            OperandKind::Zeros => (1, MAX_PADDING as u16),
            OperandKind::Shift => (1, MAX_LEAK_SHIFT as u16),
            OperandKind::Times => (1, MAX_REPEATS),
        }
    }
}

/// Neighbouring bits of the word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Field {
    /// The lowest bit.
    pub low: u8,
    /// The bit above the highest.
    pub high: u8,
}

impl Field {
    /// Its bits of the word.
    #[must_use]
    pub const fn mask(self) -> u64 {
        let width = (self.high - self.low) as u32;
        (u64::MAX >> (64 - width)) << self.low
    }
}

/// One operand of an instruction: its name, kind, and bits of the word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Operand {
    /// Its name in assembly and in [`Instruction`](super::Instruction).
    pub name: &'static str,
    /// What it names, which is also its range.
    pub kind: OperandKind,
    /// Its bits of the word.
    pub field: Field,
    /// What it is for, for the reference manual.
    pub summary: &'static str,
}

impl Operand {
    /// The smallest number that it may be.
    #[must_use]
    pub const fn min(&self) -> u16 {
        self.kind.range().0
    }

    /// The largest number that it may be; its bits may hold larger ones.
    #[must_use]
    pub const fn max(&self) -> u16 {
        self.kind.range().1
    }

    /// Whether the unit has this number.
    #[must_use]
    pub const fn allows(&self, number: u16) -> bool {
        number >= self.min() && number <= self.max()
    }

    /// What is allowed, as assembly has it: `grid: g0 to g1`.
    #[must_use]
    pub fn allowed(&self) -> String {
        let prefix = self.kind.prefix();
        let (low, high) = (self.min(), self.max());
        format!("{}: {prefix}{low} to {prefix}{high}", self.name)
    }
}
