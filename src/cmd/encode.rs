//! `ntmu encode`: an asset from a texture set.

use std::path::PathBuf;

#[derive(clap::Args)]
pub(crate) struct Encode {
    /// The texture set: a folder of images, or a TOML manifest.
    #[arg(required_unless_present = "built_in", conflicts_with = "built_in")]
    source: Option<PathBuf>,
    /// Encode the built-in texture set, as the committed asset was.
    #[arg(long)]
    built_in: bool,
    /// The asset to write.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// The shape of grids and synthesizer, by name.
    #[arg(long, default_value = "default")]
    preset: String,
    /// A TOML file with fields of the training configuration that replace the preset's; the JSON
    /// result shows them all under `training.config`.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// How much work to spend: 0 to 100, or fastest, fast, medium, thorough, exhaustive.
    #[arg(long, default_value = "medium")]
    effort: String,
    /// The seed of every random choice: the same seed gives the same asset.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Continue from the checkpoint that an interrupted run left.
    #[arg(long)]
    resume: bool,
    /// Where the checkpoint is kept; beside the output, ending in .checkpoint, by default.
    #[arg(long, value_name = "FILE")]
    checkpoint: Option<PathBuf>,
    /// What computes the training steps in reals: flex (the processor), wgpu, vulkan or cuda.
    #[arg(long, default_value = "flex")]
    backend: String,
    /// Widths of the plain hidden layers instead of the preset's, `64,64`.
    #[arg(long, value_delimiter = ',', value_name = "WIDTHS")]
    hidden: Option<Vec<u16>>,
    /// Residual blocks instead of the preset's.
    #[arg(long, value_name = "COUNT")]
    blocks: Option<u8>,
    /// Channels of the two grids instead of the preset's, `8,16`.
    #[arg(long, value_delimiter = ',', num_args = 1, value_name = "CHANNELS")]
    grids: Option<Vec<u16>>,
    /// Bits of a latent instead of the preset's.
    #[arg(long, value_name = "BITS")]
    latent_bits: Option<u8>,
    /// The arithmetic of every layer: int8 or fp16.
    #[arg(long, value_name = "PRECISION")]
    precision: Option<String>,
    /// Bits of an activation instead of the preset's.
    #[arg(long, value_name = "BITS")]
    activation_bits: Option<u8>,
    /// Bits of a weight instead of the preset's.
    #[arg(long, value_name = "BITS")]
    weight_bits: Option<u8>,
}

#[cfg(not(feature = "train"))]
impl Encode {
    pub(crate) fn run(self, _json: bool) -> anyhow::Result<crate::Verdict> {
        let Encode {
            source,
            built_in,
            output,
            preset,
            effort,
            seed,
            ..
        } = self;
        let source = source
            .filter(|_| !built_in)
            .map(|path| path.display().to_string());
        anyhow::bail!(
            "this build has no trainer. It comes with\n  cargo run --release --features train -- \
             encode {} -o {} --preset {preset} --effort {effort} --seed {seed}",
            source.as_deref().unwrap_or("--built-in"),
            output.display()
        )
    }
}

#[cfg(feature = "train")]
mod training;
