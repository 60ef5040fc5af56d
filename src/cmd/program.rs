//! `ntmu program`: the microprogram of an asset as assembly.

use crate::Verdict;
use crate::{console, files};
use anyhow::Context as _;
use ntmu::isa::instruction::TABLE;
use ntmu::isa::layout::Layout;
use ntmu::isa::{Program as Microprogram, assembly};
use serde_json::json;
use std::path::PathBuf;

#[derive(clap::Args)]
pub(crate) struct Program {
    /// The asset, an .ntx file.
    #[arg(required_unless_present = "manual")]
    asset: Option<PathBuf>,
    /// Where the unit's memory keeps the grids: linear, tiles-4, tiles-4-rows, morton, super-4, … (other
    /// sides are 2, 8 and 16), alone or with +planar or +together.
    #[arg(long, default_value_t = Layout::LINEAR)]
    layout: Layout,
    /// Check this assembly against the asset instead of compiling the asset.
    #[arg(long, value_name = "FILE")]
    check: Option<PathBuf>,
    /// Print the reference manual of the instruction set instead.
    #[arg(long)]
    manual: bool,
}

impl Program {
    pub(crate) fn run(self, json: bool) -> anyhow::Result<Verdict> {
        let Some(path) = self.asset.filter(|_| !self.manual) else {
            if json {
                console::print_json(&describe_table())?;
            } else {
                console::print(&assembly::manual());
            }
            return Ok(Verdict::Fine);
        };
        let asset = files::read_asset(&path)?;
        let program = match &self.check {
            None => {
                self.layout.check(&asset.shape)?;
                Microprogram::compile(&asset, self.layout)
            }
            Some(file) => {
                let context = || format!("{}", file.display());
                let text = std::fs::read_to_string(file).with_context(context)?;
                let (layout, instructions) = assembly::assemble(&text).with_context(context)?;
                Microprogram::link(&asset, layout, instructions).with_context(context)?
            }
        };
        let lines: Vec<_> = program
            .instructions()
            .iter()
            .map(|i| (i.encode(), assembly::disassemble(i)))
            .collect();
        if json {
            let instructions: Vec<_> = lines
                .iter()
                .map(|(word, text)| json!({ "word": format!("{word:016x}"), "assembly": text }))
                .collect();
            let layout = program.layout().to_string();
            console::print_json(&json!({ "layout": layout, "instructions": instructions }))?;
        } else {
            let mut text = format!(".layout {}\n", program.layout());
            for (word, line) in lines {
                text.push_str(&format!("{line:<40}; {word:016x}\n"));
            }
            console::print(&text);
        }
        Ok(Verdict::Fine)
    }
}

/// The instruction table, as the reference manual shows it.
fn describe_table() -> Vec<serde_json::Value> {
    TABLE
        .iter()
        .map(|row| {
            let operands: Vec<_> = row
                .operands
                .iter()
                .map(|o| {
                    let prefix = o.kind.prefix();
                    json!({ "name": o.name, "prefix": prefix, "low_bit": o.low, "end_bit": o.high })
                })
                .collect();
            json!({
                "opcode": row.opcode, "mnemonic": row.mnemonic, "operands": operands,
                "meaning": row.summary.trim(),
            })
        })
        .collect()
}
