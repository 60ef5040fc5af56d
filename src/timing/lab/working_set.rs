//! Working set: how large the cache has to be.
//!
//! Hakura and Gupta (1997) measure miss rates over cache sizes, and find that with blocked textures and
//! tiled rasterisation 16 KiB or less hold the first working set. Here the same curve is drawn for an
//! uncompressed RGBA8 texture, which is theirs, and for latents.

use super::bench::{Bench, Scene, TILE, middle_unit};
use super::{Counter, LabError, Sizes};
use ntmu_isa::layout::Layout;
use ntmu_isa::{Asset, Program};
use ntmu_model::Material;
use ntmu_model::control::{Order, Plain};
use ntmu_model::stream::PixelOrder;
use ntmu_model::time::Unit;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Sizes tried, in bytes.
pub const CACHES: [u64; 9] = [512, 1024, 2048, 4096, 8192, 16_384, 32_768, 65_536, 131_072];

/// Bytes of a line.
const LINE: u64 = 64;

/// A knee is where the bytes are within this factor of those of the largest cache.
pub const KNEE: f64 = 1.25;

/// The orders in which a screen's pixels ask.
const ORDERS: [PixelOrder; 2] = [PixelOrder::Raster, PixelOrder::Tiles { side: TILE }];

/// Curves in each order of pixels.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WorkingSet {
    /// The unit, before its cache is changed. It is fully associative up to its 256 ways.
    pub unit: String,
    /// Bytes of a line.
    pub line_bytes: u64,
    /// Sizes of the cache, in bytes.
    pub cache_bytes: Vec<u64>,
    /// One order of pixels each.
    pub panels: Vec<Panel>,
}

/// One order of pixels.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Panel {
    /// The scene.
    pub scene: String,
    /// One subject each.
    pub curves: Vec<SizeCurve>,
}

/// One subject.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SizeCurve {
    /// What is fetched, and its order in memory.
    pub subject: String,
    /// Bytes of latents or texels from memory for each pixel, at each size.
    pub bytes_per_pixel: Vec<f64>,
    /// Lookups that had to ask memory over lookups, 0 to 1, at each size.
    pub miss_rate: Vec<f64>,
    /// The smallest cache with at most [`KNEE`] times the bytes of the largest.
    pub knee_bytes: u64,
}

/// Subjects of a panel.
const SUBJECTS: usize = 4;

/// Runs of [`WorkingSet::run`].
pub(super) fn runs() -> usize {
    ORDERS.len() * SUBJECTS * CACHES.len()
}

/// The unit with another cache: one set as long as the ways suffice.
fn unit_of(unit: &Unit, bytes: u64) -> Result<Unit, LabError> {
    let ways = (bytes / LINE).min(256);
    let sets = bytes / LINE / ways;
    let changes = [
        ("line_bytes", LINE.to_string()),
        ("cache_ways", ways.to_string()),
        ("cache_sets", sets.to_string()),
        ("cache_banks", "1".to_owned()),
        ("lookups_per_bank", "16".to_owned()),
    ];
    let changes: Vec<(&str, &str)> = changes.iter().map(|(n, v)| (*n, v.as_str())).collect();
    Ok(unit.with(&changes)?)
}

impl WorkingSet {
    /// Every size, for latents and for one RGBA8 map, each in rows and in tiles.
    pub(super) fn run(
        asset: &Asset,
        sizes: &Sizes,
        counter: &Counter<'_>,
    ) -> Result<WorkingSet, LabError> {
        let unit = middle_unit();
        let programs = [Layout::LINEAR, Layout::TILED].map(|l| (l, Program::compile(asset, l)));
        let mut subjects = Vec::with_capacity(SUBJECTS);
        for (layout, program) in &programs {
            let name = format!("latents, {layout}");
            subjects.push([Material::new(name, asset, program)]);
        }
        for (order, name) in [
            (Order::Rows, "RGBA8, rows"),
            (Order::Blocked { side: 8 }, "RGBA8, 8×8 blocks"),
        ] {
            let plain = Plain::new(&asset.shape, 1, order)?;
            subjects.push([Material::with_addresses(name, plain.work(), plain)]);
        }
        let units: Result<Vec<Unit>, LabError> =
            CACHES.iter().map(|&bytes| unit_of(&unit, bytes)).collect();
        let units = units?;
        let panel = |order| -> Result<Panel, LabError> {
            let scene = Scene::plane(asset, sizes.sweep_pixels, order);
            let bench = Bench::new(asset, scene)?;
            let cases: Vec<_> = subjects
                .iter()
                .flat_map(|subject| units.iter().map(move |unit| (subject, unit)))
                .collect();
            let points: Result<Vec<(f64, f64)>, LabError> = cases
                .par_iter()
                .map(|(subject, unit)| {
                    let timing = bench.run(*subject, unit, &mut ())?;
                    counter.one();
                    let bytes = timing.latent_bytes as f64 / timing.pixels as f64;
                    Ok((bytes, timing.misses as f64 / timing.lookups as f64))
                })
                .collect();
            let points = points?;
            let curves = subjects.iter().zip(points.chunks(CACHES.len()));
            Ok(Panel {
                scene: bench.scene(),
                curves: curves
                    .map(|([subject], points)| SizeCurve::new(subject.name(), points))
                    .collect(),
            })
        };
        let panels: Result<Vec<Panel>, LabError> = ORDERS.into_iter().map(panel).collect();
        Ok(WorkingSet {
            unit: unit.identity(),
            line_bytes: LINE,
            cache_bytes: CACHES.to_vec(),
            panels: panels?,
        })
    }
}

impl SizeCurve {
    fn new(subject: &str, points: &[(f64, f64)]) -> SizeCurve {
        let (bytes_per_pixel, miss_rate): (Vec<f64>, Vec<f64>) = points.iter().copied().unzip();
        let least = bytes_per_pixel[bytes_per_pixel.len() - 1];
        let knee = bytes_per_pixel
            .iter()
            .position(|&bytes| bytes <= KNEE * least);
        SizeCurve {
            subject: subject.to_owned(),
            knee_bytes: CACHES[knee.unwrap_or(CACHES.len() - 1)],
            bytes_per_pixel,
            miss_rate,
        }
    }
}
