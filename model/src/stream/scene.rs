//! Scenes: what the pixels of a screen ask, from what they see.

use super::StreamError;
use super::geometry::{Geometry, Hit, View};
use super::hash::random_bits;
use super::interleave::Interleave;
use super::walk::{Points, Walk};
use crate::demand::{Demand, Demands};
use crate::sampler::Sampled;
use ntmu_isa::sampler::{Detail, SampleRequest};
use std::convert::Infallible;
use std::ops::Range;

/// What the camera sees, and in which order and how its pixels ask.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SceneSpec {
    /// See [`Geometry`].
    pub geometry: Geometry,
    /// See [`PixelOrder`].
    pub order: PixelOrder,
    /// See [`DetailKind`].
    pub detail: DetailKind,
}

/// The order of the screen's quads; the four pixels of a quad always follow each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum PixelOrder {
    /// Rows of quads.
    Raster,
    /// Rows of square tiles, each rows of quads, as rasterisers do.
    Tiles {
        /// Pixels along a tile; even.
        side: u32,
    },
    /// Z-order (Morton).
    ZOrder,
}

impl PixelOrder {
    /// The smallest and the largest tile.
    pub const SIDES: (u32, u32) = (2, 1024);

    /// Whether quads lie within tiles, and tiles within bounds.
    #[must_use]
    pub const fn is_allowed(self) -> bool {
        let (low, high) = PixelOrder::SIDES;
        match self {
            PixelOrder::Raster | PixelOrder::ZOrder => true,
            PixelOrder::Tiles { side } => side.is_multiple_of(2) && side >= low && side <= high,
        }
    }
}

/// How a pixel says how coarse its sample is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum DetailKind {
    /// log2 of its longer gradient in texels: never anisotropic.
    Lod,
    /// Both gradients.
    Gradients,
}

/// Pixels along a side of a screen: the smallest and the largest.
pub const SCREEN: (u32, u32) = (1, 16_384);

/// A pixel that sees a texture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sample {
    /// Column and row on the screen.
    pub pixel: [u32; 2],
    /// The material that it shows.
    pub material: u16,
    /// What it asks; all numbers are finite.
    pub request: SampleRequest,
}

/// A scene on a screen, with materials.
///
/// A pixel that sees the sky, or nothing but a sampler's border, asks for nothing: its quad has fewer
/// than four demands, and so has a quad at an edge of a screen of odd size.
#[derive(Clone, Debug)]
pub struct Scene<'m> {
    view: View,
    detail: DetailKind,
    materials: &'m [Sampled],
    count: u16,
    interleave: Interleave,
    walk: Walk,
}

