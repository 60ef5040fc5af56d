//! Constructor: from the encoder's output to the latents of every level of a grid.
//!
//! ```text
//! G[l] = quantise ∘ pool[l] ∘ project[l]        paper, "Effect of sampling with stride"
//! ```
//! The encoder's 1×1 convolution of a grid is the projections of all its levels, one after the
//! other, each with weights of its own. A level at 1/8 of the resolution or more takes 1, 4 or 16
//! cells from each encoder position; a coarser one takes the average of 1, 4, 16.. positions. A
//! projection to finer cells than a level has, averaged, is again a projection to the level's own
//! cells, so that none is made finer than its level.

use crate::config::TrainConfig;
use crate::encoder::SCALE_LOG2;
use crate::sampler::Window;

/// The way to one level.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Way {
    /// log2 of the cells of an encoder position along an axis.
    split_log2: u8,
    /// log2 of the encoder positions of a cell along an axis.
    pool_log2: u8,
    /// Its first plane among those of the grid; `channels` times the cells of a position follow.
    first_plane: usize,
}

/// The constructors of a grid's levels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Constructors {
    channels: usize,
    ways: Vec<Way>,
    /// Planes of the grid's tensor.
    pub(crate) planes: usize,
}

/// A tensor of the encoder's, and where its positions lie in what they make latents of: a crop, or
/// the whole set.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Piece {
    /// Items, rows and columns of the tensor. There is a crop for each item.
    pub(crate) tensor: (usize, usize, usize),
    /// Rows and columns at every edge that make no latents.
    pub(crate) margin: usize,
    /// Where the first row and column inside the margin lie, along x and y.
    pub(crate) origin: [usize; 2],
    /// Positions of the crop or of the whole set along x and y.
    pub(crate) extent: [usize; 2],
}

impl Constructors {
    /// Those of `levels` levels of a grid.
    pub(crate) fn new(config: &TrainConfig, grid: usize, levels: usize) -> Constructors {
        let channels = usize::from(config.grids[grid].channels);
        let mut planes = 0;
        let ways = (0..levels as u8).map(|level| {
            let reduction = config.pyramid.reduction_log2(level);
            let scale_log2 = config.grids[grid].scale_log2.saturating_add(reduction);
            let way = Way {
                split_log2: SCALE_LOG2.saturating_sub(scale_log2),
                pool_log2: scale_log2.saturating_sub(SCALE_LOG2),
                first_plane: planes,
            };
            planes += channels << (2 * way.split_log2);
            way
        });
        Constructors {
            channels,
            ways: ways.collect(),
            planes,
        }
    }

    /// Channels of a latent.
    pub(crate) const fn channels(&self) -> usize {
        self.channels
    }

    /// log2 of the encoder positions of a level's cell along an axis.
    pub(crate) fn pool_log2(&self, level: usize) -> u8 {
        self.ways[level].pool_log2
    }

    /// Cells of a level along an axis of `positions` encoder positions.
    pub(crate) fn cells(&self, level: usize, positions: u32) -> u32 {
        let way = self.ways[level];
        (positions << way.split_log2).div_ceil(1 << way.pool_log2)
    }

    /// Calls `each(in tensor, in latents, share)` for every number of a tensor
    /// `[item][plane][row][column]` and the latent that it is a share of: the latent is the sum of
    /// share · number. `windows` say where the latents of `grid` lie, as in [`Window`]; what falls
    /// beyond them is left out.
    pub(crate) fn for_latents(
        &self,
        piece: Piece,
        grid: usize,
        windows: &[Window],
        mut each: impl FnMut(usize, usize, f32),
    ) {
        let (items, rows, columns) = piece.tensor;
        let margin = piece.margin;
        for item in 0..items {
            for (level, way) in self.ways.iter().enumerate() {
                let window = windows[item * self.ways.len() + level];
                let [width, height] = window.size[grid].map(|n| n as usize);
                let side = 1_usize << way.split_log2;
                for channel in 0..self.channels {
                    for sub in 0..side * side {
                        let plane = way.first_plane + channel * side * side + sub;
                        let plane = item * self.planes + plane;
                        for row in margin..rows - margin {
                            let (y, tall) = way.cell(piece, 1, row, sub / side);
                            if y >= height {
                                continue;
                            }
                            for column in margin..columns - margin {
                                let (x, wide) = way.cell(piece, 0, column, sub % side);
                                if x >= width {
                                    continue;
                                }
                                let cell = window.base[grid] + y * width + x;
                                each(
                                    (plane * rows + row) * columns + column,
                                    cell * self.channels + channel,
                                    1.0 / (tall * wide) as f32,
                                );
                            }
                        }
                    }
                }
            }
        }
    }
}

impl Way {
    /// The cell that a row or column gives its sub-cell `sub`, and how many rows or columns it has:
    /// fewer at the far edge, where positions end within a cell.
    fn cell(self, piece: Piece, axis: usize, at: usize, sub: usize) -> (usize, usize) {
        let position = piece.origin[axis] + at - piece.margin;
        let cell = position >> self.pool_log2;
        let first = cell << self.pool_log2;
        let positions = (piece.extent[axis] - first).min(1 << self.pool_log2);
        ((cell << self.split_log2) + sub, positions)
    }
}
