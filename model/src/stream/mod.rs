//! Stream: where demands come from when no file holds them.
//!
//! | module | answers |
//! |---|---|
//! | [`spec`] | a stream as text: `zorder:mip=0`, `plane:pitch=10,order=tiles:16` |
//! | [`texels`] | scans of a mip or a chain, one texel a demand |
//! | [`scene`] | a screen's pixels, each a sample |
//! | [`geometry`] | what the pixels see: a flat texture, a floor, a sphere |
//! | [`interleave`] | which material a pixel shows |
//! | `walk`, `hash` | orders of points; numbers that look random |
//!
//! A stream is cut into tiles, pieces that follow each other: all of them are the whole stream, and
//! any can be made without the others, so that a frame can be sampled. The same stream gives the same
//! demands every time.

pub mod geometry;
pub mod interleave;
pub mod scene;
pub mod spec;
pub mod texels;

mod hash;
mod walk;

pub use geometry::{Geometry, Parameter};
pub use hash::random_bits;
pub use interleave::Interleave;
pub use scene::{DetailKind, PixelOrder, Sample, Samples, Scene, SceneDemands, SceneSpec};
pub use spec::{AccessSpec, SpecError};
pub use texels::{Mips, TexelDemands, TexelOrder, TexelSpec, Texels};

use crate::demand::{Demand, Demands};
use crate::sampler::Sampled;
use std::convert::Infallible;
use std::fmt;
use std::ops::Range;

/// Why there is no such stream.
#[derive(Clone, Debug, PartialEq)]
pub enum StreamError {
    /// A screen too small or too large.
    Screen {
        /// Pixels along x and y.
        found: [u32; 2],
    },
    /// No material, or more than a demand can number.
    Materials {
        /// Materials given.
        found: usize,
    },
    /// A material's chain is shorter.
    Mip {
        /// The mip asked for.
        found: u8,
        /// The material, from 0.
        material: u16,
        /// Mips in its chain.
        mip_count: u8,
    },
    /// A number of the geometry is outside its range.
    Parameter(Parameter),
    /// A tile's side is odd or outside its range.
    Tile {
        /// `order` or `interleave`.
        field: &'static str,
        /// Pixels.
        found: u32,
        /// The smallest and the largest.
        allowed: (u32, u32),
    },
}

impl fmt::Display for StreamError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            StreamError::Screen { found: [x, y] } => {
                let (low, high) = scene::SCREEN;
                write!(
                    f,
                    "screen: found {x}x{y}; allowed: {low}..={high} pixels on each side"
                )
            }
            StreamError::Materials { found } => {
                write!(f, "materials: found {found}; allowed: 1..={}", u16::MAX)
            }
            StreamError::Mip {
                found,
                material,
                mip_count,
            } => write!(
                f,
                "mip: found {found}; allowed: 0..={}, the mips of material {material}",
                mip_count - 1
            ),
            StreamError::Parameter(parameter) => {
                let (low, high) = (parameter.allowed.start(), parameter.allowed.end());
                let Parameter { name, value, .. } = parameter;
                write!(f, "{name}: found {value}; allowed: {low} to {high}")
            }
            StreamError::Tile {
                field,
                found,
                allowed: (low, high),
            } => write!(
                f,
                "{field}: found tiles of {found}; allowed: even, {low}..={high} pixels"
            ),
        }
    }
}

impl std::error::Error for StreamError {}

/// A stream of any kind but a file.
#[derive(Clone, Debug)]
pub enum Stream<'m> {
    /// One texel a demand.
    Texels(Texels),
    /// One sample a demand.
    Scene(Scene<'m>),
}

impl<'m> Stream<'m> {
    /// The texel scan of the materials' shapes, one after the other; their samplers take no part.
    ///
    /// # Errors
    /// As [`Texels::new`].
    pub fn texels(spec: &TexelSpec, materials: &[Sampled]) -> Result<Stream<'m>, StreamError> {
        let shapes = materials.iter().map(Sampled::shape);
        Texels::new(spec, shapes).map(Stream::Texels)
    }

    /// The scene on a screen of so many pixels.
    ///
    /// # Errors
    /// As [`Scene::new`].
    pub fn scene(
        spec: &SceneSpec,
        screen: [u32; 2],
        materials: &'m [Sampled],
        interleave: Interleave,
    ) -> Result<Stream<'m>, StreamError> {
        Scene::new(spec, screen, materials, interleave).map(Stream::Scene)
    }

    /// Pieces that follow each other.
    #[must_use]
    pub fn tiles(&self) -> u64 {
        match self {
            Stream::Texels(texels) => texels.tiles(),
            Stream::Scene(scene) => scene.tiles(),
        }
    }

    /// All demands.
    #[must_use]
    pub fn demands(&self) -> StreamDemands<'_> {
        self.part(0..self.tiles())
    }

    /// The demands of one tile; one that does not exist has none.
    #[must_use]
    pub fn tile(&self, index: u64) -> StreamDemands<'_> {
        self.part(index..index.saturating_add(1))
    }

    /// The demands of some tiles.
    #[must_use]
    pub fn part(&self, tiles: Range<u64>) -> StreamDemands<'_> {
        match self {
            Stream::Texels(texels) => StreamDemands::Texels(texels.part(tiles)),
            Stream::Scene(scene) => StreamDemands::Scene(scene.part(tiles)),
        }
    }
}

/// See [`Stream::part`].
#[derive(Clone, Debug)]
pub enum StreamDemands<'s> {
    /// Of a texel scan.
    Texels(TexelDemands<'s>),
    /// Of a scene.
    Scene(SceneDemands<'s>),
}

impl Demands for StreamDemands<'_> {
    type Error = Infallible;

    fn advance(&mut self, demand: &mut Demand) -> Result<bool, Infallible> {
        match self {
            StreamDemands::Texels(texels) => texels.advance(demand),
            StreamDemands::Scene(scene) => scene.advance(demand),
        }
    }
}
