//! What a run tells while it works and when it is done.

use crate::config::{Steps, TrainConfig};
use crate::device::Backend;
use crate::schedule::Stage;
use ntmu_isa::Asset;
use serde::{Deserialize, Serialize};

/// Where a run is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// The stage.
    pub stage: Stage,
    /// Steps done in this stage.
    pub step: u64,
    /// Steps of this stage.
    pub stage_steps: u64,
    /// Steps done in all stages.
    pub done: u64,
    /// Steps of all stages. They cost about the same in the refinement and the integer stage; one
    /// of the encoder stage costs far more.
    pub total: u64,
    /// The mean squared error of the batches, smoothed over about a hundred steps. A batch is
    /// richer in coarse mips than the set.
    pub loss: f64,
    /// The same in decibels against a peak of 1.
    pub psnr: f64,
}

/// One stage of a finished run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StageReport {
    /// The stage.
    pub stage: Stage,
    /// Its steps.
    pub steps: u64,
    /// Seconds spent in it by this process, evaluation included: less than all where the run was
    /// resumed.
    pub seconds: f64,
}

/// What a finished run says about itself.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrainReport {
    /// Decibels over every texel of every mip and channel (the paper's measure) of the network in
    /// reals with rounded latents, as the refinement left it.
    pub psnr_float: f64,
    /// The same of the asset: the decode's own numbers throughout, codes compared with the source's
    /// reals.
    pub psnr_quantised: f64,
    /// Decibels of the asset for each channel of mip 0.
    pub psnr_channels: Vec<f64>,
    /// Decibels of the asset for each mip, over all channels.
    pub psnr_mips: Vec<f64>,
    /// Bits of grids and parameters per texel of mip 0 and channel.
    pub bits_per_texel_channel: f64,
    /// Multiplications per texel.
    pub macs: u64,
    /// Steps of each stage.
    pub steps: Steps,
    /// The seed.
    pub seed: u64,
    /// What computed the stages in reals, at the end of the run.
    pub backend: Backend,
    /// Its adapter; the processor has none.
    pub adapter: Option<String>,
    /// The stages that ran.
    pub stages: Vec<StageReport>,
    /// The configuration.
    pub config: TrainConfig,
}

/// A finished run.
#[derive(Clone, Debug)]
pub struct Trained {
    /// The compressed texture set.
    pub asset: Asset,
    /// What the run says about itself.
    pub report: TrainReport,
}
