//! `ntmu generate`: the built-in texture set as image files.

use crate::Verdict;
use crate::{console, files};
use ndarray::{Axis, Slice};
use ntmu::texture_set::{Depth, write_map};
use ntmu::{brick_wall, built_in};
use serde_json::json;
use std::path::PathBuf;

#[derive(clap::Args)]
pub(crate) struct Generate {
    /// The folder for the images.
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Texels along an axis, a power of two.
    #[arg(long, default_value_t = built_in::SIZE, value_parser = size)]
    size: u32,
    /// The seed of the wall.
    #[arg(long, default_value_t = built_in::SEED)]
    seed: u64,
}

fn size(text: &str) -> Result<u32, String> {
    match text.parse::<u32>() {
        Ok(size) if size.is_power_of_two() && (64..=4096).contains(&size) => Ok(size),
        Ok(_) | Err(_) => Err(format!(
            "found {text:?}; allowed: a power of two in 64..=4096"
        )),
    }
}

impl Generate {
    pub(crate) fn run(self, json: bool) -> anyhow::Result<Verdict> {
        let set = brick_wall::generate(self.size, self.seed);
        files::make_folder(&self.output)?;
        let mut written = Vec::new();
        for map in &set.maps {
            let path = self.output.join(format!("{}.png", map.name));
            write_map(
                &path,
                &set.texels[0].slice_axis(Axis(0), Slice::from(map.channels())),
                Depth::Eight,
            )?;
            written.push(path);
        }
        if json {
            console::print_json(&json!({ "written": written }))?;
        } else {
            let paths: Vec<String> = written.iter().map(|p| p.display().to_string()).collect();
            console::print(&paths.join("\n"));
        }
        Ok(Verdict::Fine)
    }
}
