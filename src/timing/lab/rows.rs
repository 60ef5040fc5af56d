//! Rows: units × layouts × accesses, each with its ledger and its bounds.

use super::bench::{self, Bench};
use super::{Counter, LabError, Sizes};
use ntmu_isa::Asset;
use ntmu_isa::layout::{Inside, Layout, Order, Side, Storage};
use ntmu_model::time::{Timing, Unit};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Cycles charged to one cause.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Charge {
    /// The cause, `compute`, `latent-miss`, …
    pub cause: String,
    /// Cycles of the unit.
    pub cycles: u64,
}

/// Bytes per 4×4 block that passed each level.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LevelBytes {
    /// Read from the latent cache.
    pub latent_cache: f64,
    /// Read from the second level; 0 where there is none.
    pub second_level: f64,
    /// Latents from memory, in whole bursts.
    pub memory: f64,
    /// Parameters from outside.
    pub weights: f64,
}

/// One unit with one layout on one access.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TimingRow {
    /// The unit's name.
    pub unit: String,
    /// The unit's name and hash.
    pub identity: String,
    /// The layout of the grids in memory.
    pub layout: String,
    /// `blocks` or `plane`.
    pub access: String,
    /// The access in full.
    pub scene: String,
    /// Pixels answered; of a scan, texels.
    pub pixels: u64,
    /// Texels decoded.
    pub texels: u64,
    /// Cycles from the first request to the last channel.
    pub cycles: u64,
    /// Cycles per 4×4 block of pixels: the mean.
    pub cycles_per_block: f64,
    /// Cycles between jobs, for 16 of their pixels: the median job.
    pub block_cycles_p50: f64,
    /// The same for the job that 99 of 100 are not slower than.
    pub block_cycles_p99: f64,
    /// The closed form's lower bound, per block.
    pub closed_form_per_block: f64,
    /// The longest path through all groups and jobs, no queue ever full, per block.
    pub critical_path_per_block: f64,
    /// Cycles per block of the same unit without a cache.
    pub without_cache_per_block: f64,
    /// Cycles per block of the same unit with an infinite cache.
    pub infinite_cache_per_block: f64,
    /// Bytes from memory per block, latents and parameters.
    pub bytes_per_block: f64,
    /// The same without a cache.
    pub bytes_per_block_without_cache: f64,
    /// The same with an infinite cache.
    pub bytes_per_block_infinite_cache: f64,
    /// Bytes by level.
    pub levels: LevelBytes,
    /// Cache hits over tag lookups, 0 to 1.
    pub hit_rate: f64,
    /// MACs done over MACs possible, 0 to 1.
    pub mac_utilisation: f64,
    /// At the unit's clock, in millions of pixels (of a scan, texels) per second.
    pub mtexels_per_second: f64,
    /// The resource that limits the unit.
    pub bottleneck: String,
    /// Where the cycles went; the sum is `cycles`.
    pub ledger: Vec<Charge>,
}

/// The layouts compared that suit the asset: rows, tiles, curves, and two other storages.
pub(super) fn layouts(asset: &Asset) -> Vec<Layout> {
    let whole = |order| Layout {
        order,
        storage: Storage::Interleaved,
    };
    let super_blocks = whole(Order::Super {
        side: Side::Four,
        inside: Inside::Morton,
    });
    let mut layouts = vec![
        Layout::LINEAR,
        Layout::TILED,
        whole(Order::Morton),
        super_blocks,
        Layout::TILED.with(Storage::Together),
        Layout::TILED.with(Storage::Planar),
    ];
    layouts.retain(|layout| layout.check(&asset.shape).is_ok());
    layouts
}

/// Runs every preset with several layouts on a scan and on a floor, the caches cold at the start, each
/// also without a cache and with an infinite one. `after_row` is called with the rows done, of
/// [`row_count`].
///
/// # Errors
/// When a scene does not fit the asset.
pub fn rows(
    asset: &Asset,
    sizes: &Sizes,
    after_row: impl Fn(u64) + Sync,
) -> Result<Vec<TimingRow>, LabError> {
    let counter = Counter::new(&after_row);
    let accesses = bench::full_accesses(asset, sizes)?;
    let units = Unit::presets();
    let layouts = layouts(asset);
    let mut cases = Vec::new();
    for (access, bench) in &accesses {
        for unit in &units {
            cases.extend(layouts.iter().map(|&layout| (*access, bench, unit, layout)));
        }
    }
    let row = |&(access, bench, unit, layout): &(&str, &Bench, &Unit, Layout)| {
        let row = row(asset, access, bench, unit, layout);
        counter.one();
        row
    };
    cases.par_iter().map(row).collect()
}

/// Rows of [`rows`].
#[must_use]
pub fn row_count(asset: &Asset) -> u64 {
    (2 * Unit::presets().len() * layouts(asset).len()) as u64
}

fn row(
    asset: &Asset,
    access: &str,
    bench: &Bench,
    unit: &Unit,
    layout: Layout,
) -> Result<TimingRow, LabError> {
    let run = |unit: &Unit| bench.time(asset, layout, unit);
    let without = run(&unit.without_cache())?;
    let infinite = run(&unit.with_infinite_cache())?;
    let timing = run(unit)?;
    let blocks = timing.blocks;
    let operations = &timing.operations;
    Ok(TimingRow {
        unit: unit.name().to_owned(),
        identity: unit.identity(),
        layout: layout.to_string(),
        access: access.to_owned(),
        scene: bench.scene(),
        pixels: timing.pixels,
        texels: timing.decodes,
        cycles: timing.cycles,
        cycles_per_block: timing.cycles_per_block,
        block_cycles_p50: timing.block_cycles_p50,
        block_cycles_p99: timing.block_cycles_p99,
        closed_form_per_block: timing.closed_form.cycles as f64 / blocks,
        critical_path_per_block: timing.closed_form.critical_path as f64 / blocks,
        without_cache_per_block: without.cycles_per_block,
        infinite_cache_per_block: infinite.cycles_per_block,
        bytes_per_block: timing.bytes_per_block,
        bytes_per_block_without_cache: without.bytes_per_block,
        bytes_per_block_infinite_cache: infinite.bytes_per_block,
        levels: LevelBytes {
            latent_cache: operations.l1_read_bytes as f64 / blocks,
            second_level: operations.l2_read_bytes as f64 / blocks,
            memory: operations.memory_bytes as f64 / blocks,
            weights: operations.weight_fill_bytes as f64 / blocks,
        },
        hit_rate: timing.hit_rate,
        mac_utilisation: timing.mac_utilisation,
        mtexels_per_second: timing.megapixels_per_second,
        bottleneck: timing.bottleneck.name().to_owned(),
        ledger: ledger(&timing),
    })
}

fn ledger(timing: &Timing) -> Vec<Charge> {
    let entries = timing.ledger.entries();
    let charge = |(cause, cycles): (ntmu_model::time::Cause, u64)| Charge {
        cause: cause.name().to_owned(),
        cycles,
    };
    entries.map(charge).collect()
}
