//! Fetch: the codes of four corners, read from memory where the program's layout keeps them.

use super::position::Corners;
use crate::trace::Fetch;
use ntmu_isa::layout::Layout;
use ntmu_isa::shape::Shape;
use ntmu_isa::{Asset, Program};

/// The memory that a unit fetches from: the grids of an asset, laid out for a program.
pub(super) struct Memory<'a> {
    shape: &'a Shape,
    layout: Layout,
    image: Vec<u8>,
}

impl<'a> Memory<'a> {
    pub(super) fn new(asset: &'a Asset, program: &Program) -> Memory<'a> {
        let (shape, layout) = (&asset.shape, program.layout());
        let [grid0, grid1] = &asset.grids;
        Memory {
            shape,
            layout,
            image: layout.pack(shape, [grid0, grid1]),
        }
    }

    /// The codes of the four corners one after the other.
    pub(super) fn codes(&self, grid: usize, corners: &Corners, codes: &mut Vec<u8>) {
        codes.clear();
        for (x, y) in corners.cells() {
            let cell = (corners.level, x, y);
            self.layout.cell(self.shape, &self.image, grid, cell, codes);
        }
    }

    /// The bytes that hold them.
    pub(super) fn addresses(&self, grid: usize, corners: &Corners) -> Fetch {
        addresses(self.shape, self.layout, grid, corners)
    }
}

/// Where memory keeps the codes of four corners.
pub(super) fn addresses(shape: &Shape, layout: Layout, grid: usize, corners: &Corners) -> Fetch {
    let level = corners.level;
    let address = |(x, y)| layout.address(shape, grid, level, x, y);
    Fetch {
        grid: grid as u8,
        addresses: corners.cells().map(address),
        cell_bytes: layout.cell_bytes(shape, grid) as u32,
        planes: layout.planes(shape, grid),
        plane_bytes: layout.plane_bytes(shape, grid, level),
    }
}
