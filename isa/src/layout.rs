//! Layout: where a unit's memory keeps the grids.
//!
//! A cell is stored whole: its channels' codes one after the other, from the least significant bit,
//! padded to a byte. Grid 0 comes first, grid 1 follows at the next multiple of [`BASE_ALIGNMENT`].

use crate::shape::Shape;

/// Alignment of a grid's first byte: the largest cache line that a unit may have.
pub const BASE_ALIGNMENT: u64 = 256;

/// The order of the cells in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Layout {
    /// Row after row.
    Linear,
    /// Tiles of 4×4 cells, row after row of tiles; Morton order inside a tile, x in the lower bit.
    /// The grid is padded to whole tiles.
    Tiled,
}

/// Cells along the side of a tile.
const TILE: u32 = 4;

impl Layout {
    /// Every layout, in the order of its code in a program.
    pub const ALL: [Layout; 2] = [Layout::Linear, Layout::Tiled];

    /// The name in tables, assembly and JSON.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Layout::Linear => "linear",
            Layout::Tiled => "tiled",
        }
    }

    /// Bytes of one cell of a grid.
    #[must_use]
    pub const fn cell_bytes(shape: &Shape, grid: usize) -> u64 {
        let g = shape.grids[grid];
        (g.channels as u64 * g.format.bits() as u64).div_ceil(8)
    }

    /// Bytes of a grid, padding included.
    #[must_use]
    pub const fn grid_bytes(self, shape: &Shape, grid: usize) -> u64 {
        let (width, height) = shape.grid_size(grid);
        let cells = match self {
            Layout::Linear => width as u64 * height as u64,
            Layout::Tiled => {
                width.next_multiple_of(TILE) as u64 * height.next_multiple_of(TILE) as u64
            }
        };
        cells * Layout::cell_bytes(shape, grid)
    }

    /// The address of a grid's first byte.
    #[must_use]
    pub const fn base(self, shape: &Shape, grid: usize) -> u64 {
        if grid == 0 {
            0
        } else {
            self.grid_bytes(shape, 0).next_multiple_of(BASE_ALIGNMENT)
        }
    }

    /// Bytes of both grids in memory.
    #[must_use]
    pub const fn total_bytes(self, shape: &Shape) -> u64 {
        self.base(shape, 1) + self.grid_bytes(shape, 1)
    }

    /// The address of a cell's first byte. The cell lies within the grid.
    #[must_use]
    pub const fn address(self, shape: &Shape, grid: usize, x: u32, y: u32) -> u64 {
        let (width, _) = shape.grid_size(grid);
        let index = match self {
            Layout::Linear => y as u64 * width as u64 + x as u64,
            Layout::Tiled => {
                let tiles = width.div_ceil(TILE) as u64;
                let tile = (y / TILE) as u64 * tiles + (x / TILE) as u64;
                let inside = (x & 1) | (y & 1) << 1 | (x & 2) << 1 | (y & 2) << 2;
                tile * (TILE * TILE) as u64 + inside as u64
            }
        };
        self.base(shape, grid) + index * Layout::cell_bytes(shape, grid)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::embed::Wave;
    use crate::latent::LatentFormat;
    use crate::position::{AddressMode, CornerSnap};
    use crate::shape::{GridShape, OutputFormat, Sampling};
    use std::collections::BTreeSet;

    #[test]
    fn every_cell_has_bytes_of_its_own_within_the_total() {
        let grid = |channels, bits| GridShape {
            channels,
            format: LatentFormat::new(bits).unwrap(),
            scale_log2: 3,
            sampling: Sampling::Corners,
        };
        let shape = Shape {
            width: 100,
            height: 52,
            mip_count: 1,
            octaves: 3,
            wave: Wave::Triangle,
            padding: 0,
            input_bits: 8,
            snap: CornerSnap::Cell,
            address_mode: AddressMode::Wrap,
            grids: [grid(5, 3), grid(12, 4)],
            outputs: vec![OutputFormat::Unorm8],
        };
        for layout in Layout::ALL {
            let mut taken = BTreeSet::new();
            for g in 0..2 {
                let (width, height) = shape.grid_size(g);
                for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
                    let start = layout.address(&shape, g, x, y);
                    for byte in start..start + Layout::cell_bytes(&shape, g) {
                        assert!(taken.insert(byte), "{} g{g} {x},{y}", layout.name());
                        assert!(byte < layout.total_bytes(&shape));
                    }
                }
            }
        }
    }
}
