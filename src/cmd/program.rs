//! `ntmu program`: the microprogram of an asset, and what is proven of it.

use super::microprogram::{Microprogram, program_as_json, read, text};
use crate::Verdict;
use crate::{console, files};
use anyhow::Context as _;
use ntmu::isa::instruction::{Class, TABLE};
use ntmu::isa::layout::Layout;
use ntmu::isa::program::SumBound;
use ntmu::isa::{Asset, Program as Linked, image, manual};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// The program of an asset as assembly, with the instructions of each class and the proof of its
/// accumulators as comments. An overflow is legal: the profile says what it does.
#[derive(clap::Args)]
pub(crate) struct Program {
    /// The asset, an .ntx file.
    #[arg(required_unless_present = "manual")]
    asset: Option<PathBuf>,
    /// Where the unit's memory keeps the grids: linear, tiles-4, tiles-4-rows, morton, super-4, … (other
    /// sides are 2, 8 and 16), alone or with +planar or +together.
    #[arg(long, default_value_t = Layout::LINEAR)]
    layout: Layout,
    /// The program of a filtered sample instead of a texel's.
    #[arg(long)]
    sample: bool,
    /// Check this assembly or program image against the asset instead of compiling the asset.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["sample", "layout"])]
    check: Option<PathBuf>,
    /// Write the program here: an image if the name ends in .ntp, assembly otherwise.
    #[arg(short, long, value_name = "FILE", conflicts_with = "manual")]
    output: Option<PathBuf>,
    /// Print the reference manual of the instruction set instead.
    #[arg(long)]
    manual: bool,
}

impl Program {
    pub(crate) fn run(self, json: bool) -> anyhow::Result<Verdict> {
        let Some(path) = self.asset.as_ref().filter(|_| !self.manual) else {
            if json {
                console::print_json(&describe_table())?;
            } else {
                console::print(&manual::manual());
            }
            return Ok(Verdict::Fine);
        };
        let asset = files::read_asset(path)?;
        let program = self.program(&asset)?;
        let stored = Microprogram {
            layout: program.layout(),
            instructions: program.instructions().to_vec(),
        };
        if let Some(path) = &self.output {
            write(path, &stored)?;
        }
        let bounds = program.sum_bounds(&asset);
        if json {
            let mut value = program_as_json(&stored);
            value["filters"] = json!(program.footprint_loop().is_some());
            value["steps"] = json!(program.steps().len());
            value["classes"] = program
                .counts()
                .into_iter()
                .map(|(class, count)| (class.name().to_owned(), json!(count)))
                .collect();
            value["sums"] = bounds.iter().map(describe_bound).collect();
            value["written"] = json!(self.output);
            console::print_json(&value)?;
        } else {
            let report = report(&program, &bounds);
            match &self.output {
                Some(path) => console::print(&format!("{}\n{report}", path.display())),
                None => {
                    let comments = report.lines().map(|line| format!("; {line}\n"));
                    console::print(&format!(
                        "{}{}",
                        text(&stored),
                        comments.collect::<String>()
                    ));
                }
            }
        }
        Ok(Verdict::Fine)
    }

    /// Compiled, or read; either way it has passed the linker.
    fn program(&self, asset: &Asset) -> anyhow::Result<Linked> {
        let Some(file) = &self.check else {
            let compiled = if self.sample {
                Linked::compile_sample(asset, self.layout)
            } else {
                Linked::compile(asset, self.layout)
            };
            let instructions = compiled.instructions().to_vec();
            return Linked::link(asset, self.layout, instructions).context("compiled program");
        };
        let read = read(file)?;
        Linked::link(asset, read.layout, read.instructions)
            .with_context(|| file.display().to_string())
    }
}

fn write(path: &Path, stored: &Microprogram) -> anyhow::Result<()> {
    if path.extension().is_some_and(|extension| extension == "ntp") {
        files::write(path, &image::write(stored.layout, &stored.instructions))
    } else {
        files::write(path, text(stored).as_bytes())
    }
}

/// What is executed, and between which numbers its sums lie.
fn report(program: &Linked, bounds: &[SumBound]) -> String {
    let counts = program.counts().into_iter();
    let counts: Vec<String> = counts
        .filter(|(_, count)| *count > 0)
        .map(|(class, count): (Class, usize)| format!("{count} {}", class.name()))
        .collect();
    let mut lines = vec![format!(
        "{} instructions, {} steps: {}",
        program.instructions().len(),
        program.steps().len(),
        counts.join(", ")
    )];
    lines.extend(bounds.iter().map(SumBound::to_string));
    lines.join("\n")
}

fn describe_bound(bound: &SumBound) -> Value {
    json!({
        "layer": bound.layer, "low": bound.low, "high": bound.high, "bits": bound.bits,
        "accumulator_bits": bound.accumulator.bits, "overflow": bound.accumulator.overflow.name(),
        "may_overflow": bound.may_overflow(),
    })
}

/// The instruction table, as the reference manual shows it.
fn describe_table() -> Vec<Value> {
    TABLE
        .iter()
        .map(|row| {
            let operands: Vec<_> = row
                .operands
                .iter()
                .map(|o| {
                    json!({
                        "name": o.name, "prefix": o.kind.prefix(), "low_bit": o.field.low,
                        "end_bit": o.field.high, "min": o.min(), "max": o.max(),
                        "meaning": o.summary.trim(),
                    })
                })
                .collect();
            let reserved: Vec<_> = row.reserved.iter().map(|r| [r.low, r.high]).collect();
            json!({
                "opcode": row.opcode, "mnemonic": row.mnemonic, "class": row.class.name(),
                "operands": operands, "reserved": reserved, "meaning": row.summary.trim(),
            })
        })
        .collect()
}
