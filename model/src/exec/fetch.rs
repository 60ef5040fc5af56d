//! Fetch: the codes of four corners, and where memory keeps them.

use super::position::Corners;
use crate::trace::Fetch;
use ntmu_isa::Asset;
use ntmu_isa::layout::Layout;

/// The codes of the four corners one after the other.
pub(super) fn codes(asset: &Asset, grid: usize, corners: &Corners, codes: &mut Vec<u8>) {
    codes.clear();
    for (column, row) in corners.cells() {
        codes.extend_from_slice(asset.cell(grid, column, row));
    }
}

pub(super) fn addresses(asset: &Asset, layout: Layout, grid: usize, corners: &Corners) -> Fetch {
    let shape = &asset.shape;
    let addresses = corners
        .cells()
        .map(|(column, row)| layout.address(shape, grid, column, row));
    Fetch {
        grid: grid as u8,
        addresses,
        cell_bytes: Layout::cell_bytes(shape, grid) as u32,
        planes: 1,
        plane_bytes: 0,
    }
}
