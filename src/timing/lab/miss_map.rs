//! Miss map: where on the screen lines are missed.

use super::bench::{Bench, Scene, TILE, middle_unit};
use super::{Counter, LabError, Sizes};
use ntmu_isa::Asset;
use ntmu_isa::layout::Layout;
use ntmu_model::time::Watch;
use serde::{Deserialize, Serialize};

/// Lookups and misses of a screen's cells, each one tile of the raster.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct MissMap {
    /// The unit.
    pub unit: String,
    /// The scene.
    pub scene: String,
    /// The layout.
    pub layout: String,
    /// Pixels along the side of a cell.
    pub cell_pixels: u32,
    /// Cells along a row of the screen.
    pub columns: u32,
    /// Rows of cells.
    pub rows: u32,
    /// Lines looked up for the pixels of each cell, row after row.
    pub lookups: Vec<u64>,
    /// Those that had to be asked for.
    pub misses: Vec<u64>,
}

impl Watch for MissMap {
    fn lookup(&mut self, [x, y]: [u32; 2], lines: u32, misses: u32) {
        let (column, row) = (x / self.cell_pixels, y / self.cell_pixels);
        let cell = row as usize * self.columns as usize + column as usize;
        self.lookups[cell] += u64::from(lines);
        self.misses[cell] += u64::from(misses);
    }
}

impl MissMap {
    /// The floor on the middle unit.
    pub(super) fn run(
        asset: &Asset,
        sizes: &Sizes,
        counter: &Counter<'_>,
    ) -> Result<MissMap, LabError> {
        let (unit, layout) = (middle_unit(), Layout::TILED);
        let bench = Bench::new(asset, Scene::tiled_plane(asset, sizes.screen_pixels))?;
        let side = sizes.screen_pixels.div_ceil(TILE);
        let cells = side as usize * side as usize;
        let mut map = MissMap {
            unit: unit.identity(),
            scene: bench.scene(),
            layout: layout.to_string(),
            cell_pixels: TILE,
            columns: side,
            rows: side,
            lookups: vec![0; cells],
            misses: vec![0; cells],
        };
        bench.watch(asset, layout, &unit, &mut map)?;
        counter.one();
        Ok(map)
    }
}
