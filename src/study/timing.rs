//! The units' cycles for the whole chain of an asset.

use ntmu_isa::layout::Layout;
use ntmu_isa::{Asset, Program};
use ntmu_model::time::{self, Unit};
use ntmu_model::{Demand, Material, Place, Request};
use rayon::prelude::*;
use serde::Serialize;
use std::sync::atomic::{AtomicU64, Ordering};

/// Cycles charged to one cause.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Charge {
    /// The cause, `compute`, `latent-miss`, …
    pub cause: String,
    /// Cycles of the unit.
    pub cycles: u64,
}

/// One unit with one layout, over every texel of every mip in texel-block order.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TimingRow {
    /// The unit's name.
    pub unit: String,
    /// The layout of the grids in memory.
    pub layout: String,
    /// Texels decoded.
    pub texels: u64,
    /// Cycles from the first request to the last channel.
    pub cycles: u64,
    /// Cycles per 4×4 texel block.
    pub cycles_per_block: f64,
    /// The closed form's lower bound, per block.
    pub closed_form_per_block: f64,
    /// Bytes from memory per block.
    pub bytes_per_block: f64,
    /// Cache hits over tag lookups, 0 to 1.
    pub hit_rate: f64,
    /// MACs done over MACs possible, 0 to 1.
    pub mac_utilisation: f64,
    /// At the unit's clock, in millions of texels per second.
    pub mtexels_per_second: f64,
    /// The resource that limits the unit.
    pub bottleneck: String,
    /// Where the cycles went; the sum is `cycles`.
    pub ledger: Vec<Charge>,
}

/// The layouts that the study compares.
const LAYOUTS: [Layout; 2] = [Layout::LINEAR, Layout::TILED];

/// Runs every preset with either layout, `linear` and `tiles-4`, on every texel of every mip, mip after
/// mip in texel-block order, the cache cold at the start. `after_point` is called with the runs done.
#[must_use]
pub fn simulate(asset: &Asset, after_point: impl Fn(u64) + Sync) -> Vec<TimingRow> {
    let mips = 0..asset.shape.mip_count;
    let requests: Vec<Request> = mips
        .flat_map(|mip| Request::blocks(&asset.shape, mip))
        .collect();
    let runs: Vec<(Unit, Layout)> = Unit::presets()
        .into_iter()
        .flat_map(|unit| LAYOUTS.map(|layout| (unit.clone(), layout)))
        .collect();
    let done = AtomicU64::new(0);
    runs.par_iter()
        .map(|(unit, layout)| {
            let row = simulate_one(asset, unit, *layout, &requests);
            after_point(done.fetch_add(1, Ordering::Relaxed) + 1);
            row
        })
        .collect()
}

/// Runs of [`simulate`].
#[must_use]
pub fn timing_points() -> u64 {
    (Unit::presets().len() * LAYOUTS.len()) as u64
}

fn simulate_one(asset: &Asset, unit: &Unit, layout: Layout, requests: &[Request]) -> TimingRow {
    let program = Program::compile(asset, layout);
    let materials = [Material::new(&asset.metadata.name, asset, &program)];
    let mut demands = requests.iter().map(|&request| Demand {
        places: vec![Place::of(request)],
        weights: 1,
        ..Demand::default()
    });
    let run = time::simulate(unit, &materials, &mut demands, &mut ());
    let timing = run.unwrap_or_else(|never| match never {});
    let blocks = timing.blocks;
    TimingRow {
        unit: unit.name().to_owned(),
        layout: layout.to_string(),
        texels: timing.decodes,
        cycles: timing.cycles,
        cycles_per_block: timing.cycles_per_block,
        closed_form_per_block: timing.closed_form.cycles as f64 / blocks,
        bytes_per_block: timing.bytes_per_block,
        hit_rate: timing.hit_rate,
        mac_utilisation: timing.mac_utilisation,
        mtexels_per_second: timing.megapixels_per_second,
        bottleneck: timing.bottleneck.name().to_owned(),
        ledger: timing
            .ledger
            .entries()
            .map(|(cause, cycles)| Charge {
                cause: cause.name().to_owned(),
                cycles,
            })
            .collect(),
    }
}
