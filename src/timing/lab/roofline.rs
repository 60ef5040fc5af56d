//! Roofline: whether the array or the bytes set the pace (Williams, Waterman and Patterson 2009).

use super::bench::{Bench, Scene};
use super::{Counter, LabError, Sizes};
use crate::precision;
use ntmu_isa::layout::Layout;
use ntmu_isa::{Asset, Program};
use ntmu_model::time::work::Operands;
use ntmu_model::time::{Unit, Work, work_of};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Roofs and points of the presets.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Roofline {
    /// The layout.
    pub layout: String,
    /// The scenes, by the short name that points have: name and scene.
    pub scenes: Vec<(String, String)>,
    /// One a unit and kind of numbers.
    pub roofs: Vec<Roof>,
    /// One a roof and scene.
    pub points: Vec<Point>,
}

/// What a unit could do at best.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Roof {
    /// The unit's name.
    pub unit: String,
    /// The unit's name and hash.
    pub identity: String,
    /// What is multiplied: widths as `w7a8`, or `fp16`.
    pub numbers: String,
    /// Multiplications of these numbers in a cycle.
    pub macs_per_cycle: f64,
    /// Bytes of latents that memory delivers in a cycle.
    pub memory_bytes_per_cycle: f64,
    /// Bytes that the latent cache's banks can deliver in a cycle: a line for each tag looked up.
    pub cache_bytes_per_cycle: f64,
}

/// What a run did.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// The unit's name.
    pub unit: String,
    /// As its roof's.
    pub numbers: String,
    /// The short name of the scene.
    pub scene: String,
    /// Multiplications per cycle.
    pub macs_per_cycle: f64,
    /// Multiplications per byte of latents from memory.
    pub macs_per_memory_byte: f64,
    /// Multiplications per byte read from the latent cache.
    pub macs_per_cache_byte: f64,
}

/// The asset's own numbers, and halves where it can be had in them.
fn subjects(asset: &Asset) -> Vec<(String, Asset)> {
    let mut subjects = vec![(precision::of_asset(asset), asset.clone())];
    if let Ok(halves) = precision::in_halves(asset) {
        subjects.push(("fp16".to_owned(), halves));
    }
    subjects
}

const SCENES: usize = 3;

/// Runs of [`Roofline::run`].
pub(super) fn runs(asset: &Asset) -> usize {
    subjects(asset).len() * Unit::presets().len() * SCENES
}

/// Multiplications in a cycle when the array is never without.
fn peak(unit: &Unit, work: &Work) -> f64 {
    let passes = |operands| match operands {
        Operands::Narrow => 1.0 / f64::from(unit.narrow_columns),
        Operands::Bytes => 1.0,
        Operands::Wide => f64::from(unit.wide_passes),
        Operands::Half => f64::from(unit.half_passes),
    };
    let layers = work.dense.iter();
    let cycles: f64 = layers.map(|d| d.macs() as f64 * passes(d.operands)).sum();
    unit.macs_per_cycle() as f64 * work.macs() as f64 / cycles
}

impl Roofline {
    /// Every preset on a scan, a floor and random texels, in the asset's numbers and in halves.
    pub(super) fn run(
        asset: &Asset,
        sizes: &Sizes,
        counter: &Counter<'_>,
    ) -> Result<Roofline, LabError> {
        let layout = Layout::TILED;
        let side = sizes.sweep_pixels;
        let scenes: [(&str, Scene); SCENES] = [
            ("blocks", Scene::blocks(asset, side)),
            ("plane", Scene::tiled_plane(asset, side)),
            (
                "random",
                Scene::random(u64::from(side) * u64::from(side) / 4),
            ),
        ];
        let subjects = subjects(asset);
        let units = Unit::presets();
        let mut roofs = Vec::new();
        let mut cases = Vec::new();
        for (numbers, asset) in &subjects {
            let work = work_of(asset, &Program::compile(asset, layout));
            for unit in &units {
                let lookups = u64::from(unit.cache_banks) * u64::from(unit.lookups_per_bank);
                roofs.push(Roof {
                    unit: unit.name().to_owned(),
                    identity: unit.identity(),
                    numbers: numbers.clone(),
                    macs_per_cycle: peak(unit, &work),
                    memory_bytes_per_cycle: f64::from(unit.memory_bytes_per_cycle),
                    cache_bytes_per_cycle: (lookups * u64::from(unit.line_bytes)) as f64,
                });
                cases.extend(scenes.iter().map(|scene| (numbers, asset, unit, scene)));
            }
        }
        let points: Result<Vec<Point>, LabError> = cases
            .par_iter()
            .map(|(numbers, asset, unit, (name, scene))| {
                let bench = Bench::new(asset, scene.clone())?;
                let timing = bench.time(asset, layout, unit)?;
                counter.one();
                let macs = timing.macs as f64;
                Ok(Point {
                    unit: unit.name().to_owned(),
                    numbers: (*numbers).clone(),
                    scene: (*name).to_owned(),
                    macs_per_cycle: macs / timing.cycles as f64,
                    macs_per_memory_byte: macs / timing.latent_bytes as f64,
                    macs_per_cache_byte: macs / timing.operations.l1_read_bytes as f64,
                })
            })
            .collect();
        Ok(Roofline {
            layout: layout.to_string(),
            scenes: scenes
                .map(|(name, scene)| (name.to_owned(), scene.name()))
                .to_vec(),
            roofs,
            points: points?,
        })
    }
}
