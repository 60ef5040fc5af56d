//! Manual: the reference manual of the instruction set, as Markdown.
//!
//! Text stands here; whatever a row of the table knows is read off the table.

use crate::image;
use crate::instruction::{Class, Operand, Row, TABLE};
use crate::limits::{
    MAX_DECODES, MAX_INSTRUCTIONS, MAX_LANES, MAX_LAYERS, MAX_STEPS, VECTOR_REGISTERS,
};
use std::fmt::Write as _;

/// The reference manual.
#[must_use]
pub fn manual() -> String {
    let mut text = introduction();
    text.push_str("\n## Overview\n\n");
    text.push_str("| opcode | assembly | class | meaning |\n|---|---|---|---|\n");
    for row in TABLE {
        let _ = writeln!(
            text,
            "| {:#04x} | {} | {} | {} |",
            row.opcode,
            syntax(row),
            row.class.name(),
            row.summary.trim()
        );
    }
    text.push_str(
        "\n## Classes\n\nA class is the part of the unit that an instruction keeps busy.\n\n",
    );
    text.push_str("| class | instructions |\n|---|---|\n");
    for class in Class::ALL {
        let rows = TABLE.iter().filter(|row| row.class == class);
        let names: Vec<String> = rows.map(|row| format!("`{}`", row.mnemonic)).collect();
        let _ = writeln!(text, "| {} | {} |", class.name(), names.join(", "));
    }
    text.push_str("\n## Instructions\n");
    for row in TABLE {
        describe(row, &mut text);
    }
    text
}

fn introduction() -> String {
    let (major, minor) = image::VERSION;
    let header = image::HEADER_BYTES;
    format!(
        "\
# The instruction set

Generated from the instruction table by `ntmu program --manual`; do not edit.

A unit runs a microprogram. It has two grids `g0`, `g1`; {VECTOR_REGISTERS} vector registers `v0` to `v{last_vector}` of {MAX_LANES}
lanes, integers or halves; the parameters of at most {MAX_LAYERS} layers, `l0` to `l{last_layer}`; one row of accumulators,
and one of fp16 layers' sums.

## Words

An instruction is one 64-bit word. Bits 0..8 are the opcode; a range `a..b` of bits starts at bit a
and ends before bit b. Reserved bits must be zero, and an operand must be in its range, which can be
smaller than what its bits hold: decoder, assembler and linker refuse anything else.

## Loops

`repeat times, step` runs the instructions up to `again` `times` times. In run i, counted from 0, a layer
l among them is the layer l + step·i. Loops are not nested. The compiler makes them of equal blocks of
layers.

## Samples

A program with `footprint` decodes a sample. `footprint` makes the decodes and their weights from the
request's coordinates by the sampler's state: texels where the filter comes behind the synthesizer,
places where it comes before. `each` runs the instructions up to `next` once for every decode, at most
{MAX_DECODES} times, not at all where everything is border. `collect` puts the codes of a decode into the
filter's buffer; `blend` filters what is in it, by the profile's rule, and sends. The same program serves
every sampler.

## What a program must keep

- `end` is the last instruction and stands nowhere else. A program has at most {MAX_INSTRUCTIONS} instructions, and
  {MAX_STEPS} when loops are unrolled, the loop of a footprint counted once.
- Every grid and layer that is named exists in the asset, in every run of a loop.
- Nothing is read before it is written: a grid is positioned before it is fetched and fetched before it is
  unpacked, lanes are written without gaps, a register holds the numbers that its reader wants, and
  accumulators are those of the layer that is named. That holds in every run of every loop.
- What the loop of a footprint writes is not read behind it. Positions, waves and level stand inside it,
  for there is no place elsewhere.
- A program for a texel has one `emit`; one for a sample has one `footprint`, one loop with one `collect`,
  and one `blend` behind it.

An accumulator that is too narrow does what the profile says. Which layers may overflow is proven with
the program, by intervals; `ntmu program` prints it.

## Assembly

A line holds at most one instruction: the mnemonic, then the operands, separated by commas. `;` starts a
comment. `.layout NAME` says where memory keeps the grids; without it they are linear. Indentation means
nothing.

## Program images

A program as bytes, little endian, version {major}.{minor}: the magic number, `u16` major, `u16` minor, `u32` code of
the layout, `u32` number of words, `u32` CRC-32 of the words, `u32` zero, `u32` CRC-32 of the bytes before
it; {header} bytes in all, then the words.
",
        last_vector = VECTOR_REGISTERS - 1,
        last_layer = MAX_LAYERS - 1,
    )
}

/// The mnemonic and its operands.
fn syntax(row: &Row) -> String {
    let operands: Vec<String> = row
        .operands
        .iter()
        .map(|o| format!("{}*{}*", o.kind.prefix(), o.name))
        .collect();
    format!("`{}` {}", row.mnemonic, operands.join(", "))
        .trim_end()
        .to_owned()
}

fn describe(row: &Row, text: &mut String) {
    let _ = write!(
        text,
        "\n### {}\n\n{}\n\n{}\n\n| bits | field | range | meaning |\n|---|---|---|---|\n| 0..8 | opcode | {:#04x} | |\n",
        row.mnemonic,
        syntax(row),
        row.summary.trim(),
        row.opcode
    );
    let mut fields: Vec<(u8, String)> = row
        .operands
        .iter()
        .map(|operand| (operand.field.low, field(operand)))
        .chain(row.reserved.iter().map(|reserved| {
            let bits = format!("{}..{}", reserved.low, reserved.high);
            (reserved.low, format!("| {bits} | reserved | 0 | |"))
        }))
        .collect();
    fields.sort();
    for (_, field) in fields {
        let _ = writeln!(text, "{field}");
    }
}

fn field(operand: &Operand) -> String {
    let prefix = operand.kind.prefix();
    let (low, high) = (operand.min(), operand.max());
    format!(
        "| {}..{} | {} | {prefix}{low} to {prefix}{high} | {} |",
        operand.field.low,
        operand.field.high,
        operand.name,
        operand.summary.trim()
    )
}
