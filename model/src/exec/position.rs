//! Position: a place's corners in a grid.

use crate::place::Place;
use ntmu_isa::filter::FilterRule;
use ntmu_isa::position::{AxisPosition, PHASE_BITS};
use ntmu_isa::shape::Shape;

/// The square of corners around a place, in the level of one grid that serves the place's mip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Corners {
    /// The level of the grid.
    pub level: u8,
    /// First corner, stride and phase along x.
    pub x: AxisPosition,
    /// First corner, stride and phase along y.
    pub y: AxisPosition,
    /// The columns of the two corners along x, within the level.
    pub columns: [u32; 2],
    /// The rows of the two corners along y, within the level.
    pub rows: [u32; 2],
}

impl Default for Corners {
    /// The corners of a grid of one cell.
    fn default() -> Corners {
        let origin = AxisPosition {
            first: 0,
            stride: 1,
            phase: 0,
            phase_bits: PHASE_BITS,
        };
        Corners {
            level: 0,
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

    /// The four weights by the normative rule, in the order of [`Corners::cells`]: products of the
    /// axis weights in 1/2^(2·phase bits), 1/256 at texel centres.
    #[must_use]
    pub const fn weights(&self) -> [i32; 4] {
        let phases = [self.x.phase as u32, self.y.phase as u32];
        let [w00, w10, w01, w11] = FilterRule::Exact.weights(phases, self.x.phase_bits as u32);
        [w00 as i32, w10 as i32, w01 as i32, w11 as i32]
    }

    /// How far the place lies from the first corners, x then y, as fractions of a filter with `bits`
    /// bits.
    #[must_use]
    pub const fn fractions(&self, bits: u8) -> [u32; 2] {
        [self.x.fraction(bits), self.y.fraction(bits)]
    }
}

/// The corners of a place in a grid, with phases of `phase_bits` bits.
pub(super) fn corners(shape: &Shape, grid: usize, place: &Place, phase_bits: u8) -> Corners {
    let scale = shape.grids[grid].scale_log2;
    let level = shape.pyramid.level_of(place.mip());
    let mip = shape.pyramid.mip_in_level(place.mip());
    let axis = |coordinate| {
        let bits = place.bits();
        AxisPosition::at(coordinate, bits, mip, scale, shape.snap, phase_bits)
    };
    let (x, y) = (axis(place.x()), axis(place.y()));
    let (width, height) = shape.level_size(grid, level);
    Corners {
        level,
        x,
        y,
        columns: x.corners(width, shape.address_mode),
        rows: y.corners(height, shape.address_mode),
    }
}
