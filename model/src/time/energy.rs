//! Energy: what a run did, each operation at its price in a published table.
//!
//! The result is in *picojoules of the table*. It ranks designs that differ in what they multiply,
//! keep and move; it is no estimate of a chip's power. Clocks, wires, control and leakage are in no
//! table, and the tables were measured in processes, circuits and widths of their own.
//!
//! [`Operations`] are plain counts, an [`EnergyTable`] is a file of prices with a source each, and
//! [`EnergyTable::of`] multiplies the one by the other. What an operation costs is a formula over
//! the table's entries ([`Level::formula`]), so every entry counts for something.

mod operations;
mod table;
#[cfg(test)]
mod tests;

pub use operations::{Operation, Operations};
pub use table::{EnergyError, EnergyTable, Price, SramPrice};

use super::choice::CacheKind;
use super::unit::Configuration;
use table::Term;

/// Bytes of a tag, with its valid and replacement bits: a 32-bit word.
const TAG_BYTES: u64 = 4;

/// Bytes of the activations of a job: how many depends on the program; this is 128 texels with 64
/// lanes of a byte, a job of the largest preset.
const ACTIVATION_BYTES: u64 = 128 * 64;

/// Bytes that the decoded-texel cache keeps for a texel: 16 channels of a byte, the most that a
/// texture set has.
const DECODED_TEXEL_BYTES: u64 = 16;

/// What one kind of operation came to.
#[derive(Clone, Debug, PartialEq)]
pub struct Level {
    /// The kind.
    pub operation: Operation,
    /// How many, in the operation's own unit: operations or bytes.
    pub count: u64,
    /// The price of one, in picojoules of the table.
    pub picojoules_each: f64,
    /// All of them, in picojoules of the table.
    pub picojoules: f64,
    /// The price in terms of the table's entries: `int8_multiply + int32_add`.
    pub formula: String,
    /// Where the entries come from.
    pub source: String,
}

/// What a run came to.
#[derive(Clone, Debug, PartialEq)]
pub struct Energy {
    /// The table's identity.
    pub table: String,
    /// A level for every kind of operation, in the order of the texel's journey.
    pub levels: Vec<Level>,
    /// Their sum, in picojoules of the table.
    pub picojoules: f64,
}

impl EnergyTable {
    /// The operations of a run on a unit, at this table's prices.
    #[must_use]
    pub fn of(&self, operations: &Operations, unit: &Configuration) -> Energy {
        let levels: Vec<Level> = Operation::ALL
            .iter()
            .map(|&operation| self.level(operation, operations.of(operation), unit))
            .collect();
        Energy {
            table: self.identity(),
            picojoules: levels.iter().map(|level| level.picojoules).sum(),
            levels,
        }
    }

    fn level(&self, operation: Operation, count: u64, unit: &Configuration) -> Level {
        let terms = self.terms(operation, unit);
        let each: f64 = terms.iter().map(Term::picojoules).sum();
        let mut sources: Vec<&str> = Vec::new();
        for term in &terms {
            if !sources.contains(&term.source.as_str()) {
                sources.push(&term.source);
            }
        }
        Level {
            operation,
            count,
            picojoules_each: each,
            // A double holds every count below 2^53 exactly.
            picojoules: count as f64 * each,
            formula: terms
                .iter()
                .map(ToString::to_string)
                .collect::<Vec<_>>()
                .join(" + "),
            source: sources.join("; "),
        }
    }

    /// What one operation consists of.
    fn terms(&self, operation: Operation, unit: &Configuration) -> Vec<Term> {
        let multiply = self.entry("int8_multiply", &self.int8_multiply);
        let add = self.entry("int32_add", &self.int32_add);
        let rescale = self.entry("int32_multiply", &self.int32_multiply);
        let register = self.entry("register", &self.register).times(1.0 / 8.0);
        let outside = self.entry("dram", &self.dram).times(1.0 / 8.0);
        let sram_byte = |bytes: u64| self.sram_of(bytes).times(1.0 / 8.0);
        let latents = match unit.cache {
            CacheKind::Finite | CacheKind::Infinite => sram_byte(unit.cache_bytes()),
            // Lines pass through what they arrive in.
            CacheKind::None => register.clone(),
        };
        match operation {
            Operation::MacsBytes => vec![multiply, add],
            Operation::MacsNarrow => vec![self.entry("int4_multiply", &self.int4_multiply), add],
            // A wide value is two bytes, whatever the time that the array takes for them.
            Operation::MacsWide => vec![multiply.times(2.0), add.times(2.0)],
            Operation::MacsHalf => vec![
                self.entry("fp16_multiply", &self.fp16_multiply),
                self.entry("fp32_add", &self.fp32_add),
            ],
            Operation::Requantised | Operation::SkipAdds => vec![rescale, add],
            // Four weighted corners, three sums and a rounding.
            Operation::Interpolations => vec![multiply.times(4.0), add.times(4.0)],
            Operation::UnpackedLatents => vec![register],
            Operation::Embedded => vec![self.entry("int8_add", &self.int8_add), register],
            // Row times pitch; two coordinates, a column and a base are added.
            Operation::AddressSteps => vec![rescale, add.times(4.0)],
            // All ways of a set are read and compared.
            Operation::TagLookups => {
                let ways = f64::from(unit.cache_ways);
                let lines = u64::from(unit.cache_sets) * u64::from(unit.cache_ways);
                let tags = self.sram_of(lines * TAG_BYTES);
                vec![tags.times(ways * TAG_BYTES as f64 / 8.0), add.times(ways)]
            }
            Operation::L1ReadBytes | Operation::L1FillBytes => vec![latents],
            Operation::L2ReadBytes | Operation::L2FillBytes => vec![sram_byte(unit.level2_bytes())],
            Operation::MemoryBytes => vec![outside],
            Operation::WeightSramReadBytes => vec![sram_byte(u64::from(unit.weight_sram_bytes))],
            Operation::WeightFillBytes => {
                vec![outside, sram_byte(u64::from(unit.weight_sram_bytes))]
            }
            Operation::ActivationBytes => vec![sram_byte(ACTIVATION_BYTES)],
            Operation::DecodedCacheReadBytes | Operation::DecodedCacheFillBytes => {
                vec![sram_byte(unit.decoded_cache_texels() * DECODED_TEXEL_BYTES)]
            }
            Operation::FilteredCodes => vec![multiply, add],
            Operation::OutputBytes => vec![register],
        }
    }
}
