//! `ntmu encode`: an asset from a texture set.

mod amounts;

pub(crate) use amounts::weight;

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
    /// What to train, stage after stage, instead of what follows from the effort: paper,
    /// paper-short, direct, encoder-first, ntc, or a TOML file.
    #[arg(long, value_name = "PLAN", conflicts_with = "effort")]
    plan: Option<String>,
    /// Steps of each stage of the plan, `0+3000+1000`: those in the record of an asset repeat its
    /// run.
    #[arg(long, value_name = "STEPS", conflicts_with = "time")]
    steps: Option<String>,
    /// Rounds in which latents settle when training is over. By default as many as suit the effort or
    /// the time and still bring something, none after a plan.
    #[arg(long, value_name = "ROUNDS")]
    settle: Option<u32>,
    /// Train the latents directly in the plan's encoder stages, for as many steps.
    #[arg(long)]
    no_encoder: bool,
    /// All learning rates, times this; a run that diverged can be resumed with less than 1.
    #[arg(long, value_name = "FACTOR")]
    rate_factor: Option<f64>,
    /// How much a map's error counts in the loss, `normal=2`; 1 without it. Can be repeated.
    #[arg(long, value_name = "MAP=WEIGHT", value_parser = amounts::weight)]
    weight: Vec<(String, f64)>,
    /// Leave out texels that do not show, from loss and figures: those where this map (its last
    /// channel) or this image file (its alpha, or its colours) is zero.
    #[arg(long, value_name = "MAP")]
    mask: Option<String>,
    /// Scale the vectors of a map of normals to unit length in every mip before training. Can be
    /// repeated.
    #[arg(long, value_name = "MAP")]
    renormalise: Vec<String>,
    /// How long to train, `15m`: the steps are scaled to fit before the first, and recorded.
    #[arg(long, value_name = "TIME", value_parser = amounts::seconds)]
    time: Option<f64>,
    /// End as soon as the asset has this quality, in dB over all maps and mips; exit code 1 if it
    /// never does.
    #[arg(long, value_name = "DB")]
    target_psnr: Option<f64>,
    /// The largest asset to make, `300k`: grids get fewer channels, then bits, until it fits.
    #[arg(long, value_name = "BYTES", value_parser = amounts::bytes)]
    max_bytes: Option<u64>,
    /// A folder for the maps as they would decode now, written anew every so often.
    #[arg(long, value_name = "DIR")]
    preview: Option<PathBuf>,
    /// The time between two previews.
    #[arg(long, value_name = "TIME", value_parser = amounts::seconds, default_value = "30s")]
    preview_every: f64,
    /// Only the middle of a preview, this many texels along each axis.
    #[arg(long, value_name = "TEXELS", value_parser = clap::value_parser!(u32).range(1..))]
    preview_side: Option<u32>,
    /// A file with a line of JSON for every observation: stage, step, seconds, loss, dB, rates.
    #[arg(long, value_name = "FILE")]
    log: Option<PathBuf>,
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
    /// Which levels the grids have: single, ntc or every-mip.
    #[arg(long, value_name = "PYRAMID")]
    pyramid: Option<String>,
    /// Where the corners of mips coarser than the grids begin: at the cell, or at the stride.
    #[arg(long, value_name = "SNAP")]
    snap: Option<String>,
    /// What lies beyond the edge of a grid: wrap, mirror or clamp.
    #[arg(long, value_name = "ADDRESS")]
    address: Option<String>,
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
    /// Bits of a weight instead of the preset's; or of every layer's, first layer first, `8,4,4,8`.
    #[arg(long, value_delimiter = ',', num_args = 1, value_name = "BITS")]
    weight_bits: Option<Vec<u8>>,
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
mod curve;
#[cfg(feature = "train")]
mod log;
#[cfg(feature = "train")]
mod mask;
#[cfg(feature = "train")]
mod places;
#[cfg(feature = "train")]
mod preview;
#[cfg(feature = "train")]
mod progress;
#[cfg(feature = "train")]
mod resident;
#[cfg(feature = "train")]
mod result;
#[cfg(feature = "train")]
mod settings;
#[cfg(feature = "train")]
mod smaller;
#[cfg(feature = "train")]
mod training;
#[cfg(feature = "train")]
mod watcher;
