//! Assembly: a program as text, both ways.
//!
//! ```text
//! .layout tiles-4
//! position g0
//! concat   v0, 0, g0          ; mnemonic, then operands in the order of the table
//! end
//! ```
//!
//! A line holds at most one instruction or directive; `;` starts a comment.

use crate::instruction::{Instruction, OperandKind, TABLE};
use crate::layout::{Layout, LayoutError};
use std::fmt;
use std::fmt::Write as _;

/// Why a text is no program.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AssemblyError {
    /// The line, from 1.
    pub line: usize,
    /// What was found there.
    pub found: String,
    /// What is allowed there.
    pub allowed: String,
}

impl fmt::Display for AssemblyError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "line {}: found {}; allowed: {}",
            self.line, self.found, self.allowed
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
        .map(|(field, number)| format!("{}{number}", field.kind.prefix()))
        .collect();
    format!("{:<14}{}", row.mnemonic, operands.join(", "))
        .trim_end()
        .to_owned()
}

/// A program's layout and instructions as text.
#[must_use]
pub fn print(layout: Layout, instructions: &[Instruction]) -> String {
    let mut text = format!(".layout {layout}\n");
    for instruction in instructions {
        let _ = writeln!(text, "{}", disassemble(instruction));
    }
    text
}

/// A program's layout and instructions from text. The layout is linear where none is given.
///
/// # Errors
/// The first line that is neither empty, a directive nor an instruction of the table.
pub fn assemble(text: &str) -> Result<(Layout, Vec<Instruction>), AssemblyError> {
    let mut layout = Layout::LINEAR;
    let mut instructions = Vec::new();
    for (index, line) in text.lines().enumerate() {
        let code = line.split(';').next().unwrap_or_default().trim();
        let error = |found: &str, allowed: String| AssemblyError {
            line: index + 1,
            found: format!("{found:?}"),
            allowed,
        };
        if code.is_empty() {
            continue;
        }
        let (mnemonic, rest) = code.split_once(char::is_whitespace).unwrap_or((code, ""));
        let rest = rest.trim();
        if mnemonic == ".layout" {
            layout = rest
                .parse()
                .map_err(|refusal: LayoutError| error(rest, refusal.allowed()))?;
            continue;
        }
        let row = TABLE
            .iter()
            .find(|row| row.mnemonic == mnemonic)
            .ok_or_else(|| {
                let known: Vec<&str> = TABLE.iter().map(|row| row.mnemonic).collect();
                error(mnemonic, format!(".layout, {}", known.join(", ")))
            })?;
        let words: Vec<&str> = if rest.is_empty() {
            Vec::new()
        } else {
            rest.split(',').map(str::trim).collect()
        };
        if words.len() != row.operands.len() {
            let names: Vec<&str> = row.operands.iter().map(|o| o.name).collect();
            return Err(error(
                rest,
                format!("{} operands: {}", names.len(), names.join(", ")),
            ));
        }
        let mut numbers = Vec::with_capacity(words.len());
        for (field, word) in row.operands.iter().zip(&words) {
            let number = parse_operand(word, field.kind).filter(|&n| n <= field.max());
            numbers.push(number.ok_or_else(|| {
                let prefix = field.kind.prefix();
                error(
                    word,
                    format!("{}: {prefix}0 to {prefix}{}", field.name, field.max()),
                )
            })?);
        }
        instructions.extend(Instruction::from_operands(row.opcode, &numbers));
    }
    Ok((layout, instructions))
}

fn parse_operand(word: &str, kind: OperandKind) -> Option<u16> {
    let digits = word.strip_prefix(kind.prefix())?;
    if digits.is_empty() || !digits.bytes().all(|b| b.is_ascii_digit()) {
        return None;
    }
    digits.parse().ok()
}

/// The reference manual: the instruction table as Markdown.
#[must_use]
pub fn manual() -> String {
    let mut text = String::from("| opcode | assembly | bits | meaning |\n|---|---|---|---|\n");
    for row in TABLE {
        let operands: Vec<String> = row
            .operands
            .iter()
            .map(|o| format!("{}*{}*", o.kind.prefix(), o.name))
            .collect();
        let bits: Vec<String> = row
            .operands
            .iter()
            .map(|o| format!("{} {}..{}", o.name, o.low, o.high))
            .collect();
        let _ = writeln!(
            text,
            "| {:#04x} | `{}` {} | {} | {} |",
            row.opcode,
            row.mnemonic,
            operands.join(", "),
            bits.join("; "),
            row.summary.trim()
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::instruction::Operand;

    #[test]
    fn every_instruction_returns_from_its_text() {
        for row in TABLE {
            for pick in [Operand::max as fn(&Operand) -> u16, |_| 0, |o| o.max() / 2] {
                let operands: Vec<u16> = row.operands.iter().map(pick).collect();
                let instruction = Instruction::from_operands(row.opcode, &operands).unwrap();
                let text = print(Layout::TILED, &[instruction]);
                assert_eq!(assemble(&text), Ok((Layout::TILED, vec![instruction])));
            }
        }
    }

    #[test]
    fn a_wrong_line_is_named() {
        let refusal = |text| assemble(text).unwrap_err();
        assert_eq!(refusal("end\n\nfly g0").line, 3);
        assert_eq!(refusal("position g2").allowed, "grid: g0 to g1");
        assert_eq!(refusal("position v0").found, "\"v0\"");
        assert_eq!(
            refusal("dense l0, v0").allowed,
            "4 operands: layer, src, inputs, outputs"
        );
        let unknown = "spiral".parse::<Layout>().unwrap_err();
        assert_eq!(refusal(".layout spiral").allowed, unknown.allowed());
        assert_eq!(refusal("position g+1").allowed, "grid: g0 to g1");
    }
}
