//! Interleave: which material a pixel shows.

use super::hash;

/// How several materials share a screen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Interleave {
    /// Tiles of `side` × `side` pixels, the materials in turn along rows and along columns: with two
    /// a chequerboard.
    Turns {
        /// Pixels; even. 2 is one quad.
        side: u32,
    },
    /// Tiles of `side` × `side` pixels, each with a material drawn for it.
    Random {
        /// Pixels; even.
        side: u32,
        /// Same seed, same materials.
        seed: u64,
    },
}

impl Interleave {
    /// Another material in every quad: the hardest case.
    pub const QUADS: Interleave = Interleave::Turns { side: 2 };

    /// The smallest and the largest tile.
    pub const SIDES: (u32, u32) = (2, 4096);

    /// Pixels along the side of a tile.
    #[must_use]
    pub const fn side(self) -> u32 {
        match self {
            Interleave::Turns { side } | Interleave::Random { side, .. } => side,
        }
    }

    /// Whether quads lie within tiles, and tiles within bounds.
    #[must_use]
    pub const fn is_allowed(self) -> bool {
        let (side, (low, high)) = (self.side(), Interleave::SIDES);
        side.is_multiple_of(2) && side >= low && side <= high
    }

    /// The material, 0..`count`, at a pixel. `count` is at least 1.
    pub(super) const fn material(self, [x, y]: [u32; 2], count: u16) -> u16 {
        if count == 1 {
            return 0;
        }
        let (column, row) = ((x / self.side()) as u64, (y / self.side()) as u64);
        let count = count as u64;
        let material = match self {
            Interleave::Turns { .. } => (column + row) % count,
            Interleave::Random { seed, .. } => {
                hash::below(hash::number(seed, row << 32 | column), count)
            }
        };
        material as u16
    }
}
