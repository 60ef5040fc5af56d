//! Texel scans: one texel a demand, of one mip or of a whole chain.

use super::StreamError;
use super::hash;
use super::walk::{Points, Walk};
use crate::demand::{Demand, Demands};
use crate::place::Place;
use crate::request::{BLOCK, Request};
use ntmu_isa::shape::Shape;
use std::convert::Infallible;
use std::ops::Range;

/// Which texels, and in which order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TexelSpec {
    /// See [`TexelOrder`].
    pub order: TexelOrder,
    /// See [`Mips`].
    pub mips: Mips,
}

/// The order of a texel scan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TexelOrder {
    /// Rows of 2×2 quads.
    Raster,
    /// Rows of texel blocks (4×4), rows of texels inside a block; see [`Request::blocks`].
    Blocks,
    /// Quads in Z-order (Morton).
    ZOrder,
    /// Texels drawn from all of the mips with equal probability; a texel can be drawn twice.
    Random {
        /// Same seed, same texels.
        seed: u64,
        /// Texels drawn.
        count: u64,
    },
}

/// The mips of a texel scan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mips {
    /// One.
    One(u8),
    /// The whole chain, from mip 0 on.
    All,
}

/// Draws that a random scan counts as a tile.
const DRAWS: u64 = 256;

/// One mip of one material.
#[derive(Clone, Debug)]
struct Part {
    material: u16,
    mip: u8,
    size: (u32, u32),
    walk: Walk,
    tiles: Range<u64>,
    texels: Range<u64>,
}

/// A texel scan of some materials' shapes, one after the other.
///
/// A demand's pixel is the texel's column and row in its own mip.
#[derive(Clone, Debug)]
pub struct Texels {
    order: TexelOrder,
    parts: Vec<Part>,
}

impl Texels {
    /// The scan of one texture set after the other; the material of a demand is the shape's number.
    ///
    /// # Errors
    /// When there is no shape, or more than a demand can number, or a shape lacks the mip.
    pub fn new<'s>(
        spec: &TexelSpec,
        shapes: impl IntoIterator<Item = &'s Shape>,
    ) -> Result<Texels, StreamError> {
        let mut parts: Vec<Part> = Vec::new();
        let mut count = 0;
        for shape in shapes {
            let material =
                u16::try_from(count).map_err(|_| StreamError::Materials { found: count + 1 })?;
            count += 1;
            let mip_count = shape.mip_count;
            let mips = match spec.mips {
                Mips::All => 0..mip_count,
                Mips::One(mip) if mip < mip_count => mip..mip + 1,
                Mips::One(found) => {
                    return Err(StreamError::Mip {
                        found,
                        material,
                        mip_count,
                    });
                }
            };
            for mip in mips {
                let part = Part::new(spec.order, shape, material, mip, parts.last());
                parts.push(part);
            }
        }
        if count == 0 {
            return Err(StreamError::Materials { found: 0 });
        }
        Ok(Texels {
            order: spec.order,
            parts,
        })
    }

    /// Texels of the whole scan.
    #[must_use]
    pub fn texels(&self) -> u64 {
        match self.order {
            TexelOrder::Raster | TexelOrder::Blocks | TexelOrder::ZOrder => self.in_parts(),
            TexelOrder::Random { count, .. } => count,
        }
    }

    fn in_parts(&self) -> u64 {
        self.parts.last().map_or(0, |part| part.texels.end)
    }

    /// Pieces of the scan that [`Texels::part`] can give; none crosses a mip.
    #[must_use]
    pub fn tiles(&self) -> u64 {
        match self.order {
            TexelOrder::Raster | TexelOrder::Blocks | TexelOrder::ZOrder => {
                self.parts.last().map_or(0, |part| part.tiles.end)
            }
            TexelOrder::Random { count, .. } => count.div_ceil(DRAWS),
        }
    }

    /// The demands of some tiles; those that do not exist have none.
    #[must_use]
    pub fn part(&self, tiles: Range<u64>) -> TexelDemands<'_> {
        let texels = match self.order {
            TexelOrder::Raster | TexelOrder::Blocks | TexelOrder::ZOrder => Source::Walked {
                parts: &self.parts,
                tiles,
                current: None,
            },
            TexelOrder::Random { seed, count } => {
                let end = tiles.end.saturating_mul(DRAWS).min(count);
                Source::Drawn {
                    parts: &self.parts,
                    seed,
                    texels: self.in_parts(),
                    draws: tiles.start.saturating_mul(DRAWS)..end,
                }
            }
        };
        TexelDemands { texels }
    }
}

impl Part {
    fn new(
        order: TexelOrder,
        shape: &Shape,
        material: u16,
        mip: u8,
        before: Option<&Part>,
    ) -> Part {
        let (width, height) = shape.mip_size(mip);
        let size = [width, height];
        let walk = match order {
            TexelOrder::Raster | TexelOrder::Random { .. } => Walk::rows(size, 2),
            TexelOrder::Blocks => Walk::rows(size, BLOCK),
            TexelOrder::ZOrder => Walk::morton(size),
        };
        let first_tile = before.map_or(0, |part| part.tiles.end);
        let first_texel = before.map_or(0, |part| part.texels.end);
        Part {
            material,
            mip,
            size: (width, height),
            walk,
            tiles: first_tile..first_tile + walk.tiles(),
            texels: first_texel..first_texel + u64::from(width) * u64::from(height),
        }
    }
}

/// See [`Texels::part`].
#[derive(Clone, Debug)]
pub struct TexelDemands<'s> {
    texels: Source<'s>,
}

#[derive(Clone, Debug)]
enum Source<'s> {
    /// Tiles to come of `parts`, the first of which is the one to enter next.
    Walked {
        parts: &'s [Part],
        tiles: Range<u64>,
        current: Option<(u16, u8, Points)>,
    },
    /// Draws to come from all `texels` of `parts`.
    Drawn {
        parts: &'s [Part],
        seed: u64,
        texels: u64,
        draws: Range<u64>,
    },
}

impl Source<'_> {
    #[inline]
    fn next(&mut self) -> Option<(u16, Request)> {
        match self {
            Source::Walked {
                parts,
                tiles,
                current,
            } => loop {
                if let Some((material, mip, points)) = current
                    && let Some([x, y]) = points.next()
                {
                    return Some((*material, Request::within(x, y, *mip)));
                }
                let (part, rest) = parts.split_first()?;
                *parts = rest;
                let first = tiles.start.max(part.tiles.start) - part.tiles.start;
                let end = tiles.end.clamp(part.tiles.start, part.tiles.end) - part.tiles.start;
                *current = Some((part.material, part.mip, part.walk.points(first..end)));
            },
            Source::Drawn {
                parts,
                seed,
                texels,
                draws,
            } => {
                let draw = draws.next()?;
                let index = hash::below(hash::number(*seed, draw), *texels);
                let part = &parts[parts.partition_point(|part| part.texels.end <= index)];
                let inside = index - part.texels.start;
                let width = u64::from(part.size.0);
                let [x, y] = [(inside % width) as u32, (inside / width) as u32];
                Some((part.material, Request::within(x, y, part.mip)))
            }
        }
    }
}

impl Demands for TexelDemands<'_> {
    type Error = Infallible;

    fn advance(&mut self, demand: &mut Demand) -> Result<bool, Infallible> {
        let Some((material, texel)) = self.texels.next() else {
            return Ok(false);
        };
        demand.pixel = [texel.x(), texel.y()];
        demand.material = material;
        demand.places.clear();
        demand.places.push(Place::of(texel));
        demand.weights = 1;
        Ok(true)
    }
}
