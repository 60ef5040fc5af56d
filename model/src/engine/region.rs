//! Region: the part of a grid that a mip reads.

use ntmu_isa::Asset;

/// The level of a grid that serves a mip.
#[derive(Clone, Copy, Debug)]
pub(super) struct Region {
    /// Cells along x and y.
    pub(super) size: [u32; 2],
    /// Latents of the grid before its own.
    pub(super) base: usize,
    /// The mip that lies in level 0 as the mip lies here.
    pub(super) mip: u8,
}

impl Region {
    pub(super) fn new(asset: &Asset, grid: usize, mip: u8) -> Region {
        let shape = &asset.shape;
        let level = shape.pyramid.level_of(mip);
        let (width, height) = shape.level_size(grid, level);
        Region {
            size: [width, height],
            base: shape.level_base(grid, level) as usize,
            mip: shape.pyramid.mip_in_level(mip),
        }
    }
}
