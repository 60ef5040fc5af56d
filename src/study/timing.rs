//! The units' cycles, and the experiments on them.

use crate::timing::lab::{self, Lab, LabError, Sizes};
use ntmu_isa::Asset;

pub use crate::timing::lab::{Charge, LevelBytes, TimingRow};

/// Runs every preset with several layouts on a scan and on a floor; see [`lab::rows::rows`].
/// `after_point` is called with the rows done.
///
/// # Errors
/// When a scene does not fit the asset.
pub fn simulate(
    asset: &Asset,
    sizes: &Sizes,
    after_point: impl Fn(u64) + Sync,
) -> Result<Vec<TimingRow>, LabError> {
    lab::rows::rows(asset, sizes, after_point)
}

/// Rows of [`simulate`].
#[must_use]
pub fn timing_points(asset: &Asset) -> u64 {
    lab::rows::row_count(asset)
}

/// Makes the other experiments; see [`Lab::run`]. `after_run` is called with the runs done.
///
/// # Errors
/// When a scene, a unit or a control does not fit the asset.
pub fn experiment(
    asset: &Asset,
    sizes: &Sizes,
    after_run: impl Fn(u64) + Sync,
) -> Result<Lab, LabError> {
    Lab::run(asset, sizes, after_run)
}

/// Runs of [`experiment`].
#[must_use]
pub fn experiment_points(asset: &Asset) -> u64 {
    Lab::runs(asset)
}
