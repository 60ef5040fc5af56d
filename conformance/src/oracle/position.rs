//! Where a texel lies in a grid, in reals.
//!
//! Paper, section "Grid sampler": the four surrounding voxels, at a stride of 2^(m−3) for m > 3.
//! DESIGN, "grid position": texel centres, `g = (texel + ½)·2^mip / 2^scale − ½`.

use ntmu_isa::position::{AddressMode, CornerSnap};
use ntmu_isa::pyramid::Pyramid;
use ntmu_isa::shape::Shape;

/// A level of a pyramid: a grid of its own, of a coarser scale.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RealLevel {
    /// 0 for the largest.
    pub level: u8,
    /// Halvings between level 0 and this one.
    pub halvings: u8,
}

impl RealLevel {
    /// The level that serves a mip: level 0 the first mips, every further one the next few.
    #[must_use]
    pub fn of(pyramid: Pyramid, mip: u8) -> RealLevel {
        let (mut level, mut served) = (0, pyramid.first());
        // Of a single level nothing is counted: it serves them all.
        while pyramid.each() > 0 && mip >= served {
            level += 1;
            served += pyramid.each();
        }
        RealLevel {
            level,
            halvings: level * pyramid.each(),
        }
    }

    /// log2 of mip 0's resolution over that of the level of a grid.
    #[must_use]
    pub fn scale_log2(self, shape: &Shape, grid: usize) -> u8 {
        shape.grids[grid].scale_log2 + self.halvings
    }

    /// Cells along x and y of the level of a grid: as many as cover mip 0.
    #[must_use]
    pub fn cells(self, shape: &Shape, grid: usize) -> [u32; 2] {
        let cell_size = 2_f64.powi(i32::from(self.scale_log2(shape, grid)));
        [shape.width, shape.height].map(|texels| (f64::from(texels) / cell_size).ceil() as u32)
    }

    /// Cells of a grid before those of the level.
    #[must_use]
    pub fn base(self, shape: &Shape, grid: usize) -> usize {
        let before = (0..self.level).map(|level| RealLevel {
            level,
            halvings: level * shape.pyramid.each(),
        });
        before
            .map(|level| level.cells(shape, grid).map(|cells| cells as usize))
            .map(|[x, y]| x * y)
            .sum()
    }
}

/// One axis of the square of corners around a texel centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RealAxis {
    /// The first corner, in cells; may lie outside the grid.
    pub first: f64,
    /// From the first to the second corner, in cells.
    pub stride: f64,
    /// From the first (0) towards the second corner (1): a whole number of sixteenths below 1.
    ///
    /// That it is floored to sixteenths is part of where samples lie, no rounding of a result.
    pub fraction: f64,
}

impl RealAxis {
    /// The position of texel `texel` of mip `mip` in a grid, or in a level of one, at
    /// 1/2^`scale_log2` of mip 0's resolution.
    #[must_use]
    pub fn of(texel: u32, mip: u8, scale_log2: u8, snap: CornerSnap) -> RealAxis {
        let texel_size = 2_f64.powi(i32::from(mip));
        let cell_size = 2_f64.powi(i32::from(scale_log2));
        let g = (f64::from(texel) + 0.5) * texel_size / cell_size - 0.5;
        let stride = (texel_size / cell_size).max(1.0);
        let first = match snap {
            CornerSnap::Cell => g.floor(),
            CornerSnap::Stride => (g.floor() / stride).floor() * stride,
        };
        let fraction = (16.0 * (g - first) / stride).floor() / 16.0;
        RealAxis {
            first,
            stride,
            fraction,
        }
    }

    /// The two corners as cells of a grid of `size` cells.
    #[must_use]
    pub fn cells(self, size: u32, mode: AddressMode) -> [u32; 2] {
        [self.first, self.first + self.stride].map(|corner| cell(corner as i64, size, mode))
    }
}

/// The cell that `corner` means, by walking: a step of a whole grid at a time, or a reflection at
/// an edge at a time.
#[must_use]
pub fn cell(corner: i64, size: u32, mode: AddressMode) -> u32 {
    let size = i64::from(size);
    let mut cell = corner;
    while cell < 0 || cell >= size {
        cell = match mode {
            AddressMode::Wrap if cell < 0 => cell + size,
            AddressMode::Wrap => cell - size,
            // The edge cell appears twice: −1 is 0, and `size` is `size − 1`.
            AddressMode::Mirror if cell < 0 => -1 - cell,
            AddressMode::Mirror => 2 * size - 1 - cell,
            AddressMode::Clamp if cell < 0 => 0,
            AddressMode::Clamp => size - 1,
        };
    }
    cell as u32
}
