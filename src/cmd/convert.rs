//! `ntmu convert`: an asset in other numbers.

use super::profile::ProfileChoice;
use crate::Verdict;
use crate::{console, files};
use anyhow::Context as _;
use ntmu::precision;
use ntmu::quality;
use serde_json::json;
use std::path::PathBuf;

/// The asset is rounded, not trained again: what it loses is an upper bound on what the numbers
/// cost.
#[derive(clap::Args)]
pub(crate) struct Convert {
    /// The asset, an .ntx file.
    asset: PathBuf,
    /// The asset to write.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Bits of a latent, at most the asset's own.
    #[arg(long, value_name = "BITS")]
    latent_bits: Option<u8>,
    /// Bits of a weight of integer layers, at most the asset's own.
    #[arg(long, value_name = "BITS")]
    weight_bits: Option<u8>,
    /// Bits of inputs and activations of integer layers, 4 to 16.
    #[arg(long, value_name = "BITS")]
    activation_bits: Option<u8>,
    /// Turn integer layers into fp16 layers.
    #[arg(long, conflicts_with_all = ["weight_bits", "activation_bits"])]
    fp16: bool,
    #[command(flatten)]
    profile: ProfileChoice,
}

impl Convert {
    pub(crate) fn run(self, json: bool) -> anyhow::Result<Verdict> {
        let asset = self.profile.apply(files::read_asset(&self.asset)?)?;
        let mut converted = asset.clone();
        if self.latent_bits.is_some() || self.weight_bits.is_some() {
            let widest = asset.shape.grids.map(|grid| grid.format.bits());
            let latents = self.latent_bits.unwrap_or(widest[0].min(widest[1]));
            let weights = self.weight_bits.unwrap_or(precision::weight_bits(&asset));
            converted = precision::narrow(&converted, latents, weights).context("convert")?;
        }
        if let Some(bits) = self.activation_bits {
            converted = precision::with_activations(&converted, bits).context("convert")?;
        }
        if self.fp16 {
            converted = precision::in_halves(&converted).context("convert")?;
        }
        files::write(&self.output, &converted.to_bytes())?;
        let output = self.output.display().to_string();
        if json {
            console::print_json(&json!({
                "output": output, "from": precision::of_asset(&asset),
                "to": precision::of_asset(&converted), "profile": converted.profile.identity(),
                "bppc": quality::bppc(&converted),
            }))?;
        } else {
            console::print(&format!(
                "{output}: {} instead of {}, profile {}, {:.4} bits per pixel and channel",
                precision::of_asset(&converted),
                precision::of_asset(&asset),
                converted.profile.identity(),
                quality::bppc(&converted)
            ));
        }
        Ok(Verdict::Fine)
    }
}
