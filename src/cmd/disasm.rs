//! `ntmu disasm`: a program image, or words, become assembly.

use super::microprogram::{
    instructions_as_json, listing, program_as_json, read_image, read_text, text,
};
use crate::Verdict;
use crate::console;
use anyhow::Context as _;
use ntmu::isa::instruction::Instruction;
use serde_json::json;
use std::path::PathBuf;

/// Every word is checked by itself; whether they fit together is for `ntmu program --check`.
#[derive(clap::Args)]
pub(crate) struct Disasm {
    /// The program image, an .ntp file.
    #[arg(required_unless_present = "hex", conflicts_with = "hex")]
    input: Option<PathBuf>,
    /// Words in hexadecimal instead; from stdin if none follow.
    #[arg(long, value_name = "WORD", num_args = 0..)]
    hex: Option<Vec<String>>,
}

impl Disasm {
    pub(crate) fn run(self, json: bool) -> anyhow::Result<Verdict> {
        if let Some(path) = &self.input {
            let program = read_image(path)?;
            if json {
                console::print_json(&program_as_json(&program))?;
            } else {
                console::print(&text(&program));
            }
            return Ok(Verdict::Fine);
        }
        let mut words = self.hex.unwrap_or_default();
        if words.is_empty() {
            let text = read_text(std::io::stdin().lock()).context("stdin")?;
            words = text.split_whitespace().map(str::to_owned).collect();
        }
        let decoded: anyhow::Result<Vec<Instruction>> = words
            .iter()
            .enumerate()
            .map(|(at, word)| instruction(word).with_context(|| format!("word {at}")))
            .collect();
        let instructions = decoded?;
        if json {
            let instructions = instructions_as_json(&instructions);
            console::print_json(&json!({ "instructions": instructions }))?;
        } else {
            console::print(&listing(&instructions));
        }
        Ok(Verdict::Fine)
    }
}

/// One to sixteen hexadecimal digits, with or without 0x.
fn instruction(text: &str) -> anyhow::Result<Instruction> {
    let digits = text.strip_prefix("0x").unwrap_or(text);
    let is_word = (1..=16).contains(&digits.len()) && digits.bytes().all(|b| b.is_ascii_hexdigit());
    anyhow::ensure!(
        is_word,
        "found {text:?}; allowed: 1 to 16 hexadecimal digits"
    );
    Ok(Instruction::decode(u64::from_str_radix(digits, 16)?)?)
}
