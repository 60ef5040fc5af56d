//! Line size: which layout fetches how much with which cache line, the cache staying as large.

use super::bench::{self, Bench, middle_unit};
use super::{Counter, LabError, Sizes};
use ntmu_isa::Asset;
use ntmu_isa::layout::Layout;
use ntmu_model::time::Unit;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Lines tried, in bytes.
pub const LINES: [u32; 4] = [32, 64, 128, 256];

/// Layouts × lines, on two accesses.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LineStudy {
    /// The unit, before its line and its sets are changed.
    pub unit: String,
    /// Bytes of the latent cache, with every line.
    pub cache_bytes: u64,
    /// Lines, in bytes.
    pub lines: Vec<u32>,
    /// A grid of cells for each access.
    pub grids: Vec<LineGrid>,
}

/// One access.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LineGrid {
    /// The scene.
    pub scene: String,
    /// Layout after layout, line after line.
    pub cells: Vec<LineCell>,
}

/// One layout with one line.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LineCell {
    /// The order of the cells in memory, `tiles-4`.
    pub order: String,
    /// The storage's suffix: none, `+planar`, `+together`.
    pub storage: String,
    /// Bytes of a line.
    pub line_bytes: u32,
    /// Bytes of latents from memory for each pixel (of a scan: texel).
    pub bytes_per_pixel: f64,
    /// Cache hits over tag lookups, 0 to 1.
    pub hit_rate: f64,
    /// Cycles per 4×4 block.
    pub cycles_per_block: f64,
}

fn layouts(asset: &Asset) -> Vec<Layout> {
    let mut layouts = Layout::named();
    layouts.retain(|layout| layout.check(&asset.shape).is_ok());
    layouts
}

/// Runs of [`LineStudy::run`].
pub(super) fn runs(asset: &Asset) -> usize {
    2 * layouts(asset).len() * LINES.len()
}

/// The unit with another line and as many sets as keep its cache as large.
fn unit_of(unit: &Unit, line: u32) -> Result<Unit, LabError> {
    let sets = unit.cache_bytes() / u64::from(line * unit.cache_ways);
    let (line, sets) = (line.to_string(), sets.to_string());
    Ok(unit.with(&[("line_bytes", &line), ("cache_sets", &sets)])?)
}

impl LineStudy {
    /// Every named layout that suits the asset, with every line.
    pub(super) fn run(
        asset: &Asset,
        sizes: &Sizes,
        counter: &Counter<'_>,
    ) -> Result<LineStudy, LabError> {
        let accesses = bench::accesses(asset, sizes.sweep_pixels, sizes.grid_pixels)?;
        let unit = middle_unit();
        let units = LINES.map(|line| unit_of(&unit, line));
        let mut cases = Vec::new();
        for unit in units {
            let unit = unit?;
            cases.extend(
                layouts(asset)
                    .into_iter()
                    .map(|layout| (layout, unit.clone())),
            );
        }
        cases.sort_by_key(|(layout, _)| *layout);
        let grid = |bench: &Bench| -> Result<LineGrid, LabError> {
            let cell = |(layout, unit): &(Layout, Unit)| {
                let timing = bench.time(asset, *layout, unit)?;
                counter.one();
                Ok(LineCell {
                    order: layout.order.to_string(),
                    storage: layout.storage.suffix().to_owned(),
                    line_bytes: unit.line_bytes,
                    bytes_per_pixel: timing.latent_bytes as f64 / timing.pixels as f64,
                    hit_rate: timing.hit_rate,
                    cycles_per_block: timing.cycles_per_block,
                })
            };
            let cells: Result<Vec<LineCell>, LabError> = cases.par_iter().map(cell).collect();
            Ok(LineGrid {
                scene: bench.scene(),
                cells: cells?,
            })
        };
        let grids: Result<Vec<LineGrid>, LabError> =
            accesses.iter().map(|(_, bench)| grid(bench)).collect();
        Ok(LineStudy {
            unit: unit.identity(),
            cache_bytes: unit.cache_bytes(),
            lines: LINES.to_vec(),
            grids: grids?,
        })
    }
}
