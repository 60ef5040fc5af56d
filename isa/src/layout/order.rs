//! Order: which cell of a grid comes after which.
//!
//! Every order here is one scheme: the grid is cut into square tiles of a power of two, tiles follow
//! row after row, and the place inside a tile is a choice of bits of x and y. [`Order::Linear`] has
//! tiles of one cell; [`Order::Morton`] has one row or one column of tiles.

/// The side of a tile in cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Side {
    /// 2×2 cells.
    Two,
    /// 4×4 cells.
    Four,
    /// 8×8 cells.
    Eight,
    /// 16×16 cells.
    Sixteen,
}

impl Side {
    /// Every side, the smallest first.
    pub const ALL: [Side; 4] = [Side::Two, Side::Four, Side::Eight, Side::Sixteen];

    /// Cells along the side.
    #[must_use]
    pub const fn cells(self) -> u32 {
        1 << self.log2()
    }

    /// log2 of the cells along the side: 1..=4.
    #[must_use]
    pub const fn log2(self) -> u32 {
        self as u32 + 1
    }
}

/// The order inside a tile.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Inside {
    /// The bits of x and y in turn, x in the lowest: what texture units do.
    Morton,
    /// Row after row.
    Rows,
}

impl Inside {
    /// Every order, in the order of its code.
    pub const ALL: [Inside; 2] = [Inside::Morton, Inside::Rows];
}

/// The order of a grid's cells in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Order {
    /// Row after row of the grid.
    Linear,
    /// Tiles, row after row of tiles. The grid is padded to whole tiles.
    Tiles {
        /// The tile's side.
        side: Side,
        /// The order inside a tile.
        inside: Inside,
    },
    /// Morton order over the whole grid. Where the grid is not square: Morton order inside squares of
    /// the smaller of both sides, rounded up to a power of two, and those squares one after the
    /// other along the longer side. The grid is padded to whole squares.
    Morton,
    /// Super-blocks of 8×8 tiles, row after row of super-blocks; Morton order of the tiles inside a
    /// super-block. The grid is padded to whole super-blocks. With tiles of side 8 in Morton order
    /// these are the blocks of 2³ and super-blocks of 2³ in which the simulator ATTILA keeps textures.
    Super {
        /// The side of a tile.
        side: Side,
        /// The order inside a tile. In Morton order a super-block is one larger Morton tile.
        inside: Inside,
    },
}

/// log2 of the tiles along a super-block.
const SUPER_LOG2: u32 = 3;

/// How a grid is cut: tiles of side 2^`side_log2`; inside a tile the lowest `rows_log2` bits of x and y
/// row after row, those above in Morton order.
#[derive(Clone, Copy)]
struct Cut {
    side_log2: u32,
    rows_log2: u32,
}

impl Order {
    /// Every order. Some are the same, see [`Order::is_alias`].
    pub fn every() -> impl Iterator<Item = Order> {
        let squares = || {
            Side::ALL
                .into_iter()
                .flat_map(|side| Inside::ALL.map(|inside| (side, inside)))
        };
        let tiles = squares().map(|(side, inside)| Order::Tiles { side, inside });
        let supers = squares().map(|(side, inside)| Order::Super { side, inside });
        [Order::Linear]
            .into_iter()
            .chain(tiles)
            .chain([Order::Morton])
            .chain(supers)
    }

    /// Whether another name stands for the same order: in 2×2 cells Morton order is row after row, and
    /// a super-block of 8×8 such tiles is a Morton tile of 16×16.
    #[must_use]
    pub const fn is_alias(self) -> bool {
        matches!(
            self,
            Order::Tiles {
                side: Side::Two,
                inside: Inside::Rows
            } | Order::Super {
                side: Side::Two,
                inside: _
            }
        )
    }

    const fn cut(self, width: u32, height: u32) -> Cut {
        match self {
            Order::Linear => Cut {
                side_log2: 0,
                rows_log2: 0,
            },
            Order::Tiles { side, inside } => Cut {
                side_log2: side.log2(),
                rows_log2: rows(side, inside),
            },
            Order::Morton => {
                let smaller = if width < height { width } else { height };
                Cut {
                    side_log2: smaller.next_power_of_two().trailing_zeros(),
                    rows_log2: 0,
                }
            }
            Order::Super { side, inside } => Cut {
                side_log2: side.log2() + SUPER_LOG2,
                rows_log2: rows(side, inside),
            },
        }
    }

    /// Cells that a grid of this size takes, padding included.
    #[must_use]
    pub const fn cells(self, width: u32, height: u32) -> u64 {
        let side = 1 << self.cut(width, height).side_log2;
        width.next_multiple_of(side) as u64 * height.next_multiple_of(side) as u64
    }

    /// Where a cell of a grid of this size comes, from 0. The cell lies within the grid.
    #[must_use]
    pub const fn index(self, width: u32, height: u32, x: u32, y: u32) -> u64 {
        let Cut {
            side_log2,
            rows_log2,
        } = self.cut(width, height);
        let tiles = width.div_ceil(1 << side_log2) as u64;
        let tile = (y >> side_log2) as u64 * tiles + (x >> side_log2) as u64;
        let inside = (1 << side_log2) - 1;
        let (x, y) = (x & inside, y & inside);
        let run = (1 << rows_log2) - 1;
        tile << (2 * side_log2)
            | morton(x >> rows_log2, y >> rows_log2) << (2 * rows_log2)
            | ((y & run) << rows_log2 | (x & run)) as u64
    }

    /// Multiply-add steps from a cell's coordinates to its index: one for the row of tiles, however many
    /// there are. [`Order::Morton`] has a single row or column of them and needs none: taking bits
    /// apart and joining them is wires, and where the grid's size decides which, multiplexers.
    #[must_use]
    pub const fn steps(self) -> u32 {
        match self {
            Order::Linear | Order::Tiles { .. } | Order::Super { .. } => 1,
            Order::Morton => 0,
        }
    }
}

/// Bits of a coordinate inside a tile that count row after row.
const fn rows(side: Side, inside: Inside) -> u32 {
    match inside {
        Inside::Morton => 0,
        Inside::Rows => side.log2(),
    }
}

/// The bits of x and y in turn, x in the lowest.
const fn morton(x: u32, y: u32) -> u64 {
    spread(x) | spread(y) << 1
}

/// Bit i to bit 2i, by halving the distance of what is moved.
const fn spread(x: u32) -> u64 {
    let x = x as u64;
    let x = (x | x << 16) & 0x0000_ffff_0000_ffff;
    let x = (x | x << 8) & 0x00ff_00ff_00ff_00ff;
    let x = (x | x << 4) & 0x0f0f_0f0f_0f0f_0f0f;
    let x = (x | x << 2) & 0x3333_3333_3333_3333;
    (x | x << 1) & 0x5555_5555_5555_5555
}
