//! Instruction: one 64-bit word of a microprogram.
//!
//! [`table`] is the only place that knows the instructions.

pub mod class;
pub mod operand;
pub mod table;

pub use class::Class;
pub use operand::{Field, Operand, OperandKind};
pub use table::{Instruction, Row, TABLE};

use std::fmt;
use table::OPCODE;

/// Vector registers of a unit.
pub const VECTOR_COUNT: u16 = crate::limits::VECTOR_REGISTERS;

/// Why a word is no instruction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WordError {
    /// No row has this opcode.
    Opcode {
        /// Bits 0..8 of the word.
        found: u8,
    },
    /// Bits are set that belong to no operand of the row.
    Reserved {
        /// The instruction's mnemonic.
        mnemonic: &'static str,
        /// The set bits that must be zero.
        found: u64,
    },
    /// The unit has no such register, grid, layer or number.
    Operand {
        /// The instruction's mnemonic.
        mnemonic: &'static str,
        /// The operand.
        operand: &'static Operand,
        /// The number found.
        found: u16,
    },
}

impl fmt::Display for WordError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            WordError::Opcode { found } => {
                let known: Vec<String> = TABLE
                    .iter()
                    .map(|row| format!("{:#04x}", row.opcode))
                    .collect();
                write!(
                    f,
                    "found opcode {found:#04x}; allowed: {}",
                    known.join(", ")
                )
            }
            WordError::Reserved { mnemonic, found } => write!(
                f,
                "{mnemonic}: found reserved bits {found:#018x}; allowed: zeros"
            ),
            WordError::Operand {
                mnemonic,
                operand,
                found,
            } => {
                let prefix = operand.kind.prefix();
                let allowed = operand.allowed();
                write!(f, "{mnemonic}: found {prefix}{found}; allowed: {allowed}")
            }
        }
    }
}

impl std::error::Error for WordError {}

impl Instruction {
    /// The 64-bit word. Operands are cut to their fields; a [`Program`](crate::Program) holds none
    /// that would be cut.
    #[must_use]
    pub fn encode(&self) -> u64 {
        let row = self.row();
        row.operands
            .iter()
            .zip(self.operands())
            .fold(u64::from(row.opcode), |word, (operand, n)| {
                word | (u64::from(n) << operand.field.low) & operand.field.mask()
            })
    }

    /// The instruction of a word.
    ///
    /// # Errors
    /// When the opcode is unknown, reserved bits are set, or an operand is outside its range.
    pub fn decode(word: u64) -> Result<Instruction, WordError> {
        let opcode = (word & OPCODE.mask()) as u8;
        let unknown = WordError::Opcode { found: opcode };
        let row = TABLE
            .iter()
            .find(|row| row.opcode == opcode)
            .ok_or(unknown)?;
        let reserved = word & row.reserved_mask();
        if reserved != 0 {
            return Err(WordError::Reserved {
                mnemonic: row.mnemonic,
                found: reserved,
            });
        }
        let operands: Vec<u16> = row
            .operands
            .iter()
            .map(|operand| ((word & operand.field.mask()) >> operand.field.low) as u16)
            .collect();
        let instruction = Instruction::from_operands(opcode, &operands).ok_or(unknown)?;
        instruction.check_operands()?;
        Ok(instruction)
    }

    /// Whether the unit has every register, grid, layer and number that is named.
    ///
    /// # Errors
    /// The first operand that is outside its range.
    pub fn check_operands(&self) -> Result<(), WordError> {
        let row = self.row();
        let operands = row.operands.iter().zip(self.operands());
        for (operand, found) in operands {
            if !operand.allows(found) {
                return Err(WordError::Operand {
                    mnemonic: row.mnemonic,
                    operand,
                    found,
                });
            }
        }
        Ok(())
    }

    /// The layer that it names, if it names one.
    #[must_use]
    pub fn layer(&self) -> Option<u16> {
        let operands = self.row().operands.iter().zip(self.operands());
        operands
            .filter(|(operand, _)| operand.kind == OperandKind::Layer)
            .map(|(_, layer)| layer)
            .next()
    }

    /// The same with another layer, where it names one.
    #[must_use]
    pub fn with_layer(&self, layer: u16) -> Instruction {
        let row = self.row();
        let operands: Vec<u16> = row
            .operands
            .iter()
            .zip(self.operands())
            .map(|(operand, number)| match operand.kind {
                OperandKind::Layer => layer,
                OperandKind::Grid
                | OperandKind::Vector
                | OperandKind::Lane
                | OperandKind::Lanes
                | OperandKind::Channels
                | OperandKind::Octaves
                | OperandKind::Zeros
                | OperandKind::Shift
                | OperandKind::Flag
                | OperandKind::Times
                | OperandKind::Step => number,
            })
            .collect();
        Instruction::from_operands(row.opcode, &operands).unwrap_or(*self)
    }
}

#[cfg(test)]
mod tests;
