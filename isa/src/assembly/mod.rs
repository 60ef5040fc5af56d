//! Assembly: a program as text, both ways.
//!
//! ```text
//! .layout tiles-4
//! position      g0
//! concat        v0, 0, g0     ; mnemonic, then operands in the order of the table
//! repeat        4, 2          ; a loop: what it repeats is indented when printed
//!   dense       l1, v1, 64, 64
//! again
//! end
//! ```
//!
//! A line holds at most one instruction or directive; `;` starts a comment. Indentation means
//! nothing. Whether the instructions fit together is the linker's to say.

use crate::instruction::{Instruction, Operand, Row, TABLE};
use crate::layout::{Layout, LayoutError};
use crate::layout_code;
use crate::limits::MAX_INSTRUCTIONS;
use std::fmt;
use std::fmt::Write as _;

/// Why a text is no program.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AssemblyError {
    /// The line, from 1.
    pub line: usize,
    /// The character of the line at which it was found, from 1.
    pub column: usize,
    /// What was found there.
    pub found: String,
    /// What is allowed there.
    pub allowed: String,
}

impl fmt::Display for AssemblyError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "line {}, column {}: found {}; allowed: {}",
            self.line, self.column, self.found, self.allowed
        )
    }
}

impl std::error::Error for AssemblyError {}

/// An instruction as one line of assembly.
#[must_use]
pub fn disassemble(instruction: &Instruction) -> String {
    let row = instruction.row();
    let operands: Vec<String> = row
        .operands
        .iter()
        .zip(instruction.operands())
        .map(|(operand, number)| format!("{}{number}", operand.kind.prefix()))
        .collect();
    format!("{:<14}{}", row.mnemonic, operands.join(", "))
        .trim_end()
        .to_owned()
}

/// Instructions as lines of assembly, one each, the bodies of loops indented.
pub fn lines(instructions: &[Instruction]) -> impl Iterator<Item = String> {
    let mut depth = 0_usize;
    instructions.iter().map(move |instruction| {
        if closes(instruction) {
            depth = depth.saturating_sub(1);
        }
        let line = format!(
            "{:width$}{}",
            "",
            disassemble(instruction),
            width = 2 * depth
        );
        if opens(instruction) {
            depth += 1;
        }
        line
    })
}

fn opens(instruction: &Instruction) -> bool {
    matches!(
        instruction,
        Instruction::Repeat { .. } | Instruction::Each {}
    )
}

fn closes(instruction: &Instruction) -> bool {
    matches!(instruction, Instruction::Again {} | Instruction::Next {})
}

/// A program's layout and instructions as text.
#[must_use]
pub fn print(layout: Layout, instructions: &[Instruction]) -> String {
    let mut text = format!(".layout {layout}\n");
    for line in lines(instructions) {
        let _ = writeln!(text, "{line}");
    }
    text
}

/// A program's layout and instructions from text. The layout is linear where none is given.
///
/// # Errors
/// The first line that is neither empty, a directive nor an instruction of the table whose operands
/// are in range; more than [`MAX_INSTRUCTIONS`] instructions.
pub fn assemble(text: &str) -> Result<(Layout, Vec<Instruction>), AssemblyError> {
    let mut layout = layout_code::DEFAULT;
    let mut instructions = Vec::new();
    for (index, line) in text.lines().enumerate() {
        let code = line.split(';').next().unwrap_or_default();
        let line = Line {
            number: index + 1,
            whole: code,
        };
        let code = code.trim();
        if code.is_empty() {
            continue;
        }
        let (mnemonic, rest) = code.split_once(char::is_whitespace).unwrap_or((code, ""));
        if mnemonic == ".layout" {
            let name = rest.trim();
            layout = name
                .parse()
                .map_err(|error: LayoutError| line.error(name, error.allowed()))?;
            continue;
        }
        let row = TABLE
            .iter()
            .find(|row| row.mnemonic == mnemonic)
            .ok_or_else(|| {
                let known: Vec<&str> = TABLE.iter().map(|row| row.mnemonic).collect();
                line.error(mnemonic, format!(".layout, {}", known.join(", ")))
            })?;
        if instructions.len() >= MAX_INSTRUCTIONS as usize {
            let allowed = format!("at most {MAX_INSTRUCTIONS} instructions");
            return Err(line.error(mnemonic, allowed));
        }
        let operands = line.operands(row, rest.trim())?;
        instructions.extend(Instruction::from_operands(row.opcode, &operands));
    }
    Ok((layout, instructions))
}

/// A line of the text, without its comment.
struct Line<'t> {
    number: usize,
    whole: &'t str,
}

impl<'t> Line<'t> {
    fn operands(&self, row: &'static Row, text: &'t str) -> Result<Vec<u16>, AssemblyError> {
        let words: Vec<&str> = if text.is_empty() {
            Vec::new()
        } else {
            text.split(',').map(str::trim).collect()
        };
        if words.len() != row.operands.len() {
            let names: Vec<&str> = row.operands.iter().map(|o| o.name).collect();
            let allowed = match names.as_slice() {
                [] => "no operand".to_owned(),
                names => format!("{} operands: {}", names.len(), names.join(", ")),
            };
            return Err(self.error(text, allowed));
        }
        let operands = row.operands.iter().zip(words);
        operands
            .map(|(operand, word)| {
                parse(word, operand).ok_or_else(|| self.error(word, operand.allowed()))
            })
            .collect()
    }

    /// An error at `found`, a part of this line.
    fn error(&self, found: &str, allowed: String) -> AssemblyError {
        // Both are slices of one text: their distance is the place of the one in the other.
        let bytes = (found.as_ptr() as usize).checked_sub(self.whole.as_ptr() as usize);
        let before = bytes.and_then(|bytes| self.whole.get(..bytes));
        AssemblyError {
            line: self.number,
            column: before.unwrap_or(self.whole).chars().count() + 1,
            found: format!("{found:?}"),
            allowed,
        }
    }
}

/// The number of an operand, if it is one and in range.
fn parse(word: &str, operand: &Operand) -> Option<u16> {
    let digits = word.strip_prefix(operand.kind.prefix())?;
    if digits.is_empty() || !digits.bytes().all(|b| b.is_ascii_digit()) {
        return None;
    }
    digits.parse().ok().filter(|&number| operand.allows(number))
}

#[cfg(test)]
mod tests;
