//! Lab: experiments on the unit in time, for one asset, as data.
//!
//! | module | asks |
//! |---|---|
//! | [`rows`] | units × layouts × accesses: cycles, their causes, and bounds |
//! | [`fifo`] | how deep the corner FIFO has to be to hide a latency |
//! | [`line_size`] | which layout fetches least with which cache line |
//! | [`working_set`] | how large the cache has to be |
//! | [`divergence`] | what materials that take turns cost |
//! | [`roofline`](mod@roofline) | whether the array or the bytes set the pace |
//! | [`energy`] | where the energy of a published table goes |
//! | [`miss_map`](mod@miss_map) | where on the screen lines are missed |
//!
//! Every result says its unit, its layout and its scene, and is plain data that can be written and
//! read back. Runs are independent and go in parallel; their results do not depend on how many at once.

pub mod divergence;
pub mod energy;
pub mod fifo;
pub mod line_size;
pub mod miss_map;
pub mod roofline;
pub mod rows;
pub mod working_set;

mod bench;
#[cfg(test)]
mod tests;

pub use divergence::Divergence;
pub use energy::EnergyStudy;
pub use fifo::FifoStudy;
pub use line_size::LineStudy;
pub use miss_map::MissMap;
pub use roofline::Roofline;
pub use rows::{Charge, LevelBytes, TimingRow};
pub use working_set::WorkingSet;

use ntmu_isa::Asset;
use ntmu_isa::sampler::SamplerError;
use ntmu_model::control::ControlError;
use ntmu_model::stream::StreamError;
use ntmu_model::time::UnitError;
use ntmu_model::time::energy::EnergyError;
use serde::{Deserialize, Serialize};
use std::sync::atomic::{AtomicU64, Ordering};

/// The sizes of the scenes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sizes {
    /// A scan is of the first mip that is at most so many texels along either side.
    pub scan_texels: u32,
    /// Pixels along the side of the screen of [`rows`] and of the map of misses; even.
    pub screen_pixels: u32,
    /// Pixels along the side of the screen of the experiments with many runs; even. Their scans are of
    /// the first mip that is at most so many texels along either side.
    pub sweep_pixels: u32,
    /// Pixels along the side of the screen of [`line_size`], which has most runs; even.
    pub grid_pixels: u32,
}

impl Sizes {
    /// Those of `ntmu study`.
    pub const STUDY: Sizes = Sizes {
        scan_texels: 512,
        screen_pixels: 384,
        sweep_pixels: 256,
        grid_pixels: 128,
    };

    /// Small ones, for trying things out: what they find says more about the start of a run.
    pub const QUICK: Sizes = Sizes {
        scan_texels: 64,
        screen_pixels: 64,
        sweep_pixels: 32,
        grid_pixels: 32,
    };
}

/// Why an experiment cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum LabError {
    /// There is no such scene.
    #[error("scene: {0}")]
    Stream(#[from] StreamError),
    /// The sampler does not fit the asset.
    #[error("sampler: {0}")]
    Sampler(#[from] SamplerError),
    /// There is no such unit.
    #[error("unit: {0}")]
    Unit(#[from] UnitError),
    /// The asset has no such control.
    #[error("control: {0}")]
    Control(#[from] ControlError),
    /// The table of energies cannot be read.
    #[error("energy: {0}")]
    Energy(#[from] EnergyError),
}

/// Everything but the rows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Lab {
    /// Relative performance by depth of the corner FIFO.
    pub fifo: FifoStudy,
    /// Bytes from memory by layout and line.
    pub line_size: LineStudy,
    /// Bytes from memory by size of the cache.
    pub working_set: WorkingSet,
    /// Cycles by number of materials.
    pub divergence: Divergence,
    /// Multiplications per cycle by multiplications per byte.
    pub roofline: Roofline,
    /// Energy by where it goes.
    pub energy: EnergyStudy,
    /// Misses by place on the screen.
    pub miss_map: MissMap,
}

/// Runs that are done, for whoever waits for them.
pub(crate) struct Counter<'a> {
    done: AtomicU64,
    after_run: &'a (dyn Fn(u64) + Sync),
}

impl<'a> Counter<'a> {
    pub(crate) fn new(after_run: &'a (dyn Fn(u64) + Sync)) -> Counter<'a> {
        Counter {
            done: AtomicU64::new(0),
            after_run,
        }
    }

    /// One more.
    fn one(&self) {
        (self.after_run)(self.done.fetch_add(1, Ordering::Relaxed) + 1);
    }
}

impl Lab {
    /// Makes every experiment. `after_run` is called with the runs done, of [`Lab::runs`].
    ///
    /// # Errors
    /// When a scene, a unit or a control does not fit the asset.
    pub fn run(
        asset: &Asset,
        sizes: &Sizes,
        after_run: impl Fn(u64) + Sync,
    ) -> Result<Lab, LabError> {
        let counter = Counter::new(&after_run);
        Ok(Lab {
            fifo: FifoStudy::run(asset, sizes, &counter)?,
            line_size: LineStudy::run(asset, sizes, &counter)?,
            working_set: WorkingSet::run(asset, sizes, &counter)?,
            divergence: Divergence::run(asset, sizes, &counter)?,
            roofline: Roofline::run(asset, sizes, &counter)?,
            energy: EnergyStudy::run(asset, sizes, &counter)?,
            miss_map: MissMap::run(asset, sizes, &counter)?,
        })
    }

    /// Runs of [`Lab::run`].
    #[must_use]
    pub fn runs(asset: &Asset) -> u64 {
        let runs = fifo::runs()
            + line_size::runs(asset)
            + working_set::runs()
            + divergence::runs()
            + roofline::runs(asset)
            + energy::runs()
            + 1;
        runs as u64
    }
}
