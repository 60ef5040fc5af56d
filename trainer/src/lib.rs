//! Makes assets: trains a texture set's grids and synthesizer, first in reals, then on isa's own
//! integers.
//!
//! ```text
//! Source ─► Texels ─► batch ─► sampler ─► network (real | integer) ─► error
//!              │                  ▲  │                                  │
//!           encoder ─► latents ───┘  └──────────── gradients ◄──────────┘
//! ```
//!
//! | module | answers |
//! |---|---|
//! | [`Source`], [`TrainConfig`], [`Preset`] | what goes in |
//! | `positions`, `sampler` | which inputs a texel has: isa's integer formulas, tabulated |
//! | `topology`, `network`, `tile`, `kernel` | the synthesizer, forward and backward |
//! | `integer`, `calibrate`, `export` | the integers that stand for it, and the asset |
//! | `latents`, `adam`, `batch`, `engine`, `refine` | a step on the whole set |
//! | `schedule`, `train`, `checkpoint`, `report` | the run |

mod adam;
mod batch;
mod calibrate;
mod checkpoint;
mod config;
mod crop;
mod encoder;
mod engine;
mod error;
mod evaluate;
mod export;
mod integer;
mod kernel;
mod latents;
mod model;
mod network;
mod positions;
mod preset;
mod random;
mod refine;
mod report;
mod sampler;
mod schedule;
mod source;
mod tile;
mod topology;
mod train;

pub use config::{ActivationKind, Address, GridConfig, Snap, Steps, TrainConfig};
pub use error::TrainError;
pub use preset::Preset;
pub use report::{Progress, StageReport, TrainReport, Trained};
pub use schedule::{EFFORTS, Stage};
pub use source::Source;
pub use train::train;

#[cfg(test)]
mod tests;
