//! Layout: where a unit's memory keeps the grids.
//!
//! A layout is data: an [`Order`] of the cells and a [`Storage`] of their channels. It changes
//! addresses and no value.
//!
//! | name | cells |
//! |---|---|
//! | `linear` | row after row |
//! | `tiles-4`, `tiles-4-rows` | tiles of 4×4 row after row of tiles; inside a tile Morton order, or row after row |
//! | `morton` | Morton order over the whole grid |
//! | `super-4`, `super-4-rows` | super-blocks of 8×8 such tiles, the tiles in Morton order |
//!
//! | suffix | channels and grids |
//! |---|---|
//! | none | a cell whole: its codes one after the other from the least significant bit, padded to a byte; grid 1 after grid 0 |
//! | `+planar` | a plane for each channel, of codes padded to 1, 2, 4 or 8 bits; grid 1 after grid 0 |
//! | `+together` | the cell of grid 0, then the cell of grid 1 at the same place, in one record |
//!
//! A tile's side is 2, 4, 8 or 16 cells. The levels of a grid's [pyramid](crate::pyramid) are laid out
//! each on its own, level 0 first; in records a level holds the cells of both grids. Grids, levels and
//! planes start at multiples of [`BASE_ALIGNMENT`].
//! There is no `+planar+together`: where each channel is a plane of its own, no record is left to share.
//!
//! Addresses are counted in steps of a generator too, see [`Layout::address_steps`].

mod image;
mod name;
mod order;

pub use name::LayoutError;
pub use order::{Inside, Order, Side};

use crate::shape::Shape;

/// Alignment of the first byte of a grid, of a level and of a plane: the largest cache line that a unit
/// may have. So no line holds bytes of two grids, unless they are stored together, of two levels, or
/// of two planes.
pub const BASE_ALIGNMENT: u64 = 256;

/// What lies next to what: channels of a cell, cells of two grids.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Storage {
    /// A cell whole, padded to a byte. Grid 1 after grid 0.
    Interleaved,
    /// Each channel a plane of its own, of codes padded to 1, 2, 4 or 8 bits, so that no code
    /// straddles bytes. The planes of grid 1 after those of grid 0.
    Planar,
    /// The cell of grid 0 followed by the cell of grid 1 in one record, each padded to a byte. Made for
    /// grids of one size. Elsewhere there is a record for every place that either grid has, and the
    /// part of the grid that has no such cell is padding; [`Layout::check`] refuses that.
    Together,
}

impl Storage {
    /// Every storage, in the order of its code.
    pub const ALL: [Storage; 3] = [Storage::Interleaved, Storage::Planar, Storage::Together];
}

/// Where memory keeps the cells of the grids. Every combination is a layout.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Layout {
    /// The order of the cells.
    pub order: Order,
    /// What lies next to what.
    pub storage: Storage,
}

impl Layout {
    /// `linear`: row after row, cells whole.
    pub const LINEAR: Layout = Layout {
        order: Order::Linear,
        storage: Storage::Interleaved,
    };
    /// `tiles-4`: tiles of 4×4 cells, Morton order inside a tile, cells whole.
    pub const TILED: Layout = Layout {
        order: Order::Tiles {
            side: Side::Four,
            inside: Inside::Morton,
        },
        storage: Storage::Interleaved,
    };

    /// The same order with another storage.
    #[must_use]
    pub const fn with(self, storage: Storage) -> Layout {
        Layout { storage, ..self }
    }

    /// Bytes of one cell of a grid, or of its part in one plane.
    #[must_use]
    pub const fn cell_bytes(self, shape: &Shape, grid: usize) -> u64 {
        let g = shape.grids[grid];
        match self.storage {
            Storage::Interleaved | Storage::Together => {
                (g.channels as u64 * g.format.bits() as u64).div_ceil(8)
            }
            Storage::Planar => 1,
        }
    }

    /// Planes that a cell of a grid lies in: its channels, or 1 where they are stored together.
    #[must_use]
    pub const fn planes(self, shape: &Shape, grid: usize) -> u32 {
        match self.storage {
            Storage::Interleaved | Storage::Together => 1,
            Storage::Planar => shape.grids[grid].channels as u32,
        }
    }

    /// From a cell's part in one plane of a level to its part in the next, in bytes; 0 where there
    /// are no planes.
    #[must_use]
    pub const fn plane_bytes(self, shape: &Shape, grid: usize, level: u8) -> u64 {
        match self.storage {
            Storage::Interleaved | Storage::Together => 0,
            Storage::Planar => (self.cells(shape, grid, level) * plane_bits(shape, grid))
                .div_ceil(8)
                .next_multiple_of(BASE_ALIGNMENT),
        }
    }

    /// Bytes of a level of a grid, padding included; of records, the grid's part.
    #[must_use]
    pub const fn level_bytes(self, shape: &Shape, grid: usize, level: u8) -> u64 {
        match self.storage {
            Storage::Interleaved | Storage::Together => {
                self.cells(shape, grid, level) * self.cell_bytes(shape, grid)
            }
            Storage::Planar => {
                self.planes(shape, grid) as u64 * self.plane_bytes(shape, grid, level)
            }
        }
    }

