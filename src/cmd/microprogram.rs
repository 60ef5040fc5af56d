//! Microprograms as files: assembly and images, read within limits.

use anyhow::Context as _;
use ntmu::isa::instruction::Instruction;
use ntmu::isa::layout::Layout;
use ntmu::isa::{assembly, image};
use serde_json::{Value, json};
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// The longest text that is read as assembly, or as words in hexadecimal.
const MAX_TEXT_BYTES: u64 = 1 << 20;

/// A program that is known to fit no asset yet.
pub(super) struct Microprogram {
    pub(super) layout: Layout,
    pub(super) instructions: Vec<Instruction>,
}

/// At most `limit` bytes.
fn read_at_most(source: impl Read, limit: u64) -> anyhow::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    source.take(limit + 1).read_to_end(&mut bytes)?;
    anyhow::ensure!(
        bytes.len() as u64 <= limit,
        "found more than {limit} bytes; allowed: at most so many"
    );
    Ok(bytes)
}

/// At most [`MAX_TEXT_BYTES`] of text.
pub(super) fn read_text(source: impl Read) -> anyhow::Result<String> {
    let bytes = read_at_most(source, MAX_TEXT_BYTES)?;
    String::from_utf8(bytes).context("found bytes that are no UTF-8; allowed: text")
}

/// A program as an image.
pub(super) fn read_image(path: &Path) -> anyhow::Result<Microprogram> {
    let context = || path.display().to_string();
    let file = File::open(path).with_context(context)?;
    let bytes = read_at_most(file, image::MAX_BYTES as u64).with_context(context)?;
    let (layout, instructions) = image::read(&bytes).with_context(context)?;
    Ok(Microprogram {
        layout,
        instructions,
    })
}

/// A program as assembly.
pub(super) fn read_assembly(path: &Path) -> anyhow::Result<Microprogram> {
    let context = || path.display().to_string();
    let file = File::open(path).with_context(context)?;
    let text = read_text(file).with_context(context)?;
    let (layout, instructions) = assembly::assemble(&text).with_context(context)?;
    Ok(Microprogram {
        layout,
        instructions,
    })
}

/// A program as an image if the file starts like one, else as assembly.
pub(super) fn read(path: &Path) -> anyhow::Result<Microprogram> {
    let context = || path.display().to_string();
    let mut start = [0; image::MAGIC.len()];
    let mut file = File::open(path).with_context(context)?;
    let found = file.read(&mut start).with_context(context)?;
    if found == start.len() && start == image::MAGIC {
        read_image(path)
    } else {
        read_assembly(path)
    }
}

/// Assembly with the word of every line behind it.
pub(super) fn text(program: &Microprogram) -> String {
    let layout = format!(".layout {}\n", program.layout);
    layout + &listing(&program.instructions)
}

/// The lines of [`text`], without the layout.
pub(super) fn listing(instructions: &[Instruction]) -> String {
    assembly::lines(instructions)
        .zip(instructions)
        .map(|(line, instruction)| format!("{line:<40}; {:016x}\n", instruction.encode()))
        .collect()
}

/// Layout, words and assembly.
pub(super) fn program_as_json(program: &Microprogram) -> Value {
    let instructions = instructions_as_json(&program.instructions);
    json!({ "layout": program.layout.to_string(), "instructions": instructions })
}

/// Words and assembly.
pub(super) fn instructions_as_json(instructions: &[Instruction]) -> Value {
    let describe = |instruction: &Instruction| {
        let word = format!("{:016x}", instruction.encode());
        json!({ "word": word, "assembly": assembly::disassemble(instruction) })
    };
    instructions.iter().map(describe).collect()
}
