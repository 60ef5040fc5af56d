//! Position: the request's corners in a grid.

use crate::request::Request;
use ntmu_isa::position::{AxisPosition, corner_weights};
use ntmu_isa::shape::Shape;

/// The square of corners around a texel centre, in one grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Corners {
    /// First corner, stride and phase along x.
    pub x: AxisPosition,
    /// First corner, stride and phase along y.
    pub y: AxisPosition,
    /// The columns of the two corners along x, within the grid.
    pub columns: [u32; 2],
    /// The rows of the two corners along y, within the grid.
    pub rows: [u32; 2],
}

impl Default for Corners {
    /// The corners of a grid of one cell.
    fn default() -> Corners {
        let origin = AxisPosition {
            first: 0,
            stride: 1,
            phase: 0,
        };
        Corners {
            x: origin,
            y: origin,
            columns: [0; 2],
            rows: [0; 2],
        }
    }
}

impl Corners {
    /// The four cells as (column, row): (0,0), (1,0), (0,1), (1,1).
    #[must_use]
    pub const fn cells(&self) -> [(u32, u32); 4] {
        let ([left, right], [top, bottom]) = (self.columns, self.rows);
        [(left, top), (right, top), (left, bottom), (right, bottom)]
    }

    /// The four weights in 1/256, in the order of [`Corners::cells`].
    #[must_use]
    pub const fn weights(&self) -> [i32; 4] {
        corner_weights(self.x, self.y)
    }
}

pub(super) fn corners(shape: &Shape, grid: usize, request: Request) -> Corners {
    let scale = shape.grids[grid].scale_log2;
    let (width, height) = shape.grid_size(grid);
    let x = AxisPosition::of(request.x(), request.mip(), scale, shape.snap);
    let y = AxisPosition::of(request.y(), request.mip(), scale, shape.snap);
    let columns = x.corners(width, shape.address_mode);
    let rows = y.corners(height, shape.address_mode);
    Corners {
        x,
        y,
        columns,
        rows,
    }
}