impl<'m> Scene<'m> {
    /// The scene on a screen of so many pixels along x and y.
    ///
    /// # Errors
    /// When the screen or a number of the scene is outside its range, or there is no material or more
    /// than a demand can number.
    pub fn new(
        spec: &SceneSpec,
        screen: [u32; 2],
        materials: &'m [Sampled],
        interleave: Interleave,
    ) -> Result<Scene<'m>, StreamError> {
        if screen.iter().any(|&s| s < SCREEN.0 || s > SCREEN.1) {
            return Err(StreamError::Screen { found: screen });
        }
        if let Some(parameter) = spec.geometry.refused() {
            return Err(StreamError::Parameter(parameter));
        }
        if let PixelOrder::Tiles { side } = spec.order
            && !spec.order.is_allowed()
        {
            return Err(StreamError::Tile {
                field: "order",
                found: side,
                allowed: PixelOrder::SIDES,
            });
        }
        if !interleave.is_allowed() {
            return Err(StreamError::Tile {
                field: "interleave",
                found: interleave.side(),
                allowed: Interleave::SIDES,
            });
        }
        let count = match u16::try_from(materials.len()) {
            Ok(count) if count > 0 => count,
            Ok(_) | Err(_) => {
                return Err(StreamError::Materials {
                    found: materials.len(),
                });
            }
        };
        let walk = match spec.order {
            PixelOrder::Raster => Walk::rows(screen, 2),
            PixelOrder::Tiles { side } => Walk::tiled(screen, side),
            PixelOrder::ZOrder => Walk::morton(screen),
        };
        Ok(Scene {
            view: View::new(spec.geometry, screen),
            detail: spec.detail,
            materials,
            count,
            interleave,
            walk,
        })
    }

    /// Pieces of the screen that [`Scene::part`] can give: the tiles of the order, 16 × 16 pixels in
    /// Z-order, strips of 64 × 2 pixels in rows.
    #[must_use]
    pub fn tiles(&self) -> u64 {
        self.walk.tiles()
    }

    /// The demands of some tiles; those that do not exist have none.
    #[must_use]
    pub fn part(&self, tiles: Range<u64>) -> SceneDemands<'_> {
        SceneDemands {
            samples: self.samples(tiles),
            next: Demand::default(),
        }
    }

    /// The samples behind the demands of some tiles.
    #[must_use]
    pub fn samples(&self, tiles: Range<u64>) -> Samples<'_> {
        Samples {
            scene: self,
            points: self.walk.points(tiles),
        }
    }

    /// How its pixels say how coarse their samples are.
    #[must_use]
    pub fn detail(&self) -> DetailKind {
        self.detail
    }

    /// The materials.
    #[must_use]
    pub fn materials(&self) -> &'m [Sampled] {
        self.materials
    }

    fn sample(&self, pixel: [u32; 2]) -> Option<Sample> {
        let material = self.interleave.material(pixel, self.count);
        let shape = self.materials[usize::from(material)].shape();
        let size = [shape.width, shape.height];
        let hit = self.view.hit(pixel, size)?;
        let detail = match self.detail {
            DetailKind::Gradients => Detail::Gradients {
                x: hit.dx.map(bits),
                y: hit.dy.map(bits),
            },
            DetailKind::Lod => Detail::Lod(bits(lod(&hit, size))),
        };
        Some(Sample {
            pixel,
            material,
            request: SampleRequest {
                place: hit.uv.map(bits),
                detail,
                random: random_bits(pixel),
            },
        })
    }
}

/// log2 of the longer gradient in texels of mip 0, Direct3D's isotropic rule.
fn lod(hit: &Hit, size: [u32; 2]) -> f64 {
    let square = |gradient: [f64; 2]| {
        let [x, y] = [0, 1].map(|axis| gradient[axis] * f64::from(size[axis]));
        x * x + y * y
    };
    0.5 * square(hit.dx).max(square(hit.dy)).log2()
}

/// The bits of the nearest f32 that is finite; what is no number is 0, as the sampler takes it.
fn bits(number: f64) -> u32 {
    if number.is_nan() {
        return 0;
    }
    let limit = f64::from(f32::MAX);
    (number.clamp(-limit, limit) as f32).to_bits()
}

/// See [`Scene::samples`].
#[derive(Clone, Debug)]
pub struct Samples<'s> {
    scene: &'s Scene<'s>,
    points: Points,
}

impl Iterator for Samples<'_> {
    type Item = Sample;

    fn next(&mut self) -> Option<Sample> {
        let scene = self.scene;
        self.points.find_map(|pixel| scene.sample(pixel))
    }
}

/// See [`Scene::part`].
#[derive(Clone, Debug)]
pub struct SceneDemands<'s> {
    samples: Samples<'s>,
    /// Being made; its memory goes round with that of the caller's.
    next: Demand,
}

impl Demands for SceneDemands<'_> {
    type Error = Infallible;

    fn advance(&mut self, demand: &mut Demand) -> Result<bool, Infallible> {
        let materials = self.samples.scene.materials;
        for sample in &mut self.samples {
            let sampled = &materials[usize::from(sample.material)];
            sampled.demand(&sample.request, &mut self.next);
            if self.next.places.is_empty() {
                continue;
            }
            self.next.pixel = sample.pixel;
            self.next.material = sample.material;
            std::mem::swap(demand, &mut self.next);
            return Ok(true);
        }
        Ok(false)
    }
}
