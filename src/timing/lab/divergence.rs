//! Divergence: what materials that take turns on the screen cost.
//!
//! The materials are copies of one asset, so whatever grows with their number is the price of the
//! change: jobs that close half empty, parameters that come in again, latents that share the cache.

use super::bench::{Bench, Scene, middle_unit};
use super::{Counter, LabError, Sizes};
use ntmu_isa::Asset;
use ntmu_isa::layout::Layout;
use ntmu_isa::sampler::Sampler;
use ntmu_model::stream::Interleave;
use ntmu_model::time::Unit;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Numbers of materials tried.
pub const MATERIALS: [usize; 5] = [1, 2, 4, 8, 16];

/// Jobs gathered at the same time.
pub const BINS: [u32; 2] = [1, 4];

const INTERLEAVES: [Interleave; 3] = [
    Interleave::QUADS,
    Interleave::Turns { side: 4 },
    Interleave::Turns { side: 16 },
];

/// Materials that the small weight SRAM has room for.
const SMALL_ROOM: u64 = 2;

/// Curves of one unit on one scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Divergence {
    /// The unit, before its bins and its weight SRAM are changed.
    pub unit: String,
    /// The scene.
    pub scene: String,
    /// The layout.
    pub layout: String,
    /// Bytes of one material's parameters.
    pub parameter_bytes: u64,
    /// Numbers of materials.
    pub materials: Vec<usize>,
    /// For each weight SRAM, interleave and number of bins.
    pub curves: Vec<DivergenceCurve>,
}

/// One weight SRAM, interleave and number of bins.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DivergenceCurve {
    /// Bytes of the weight SRAM.
    pub weight_sram_bytes: u64,
    /// `quads`, `tiles:4`, `tiles:16`.
    pub interleave: String,
    /// Jobs gathered at the same time.
    pub bins: u32,
    /// At each number of materials.
    pub points: Vec<DivergencePoint>,
}

/// One number of materials.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct DivergencePoint {
    /// Cycles per 4×4 block.
    pub cycles_per_block: f64,
    /// Times that a material's parameters came in.
    pub weight_fills: u64,
    /// Bytes of parameters from outside, per 4×4 block.
    pub weight_bytes_per_block: f64,
    /// Bytes of latents from memory, per 4×4 block.
    pub latent_bytes_per_block: f64,
    /// Texels of a job, on average.
    pub texels_per_job: f64,
}

/// Runs of [`Divergence::run`].
pub(super) fn runs() -> usize {
    2 * INTERLEAVES.len() * BINS.len() * MATERIALS.len()
}

fn unit_of(unit: &Unit, sram: u64, bins: u32) -> Result<Unit, LabError> {
    let (sram, bins) = (sram.to_string(), bins.to_string());
    Ok(unit.with(&[("weight_sram_bytes", &sram), ("material_bins", &bins)])?)
}

impl Divergence {
    /// Every number of materials in every interleave, with few and many bins, a large and a small SRAM.
    pub(super) fn run(
        asset: &Asset,
        sizes: &Sizes,
        counter: &Counter<'_>,
    ) -> Result<Divergence, LabError> {
        let unit = middle_unit();
        let layout = Layout::TILED;
        let side = sizes.sweep_pixels;
        let parameters = asset.parameter_bits().div_ceil(8);
        let small = (SMALL_ROOM * parameters).next_multiple_of(1024);
        let mut cases = Vec::new();
        for sram in [u64::from(unit.weight_sram_bytes), small] {
            for interleave in INTERLEAVES {
                cases.extend(BINS.map(|bins| (sram, interleave, bins)));
            }
        }
        let cases: Vec<_> = cases
            .into_iter()
            .flat_map(|case| MATERIALS.map(|copies| (case, copies)))
            .collect();
        let points: Result<Vec<DivergencePoint>, LabError> = cases
            .par_iter()
            .map(|&((sram, interleave, bins), copies)| {
                let scene = Scene::tiled_plane(asset, side);
                let bench = Bench::with(asset, scene, Sampler::default(), copies, interleave)?;
                let timing = bench.time(asset, layout, &unit_of(&unit, sram, bins)?)?;
                counter.one();
                Ok(DivergencePoint {
                    cycles_per_block: timing.cycles_per_block,
                    weight_fills: timing.weight_fills,
                    weight_bytes_per_block: timing.weight_bytes as f64 / timing.blocks,
                    latent_bytes_per_block: timing.latent_bytes as f64 / timing.blocks,
                    texels_per_job: timing.decodes as f64 / timing.jobs as f64,
                })
            })
            .collect();
        let points = points?;
        let curves = cases
            .chunks(MATERIALS.len())
            .zip(points.chunks(MATERIALS.len()));
        Ok(Divergence {
            unit: unit.identity(),
            scene: Scene::tiled_plane(asset, side).name(),
            layout: layout.to_string(),
            parameter_bytes: parameters,
            materials: MATERIALS.to_vec(),
            curves: curves
                .map(|(cases, points)| {
                    let ((weight_sram_bytes, interleave, bins), _) = cases[0];
                    DivergenceCurve {
                        weight_sram_bytes,
                        interleave: interleave.to_string(),
                        bins,
                        points: points.to_vec(),
                    }
                })
                .collect(),
        })
    }
}
