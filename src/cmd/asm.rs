//! `ntmu asm`: assembly becomes a program image.

use super::microprogram::read_assembly;
use crate::Verdict;
use crate::{console, files};
use anyhow::Context as _;
use ntmu::isa::{Program, image};
use serde_json::json;
use std::path::PathBuf;

/// Words are checked one by one; with an asset also whether they fit together, and it.
#[derive(clap::Args)]
pub(crate) struct Asm {
    /// The assembly.
    input: PathBuf,
    /// The program image to write, an .ntp file.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Also check the program against this asset, an .ntx file.
    #[arg(long, value_name = "FILE")]
    asset: Option<PathBuf>,
}

impl Asm {
    pub(crate) fn run(self, json: bool) -> anyhow::Result<Verdict> {
        let program = read_assembly(&self.input)?;
        let bytes = image::write(program.layout, &program.instructions);
        let words = program.instructions.len();
        if let Some(path) = &self.asset {
            let asset = files::read_asset(path)?;
            Program::link(&asset, program.layout, program.instructions)
                .with_context(|| self.input.display().to_string())?;
        }
        files::write(&self.output, &bytes)?;
        let (layout, asset) = (program.layout.to_string(), &self.asset);
        if json {
            console::print_json(&json!({
                "written": self.output, "layout": layout, "words": words, "linked_to": asset,
            }))?;
        } else {
            let linked = asset
                .as_ref()
                .map_or(String::new(), |asset| format!(", fits {}", asset.display()));
            let path = self.output.display();
            console::print(&format!("{path}: {words} words, layout {layout}{linked}"));
        }
        Ok(Verdict::Fine)
    }
}
