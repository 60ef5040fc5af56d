//! What a run tells while it works and when it is done.

use crate::config::TrainConfig;
use crate::device::Backend;
use crate::settle::Round;
use crate::stage::{Rates, Stage};
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
    /// Steps of all stages. They cost about the same in every stage but those of an encoder, where
    /// one costs far more.
    pub total: u64,
    /// The mean squared error of the batches, each map's times its weight, smoothed over about a
    /// hundred steps. A batch is richer in coarse mips than the set.
    pub loss: f64,
    /// The same in decibels against a peak of 1.
    pub psnr: f64,
    /// Decibels of the asset over every texel of every mip and channel, where this step measured
    /// them.
    pub deployed_psnr: Option<f64>,
    /// The learning rates of the last step.
    pub rates: Rates,
    /// Seconds since the run began, those of the processes that it was resumed from included.
    pub seconds: f64,
}

/// What listens to a run. A closure over [`Progress`] does.
pub trait Watch {
    /// Hears of every twentieth step, of the last of each stage, and of those at which the asset's
    /// quality was measured.
    fn observe(&mut self, progress: &Progress);

    /// Hears of every round in which latents settled, after the last stage.
    fn settled(&mut self, _round: &Round) {}

    /// Whether [`Watch::asset`] should be called now. Nothing that the run makes depends on it.
    fn wants_asset(&mut self) -> bool {
        false
    }

    /// Takes the asset as it would be if the run ended here.
    fn asset(&mut self, _progress: &Progress, _asset: &Asset) {}
}

impl<F: FnMut(&Progress) + ?Sized> Watch for F {
    fn observe(&mut self, progress: &Progress) {
        self(progress);
    }
}

/// One stage of a finished run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StageReport {
    /// Its name.
    pub name: String,
    /// The stage.
    #[serde(flatten)]
    pub stage: Stage,
    /// Seconds spent in it by this process, evaluation included: less than all where the run was
    /// resumed.
    pub seconds: f64,
}

/// What a finished run says about itself.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrainReport {
    /// Decibels over every texel of every mip and channel (the paper's measure) of the asset's
    /// network in reals: its parameters before they are rounded, the same latents, outputs rounded to
    /// the set's codes. Here and below, a texel that is masked out does not count.
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
    /// Steps of each stage of the plan, 0 for one that the set is too small for.
    pub steps: Vec<u64>,
    /// The rounds in which latents settled afterwards; their decibels count maps as the loss does.
    pub settled: Vec<Round>,
    /// Whether the asset reached [`TrainConfig::target_psnr`].
    pub reached: Option<bool>,
    /// The seed.
    pub seed: u64,
    /// What computed the stages in reals, at the end of the run.
    pub backend: Backend,
    /// Its adapter; the processor has none.
    pub adapter: Option<String>,
    /// Seconds of the run, those of the processes that it was resumed from included.
    pub seconds: f64,
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
