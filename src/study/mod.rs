//! Study: everything that the project can say about one asset, as data.
//!
//! `ntmu study` prints it, writes it as JSON, and draws it as a report.

mod claims;
mod engine;
mod in_between;
mod oracle;
mod sweep;
mod timing;
mod twin;
mod variants;
mod vectors;

pub use claims::try_claims;
pub use engine::{EngineStudy, compare_with_reference};
pub use in_between::{InBetween, in_between, in_between_points};
pub use ntmu_conformance::claims::Findings;
pub use oracle::{OracleStudy, compare_with_oracle};
pub use sweep::{SweepPoint, SweepStudyError, sweep, sweep_points};
pub use timing::{
    Charge, LevelBytes, TimingRow, experiment, experiment_points, simulate, timing_points,
};
pub use twin::{TwinStudy, compare_with_twin};
pub use variants::{Variant, VariantOutcome, Variants, variant_count, variants};
pub use vectors::vectors;

use crate::precision;
use crate::quality::{self, Quality};
use crate::timing::lab::Lab;
use ntmu_isa::Asset;
use serde::Serialize;

/// What is known of an asset before anything runs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AssetStudy {
    /// The set's name.
    pub name: String,
    /// Texels of mip 0 along x and y.
    pub size: (u32, u32),
    /// Mips in the chain.
    pub mips: u8,
    /// Channels of the set.
    pub channels: u16,
    /// Texels of the whole chain.
    pub texels: u64,
    /// Bits of a latent of grid 0 and of grid 1.
    pub latent_bits: [u8; 2],
    /// Widths of weights and activations, `w8a8`; see [`precision::of_asset`].
    pub precision: String,
    /// The profile's name and hash.
    pub profile: String,
    /// Multiplications per texel.
    pub macs_per_texel: u32,
    /// Bytes of both grids.
    pub grid_bytes: u64,
    /// Bytes of the synthesizer's parameters.
    pub parameter_bytes: u64,
    /// Bits per pixel and channel, parameters counted.
    pub bppc: f64,
}

impl AssetStudy {
    /// The facts of an asset.
    #[must_use]
    pub fn of(asset: &Asset) -> AssetStudy {
        let shape = &asset.shape;
        AssetStudy {
            name: asset.metadata.name.clone(),
            size: (shape.width, shape.height),
            mips: shape.mip_count,
            channels: shape.channel_count(),
            texels: shape.texel_count(),
            latent_bits: shape.grids.map(|grid| grid.format.bits()),
            precision: precision::of_asset(asset),
            profile: asset.profile.identity(),
            macs_per_texel: asset.macs(),
            grid_bytes: asset.grid_bits().div_ceil(8),
            parameter_bytes: asset.parameter_bits().div_ceil(8),
            bppc: quality::bppc(asset),
        }
    }
}

/// All results on one asset.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Study {
    /// What was studied.
    pub asset: AssetStudy,
    /// Against the source, where one was given.
    pub quality: Option<Quality>,
    /// Against the real-number truth.
    pub oracle: OracleStudy,
    /// The engine against the reference, at a sample of texels.
    pub engine: EngineStudy,
    /// The three claims, at the same texels.
    pub claims: Findings,
    /// Against the GPU twin.
    pub twin: TwinStudy,
    /// Per access, unit and layout.
    pub timing: Vec<TimingRow>,
    /// The experiments on the unit in time; none where none was made.
    pub lab: Option<Lab>,
    /// Per latent width and weight width; empty without a source.
    pub sweep: Vec<SweepPoint>,
    /// Between mips, per level of detail and way to decode; empty without a source.
    pub in_between: Vec<InBetween>,
    /// The asset in other numbers and under other profiles.
    pub variants: Variants,
}

impl Study {
    /// Whether every check held: the twin, if it ran, agreed on every code, the engine agreed with the
    /// reference, no code was farther
    /// from the oracle than the derived bound allows, and every claim is true of its sample.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.twin.holds() && self.oracle.holds() && self.engine.holds() && self.claims.hold()
    }
}