    /// The address of the first byte of a level of a grid.
    #[must_use]
    pub const fn base(self, shape: &Shape, grid: usize, level: u8) -> u64 {
        let start = match self.storage {
            Storage::Interleaved | Storage::Planar if grid == 0 => 0,
            Storage::Interleaved | Storage::Planar => {
                self.span(shape, 0).next_multiple_of(BASE_ALIGNMENT)
            }
            Storage::Together if grid == 0 => 0,
            Storage::Together => self.cell_bytes(shape, 0),
        };
        start + self.before(shape, grid, level)
    }

    /// Bytes of both grids in memory.
    #[must_use]
    pub const fn total_bytes(self, shape: &Shape) -> u64 {
        match self.storage {
            Storage::Interleaved | Storage::Planar => self.base(shape, 1, 0) + self.span(shape, 1),
            Storage::Together => self.span(shape, 0),
        }
    }

    /// The address of the first byte of a cell of a level of a grid, in its first plane. The cell lies
    /// within the level.
    #[must_use]
    pub const fn address(self, shape: &Shape, grid: usize, level: u8, x: u32, y: u32) -> u64 {
        self.first_bit(shape, grid, level, x, y, 0) / 8
    }

    /// The first bit of a code in memory: bit `n % 8`, from the least significant, of byte `n / 8`. The
    /// code's other bits follow. The cell lies within the level of the grid.
    #[must_use]
    pub const fn first_bit(
        self,
        shape: &Shape,
        grid: usize,
        level: u8,
        x: u32,
        y: u32,
        channel: usize,
    ) -> u64 {
        let (width, height) = self.size(shape, grid, level);
        let index = self.order.index(width, height, x, y);
        let channel = channel as u64;
        let bits = shape.grids[grid].format.bits() as u64;
        let within = match self.storage {
            Storage::Interleaved => 8 * index * self.cell_bytes(shape, grid) + channel * bits,
            Storage::Planar => {
                8 * channel * self.plane_bytes(shape, grid, level) + index * plane_bits(shape, grid)
            }
            Storage::Together => {
                let record = self.cell_bytes(shape, 0) + self.cell_bytes(shape, 1);
                8 * index * record + channel * bits
            }
        };
        8 * self.base(shape, grid, level) + within
    }

    /// Multiply-add steps of an address generator for one corner, all planes.
    ///
    /// Wires are free, so taking the bits of x and y apart and joining them costs nothing; sizes and
    /// bases are registers, a set for each level, written when an asset is bound. What is left is
    /// counted: the index of the tile, row times tiles in a row plus column ([`Order::steps`]); the base
    /// plus the index times the bytes of a cell or record; and for each plane after the first one
    /// addition of the plane's bytes. A factor that happens to be one or a power of two saves nothing:
    /// the generator serves every asset.
    #[must_use]
    pub const fn address_steps(self, shape: &Shape, grid: usize) -> u32 {
        self.order.steps() + self.planes(shape, grid)
    }

    /// Bytes from a grid's first level to the end of its last, without padding after it; of records,
    /// those of both grids.
    const fn span(self, shape: &Shape, grid: usize) -> u64 {
        let last = shape.level_count() - 1;
        self.before(shape, grid, last) + self.stored(shape, grid, last)
    }

    /// Bytes from a grid's first level to one of its levels.
    const fn before(self, shape: &Shape, grid: usize, level: u8) -> u64 {
        let (mut bytes, mut before) = (0, 0);
        while before < level {
            bytes += self
                .stored(shape, grid, before)
                .next_multiple_of(BASE_ALIGNMENT);
            before += 1;
        }
        bytes
    }

    /// Bytes of a level of a grid, or of the records of a level.
    const fn stored(self, shape: &Shape, grid: usize, level: u8) -> u64 {
        match self.storage {
            Storage::Interleaved | Storage::Planar => self.level_bytes(shape, grid, level),
            Storage::Together => {
                self.level_bytes(shape, 0, level) + self.level_bytes(shape, 1, level)
            }
        }
    }

    /// Cells along x and y that the order runs over.
    const fn size(self, shape: &Shape, grid: usize, level: u8) -> (u32, u32) {
        match self.storage {
            Storage::Interleaved | Storage::Planar => shape.level_size(grid, level),
            Storage::Together => {
                let ((w0, h0), (w1, h1)) = (shape.level_size(0, level), shape.level_size(1, level));
                (if w0 > w1 { w0 } else { w1 }, if h0 > h1 { h0 } else { h1 })
            }
        }
    }

    /// Cells that the order takes, padding included.
    const fn cells(self, shape: &Shape, grid: usize, level: u8) -> u64 {
        let (width, height) = self.size(shape, grid, level);
        self.order.cells(width, height)
    }
}

/// Bits of a code in a plane: 1, 2, 4 or 8.
const fn plane_bits(shape: &Shape, grid: usize) -> u64 {
    shape.grids[grid].format.bits().next_power_of_two() as u64
}
