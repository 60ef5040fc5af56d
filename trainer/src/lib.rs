//! Makes assets: trains a texture set's grids and synthesizer, first in reals, then on isa's own
//! numbers: integers, halves, or both.
//!
//! ```text
//! Source ─► Texels ─► batch ─► sampler ─► network (real | decode) ─► error
//!              │                  ▲  │                                 │
//!           encoder ─► latents ───┘  └──────────── gradients ◄─────────┘
//! ```
//!
//! | module | answers |
//! |---|---|
//! | [`Source`], [`TrainConfig`], [`Preset`] | what goes in |
//! | `positions`, `sampler` | which inputs a texel has: isa's integer formulas, tabulated |
//! | `encoder`, `convolution`, `constructor`, `crop` | latents from an encoder, level by level |
//! | `topology`, `network`, `epilogue`, `tile`, `kernel` | the synthesizer, forward and backward |
//! | `quantise`, `integer`, `half`, `calibrate` | the numbers of the decode that stand for it |
//! | `export` | the asset |
//! | `latents`, `adam`, `batch`, `engine`, `refine` | a step on the whole set |
//! | [`TrainingDevice`], `graph`, `stepper` | the steps in reals on a GPU, through burn |
//! | [`settle`], `import` | codes that move when training is over |
//! | [`Plan`], [`Stage`], `schedule` | what is trained, in which order, how fast |
//! | `train`, `run`, `budget`, `checkpoint`, `record`, `report` | the run |

#![forbid(unsafe_code)]

mod adam;
mod batch;
mod budget;
mod calibrate;
mod check_config;
mod checkpoint;
mod choices;
mod config;
mod constructor;
mod convolution;
mod crop;
mod descent;
mod device;
mod encoder;
mod encoder_pass;
mod engine;
mod epilogue;
mod equalise;
mod error;
mod evaluate;
mod export;
mod first_latents;
mod graph;
mod half;
mod import;
mod integer;
mod kernel;
mod latents;
mod memory;
mod model;
mod network;
mod plan;
mod positions;
mod preset;
mod quantise;
mod random;
mod record;
mod refine;
mod report;
mod run;
mod sampler;
mod schedule;
mod settle;
mod size;
mod source;
mod stage;
mod stepper;
mod texels;
mod tile;
mod topology;
mod train;

pub use choices::{
    ActivationKind, Address, FirstLatents, GridSampling, Optimiser, PYRAMIDS, Precision, Pyramid,
    Snap, WaveForm,
};
pub use config::{GridConfig, TrainConfig};
pub use device::{Backend, TrainingDevice};
pub use error::{Good, TrainError};
pub use memory::Memory;
pub use plan::{Arithmetic, Fall, Mips, Plan, RatesPlan, Shown, StagePlan, Train};
pub use preset::Preset;
pub use report::{Progress, StageReport, TrainReport, Trained, Watch};
pub use schedule::EFFORTS;
pub use settle::{Round, settle};
pub use size::asset_bytes;
pub use source::Source;
pub use stage::{Rates, Stage};
pub use train::{train, watched};

#[cfg(test)]
mod tests;
