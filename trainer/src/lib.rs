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
//! | `topology`, `network`, `epilogue`, `tile`, `kernel` | the synthesizer, forward and backward |
//! | `quantise`, `integer`, `half`, `calibrate` | the numbers of the decode that stand for it |
//! | `export` | the asset |
//! | `latents`, `adam`, `batch`, `engine`, `refine` | a step on the whole set |
//! | `encoder`, `convolution`, `crop` | CNTC's encoder, and a step on crops |
//! | `device`, `graph` | the steps in reals on a GPU, through burn |
//! | `schedule`, `train`, `checkpoint`, `report` | the run |

#![forbid(unsafe_code)]

mod adam;
mod batch;
mod calibrate;
mod check_config;
mod checkpoint;
mod choices;
mod config;
mod convolution;
mod crop;
mod device;
mod encoder;
mod encoder_pass;
mod engine;
mod epilogue;
mod error;
mod evaluate;
mod export;
mod graph;
mod half;
mod integer;
mod kernel;
mod latents;
mod model;
mod network;
mod positions;
mod preset;
mod quantise;
mod random;
mod refine;
mod report;
mod sampler;
mod schedule;
mod source;
mod tile;
mod topology;
mod train;

pub use choices::{ActivationKind, Address, GridSampling, Precision, Snap, WaveForm};
pub use config::{GridConfig, Steps, TrainConfig};
pub use device::{Backend, TrainingDevice};
pub use error::TrainError;
pub use preset::Preset;
pub use report::{Progress, StageReport, TrainReport, Trained};
pub use schedule::{EFFORTS, Stage};
pub use source::Source;
pub use train::train;

#[cfg(test)]
mod tests;
