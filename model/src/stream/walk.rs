//! Walk: the order in which the points of a rectangle are visited.

use std::ops::Range;

/// The order of tiles, and of the cells inside a tile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Curve {
    /// Row after row, each from the left.
    Rows,
    /// Z-order (Morton): the bits of column and row interleaved.
    Morton,
}

/// All points of a rectangle, tile after tile, cell after cell; inside a cell row after row. What of
/// a tile or a cell lies outside the rectangle is left out.
#[derive(Clone, Copy, Debug)]
pub(super) struct Walk {
    size: [u32; 2],
    /// Points along the side of a cell.
    cell: u32,
    /// Points of a tile along x and y: whole cells, and by Morton a power of two on both axes.
    tile: [u32; 2],
    curve: Curve,
}

/// Points `left..right`, `top..bottom`.
#[derive(Clone, Copy, Debug, Default)]
struct Area {
    left: u32,
    top: u32,
    right: u32,
    bottom: u32,
}

impl Walk {
    /// Points of a run of quads or texel blocks that a walk by rows counts as a tile.
    const STRIP: u32 = 64;

    /// Row after row of cells of side `cell`.
    pub(super) const fn rows(size: [u32; 2], cell: u32) -> Walk {
        Walk {
            size,
            cell,
            tile: [Walk::STRIP, cell],
            curve: Curve::Rows,
        }
    }

    /// Row after row of tiles of `side` × `side` points, each row after row of quads. `side` is even.
    pub(super) const fn tiled(size: [u32; 2], side: u32) -> Walk {
        Walk {
            size,
            cell: 2,
            tile: [side; 2],
            curve: Curve::Rows,
        }
    }

    /// Quads in Z-order.
    pub(super) const fn morton(size: [u32; 2]) -> Walk {
        Walk {
            size,
            cell: 2,
            tile: [16; 2],
            curve: Curve::Morton,
        }
    }

    const fn columns_and_rows(&self) -> [u32; 2] {
        [
            self.size[0].div_ceil(self.tile[0]),
            self.size[1].div_ceil(self.tile[1]),
        ]
    }

    /// Tiles of the rectangle.
    pub(super) const fn tiles(&self) -> u64 {
        let [columns, rows] = self.columns_and_rows();
        columns as u64 * rows as u64
    }

    /// Tile `index`, which is below [`Walk::tiles`].
    fn tile(&self, index: u64) -> Area {
        let [columns, rows] = self.columns_and_rows();
        let [column, row] = match self.curve {
            Curve::Rows => {
                let columns = u64::from(columns);
                [(index % columns) as u32, (index / columns) as u32]
            }
            Curve::Morton => nth_morton(index, [columns, rows]),
        };
        let [left, top] = [column * self.tile[0], row * self.tile[1]];
        Area {
            left,
            top,
            right: (left + self.tile[0]).min(self.size[0]),
            bottom: (top + self.tile[1]).min(self.size[1]),
        }
    }

    /// The points of some tiles; those that do not exist have none.
    pub(super) fn points(&self, tiles: Range<u64>) -> Points {
        Points {
            walk: *self,
            tiles: tiles.start..tiles.end.min(self.tiles()),
            tile: Area::default(),
            cells: 0..0,
            cell: Area::default(),
            next: [0; 2],
        }
    }
}

/// See [`Walk::points`].
#[derive(Clone, Debug)]
pub(super) struct Points {
    walk: Walk,
    /// Those to come.
    tiles: Range<u64>,
    tile: Area,
    /// Those of `tile` to come.
    cells: Range<u32>,
    cell: Area,
    next: [u32; 2],
}

impl Points {
    /// Goes on to the next cell with points; false at the end.
    fn enter_cell(&mut self) -> bool {
        loop {
            let Some(code) = self.cells.next() else {
                let Some(index) = self.tiles.next() else {
                    return false;
                };
                self.tile = self.walk.tile(index);
                self.cells = 0..self.cells_of_tile();
                continue;
            };
            let (side, tile) = (self.walk.cell, self.tile);
            let [column, row] = match self.walk.curve {
                Curve::Rows => {
                    let columns = (tile.right - tile.left).div_ceil(side);
                    [code % columns, code / columns]
                }
                Curve::Morton => [even_bits(code), even_bits(code >> 1)],
            };
            let [left, top] = [tile.left + column * side, tile.top + row * side];
            if left < tile.right && top < tile.bottom {
                self.cell = Area {
                    left,
                    top,
                    right: (left + side).min(tile.right),
                    bottom: (top + side).min(tile.bottom),
                };
                self.next = [left, top];
                return true;
            }
        }
    }

    fn cells_of_tile(&self) -> u32 {
        let (side, tile) = (self.walk.cell, self.tile);
        match self.walk.curve {
            Curve::Rows => {
                let columns = (tile.right - tile.left).div_ceil(side);
                columns * (tile.bottom - tile.top).div_ceil(side)
            }
            Curve::Morton => (self.walk.tile[0] / side) * (self.walk.tile[1] / side),
        }
    }
}

impl Iterator for Points {
    type Item = [u32; 2];

    #[inline]
    fn next(&mut self) -> Option<[u32; 2]> {
        if self.next[1] >= self.cell.bottom && !self.enter_cell() {
            return None;
        }
        let point = self.next;
        self.next[0] += 1;
        if self.next[0] == self.cell.right {
            self.next = [self.cell.left, point[1] + 1];
        }
        Some(point)
    }
}

/// Bits 0, 2, 4, … of a code, together.
const fn even_bits(code: u32) -> u32 {
    let mut bits = code & 0x5555_5555;
    bits = (bits | bits >> 1) & 0x3333_3333;
    bits = (bits | bits >> 2) & 0x0f0f_0f0f;
    bits = (bits | bits >> 4) & 0x00ff_00ff;
    (bits | bits >> 8) & 0xffff
}

/// Place `index` in Z-order of `size[0]` × `size[1]` places: those outside are not counted. There are
/// more than `index`.
fn nth_morton(mut index: u64, size: [u32; 2]) -> [u32; 2] {
    let mut side = size[0].max(size[1]).next_power_of_two();
    let mut place = [0_u32; 2];
    while side > 1 {
        side /= 2;
        for quadrant in 0..4 {
            let corner = [
                place[0] + side * (quadrant & 1),
                place[1] + side * (quadrant >> 1),
            ];
            let inside = |axis: usize| u64::from(size[axis].saturating_sub(corner[axis]).min(side));
            let count = inside(0) * inside(1);
            if index < count {
                place = corner;
                break;
            }
            index -= count;
        }
    }
    place
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZES: [[u32; 2]; 7] = [
        [1, 1],
        [2, 2],
        [5, 3],
        [64, 64],
        [63, 130],
        [200, 33],
        [1, 129],
    ];

    fn walks(size: [u32; 2]) -> [Walk; 6] {
        [
            Walk::rows(size, 2),
            Walk::rows(size, 4),
            Walk::tiled(size, 2),
            Walk::tiled(size, 8),
            Walk::tiled(size, 30),
            Walk::morton(size),
        ]
    }

    #[test]
    fn every_walk_meets_every_point_once() {
        for size in SIZES {
            let all: Vec<[u32; 2]> = (0..size[1])
                .flat_map(|y| (0..size[0]).map(move |x| [x, y]))
                .collect();
            for walk in walks(size) {
                let mut found: Vec<[u32; 2]> = walk.points(0..u64::MAX).collect();
                found.sort_unstable_by_key(|&[x, y]| (y, x));
                assert_eq!(found, all, "{walk:?}");
            }
        }
    }

    #[test]
    fn tiles_in_order_are_the_whole_walk() {
        for walk in SIZES.into_iter().flat_map(walks) {
            let whole: Vec<[u32; 2]> = walk.points(0..walk.tiles()).collect();
            let tiles = 0..walk.tiles();
            let parts: Vec<[u32; 2]> = tiles.flat_map(|t| walk.points(t..t + 1)).collect();
            assert_eq!(parts, whole, "{walk:?}");
            assert_eq!(walk.points(walk.tiles()..u64::MAX).next(), None);
        }
    }

    #[test]
    fn z_order_is_the_order_of_interleaved_bits() {
        for size in SIZES {
            let code = |[x, y]: [u32; 2]| -> u64 {
                (0..16)
                    .map(|bit| {
                        u64::from(x >> bit & 1) << (2 * bit)
                            | u64::from(y >> bit & 1) << (2 * bit + 1)
                    })
                    .sum()
            };
            let codes: Vec<u64> = Walk::morton(size).points(0..u64::MAX).map(code).collect();
            assert!(codes.is_sorted(), "{size:?}");
        }
    }

    #[test]
    fn rows_of_quads_are_pairs_of_rows() {
        let found: Vec<[u32; 2]> = Walk::rows([4, 4], 2).points(0..u64::MAX).collect();
        let expected = [
            [0, 0],
            [1, 0],
            [0, 1],
            [1, 1],
            [2, 0],
            [3, 0],
            [2, 1],
            [3, 1],
            [0, 2],
            [1, 2],
            [0, 3],
            [1, 3],
            [2, 2],
            [3, 2],
            [2, 3],
            [3, 3],
        ];
        assert_eq!(found, expected);
    }
}
