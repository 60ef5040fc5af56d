//! FIFO: how deep the corner FIFO has to be to hide the memory's latency.
//!
//! Igehy, Eldridge and Proudfoot (1998) measure a prefetching texture cache against one whose memory has
//! no latency, and find that a FIFO deep enough reaches 97 % of it or more. Here the same curve is
//! drawn for the synthesizer and for a control that decodes a quad a cycle.

use super::bench::{Bench, Scene, middle_unit};
use super::{Counter, LabError, Sizes};
use ntmu_isa::layout::Layout;
use ntmu_isa::{Asset, Program};
use ntmu_model::Material;
use ntmu_model::control::{Bc7, Order};
use ntmu_model::time::Unit;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Depths tried, in texels.
pub const DEPTHS: [u32; 9] = [4, 8, 16, 32, 64, 128, 256, 512, 1024];

/// Latencies tried, in cycles of the unit.
pub const LATENCIES: [u32; 4] = [100, 200, 400, 800];

/// The share of the performance without latency that Igehy and others reach.
pub const ENOUGH: f64 = 0.97;

/// The control's channels per map.
const MAP_CHANNELS: u16 = 4;

/// Curves of one unit on one scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FifoStudy {
    /// The unit, before depth and latency are changed. It has more miss registers than its preset, so
    /// that they hide no more and no less than the FIFO lets them.
    pub unit: String,
    /// The scene.
    pub scene: String,
    /// The layout of the asset; the control has blocks in tiles of 4×4.
    pub layout: String,
    /// Depths of the FIFO, in texels.
    pub depths: Vec<u32>,
    /// For each subject and latency.
    pub curves: Vec<FifoCurve>,
}

/// One subject behind one latency.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FifoCurve {
    /// What is decoded: the asset's name or the control's.
    pub subject: String,
    /// From a miss to the first byte, in cycles.
    pub latency_cycles: u32,
    /// Cycles without latency, with the deepest FIFO.
    pub cycles_without_latency: u64,
    /// Cycles at each depth.
    pub cycles: Vec<u64>,
    /// `cycles_without_latency` / `cycles`.
    pub relative: Vec<f64>,
    /// The smallest depth that reaches [`ENOUGH`], in texels; none where no depth does.
    pub enough_texels: Option<u32>,
}

/// The unit with another depth and another latency.
fn unit_of(unit: &Unit, depth: u32, latency: u32) -> Result<Unit, LabError> {
    let (depth, latency) = (depth.to_string(), latency.to_string());
    Ok(unit.with(&[
        ("corner_fifo_texels", &depth),
        ("memory_latency_cycles", &latency),
    ])?)
}

/// Runs of [`FifoStudy::run`].
pub(super) fn runs() -> usize {
    2 * (1 + DEPTHS.len() * LATENCIES.len())
}

impl FifoStudy {
    /// Every depth at every latency, for the asset and a BC7 control with as many maps as its channels fill.
    pub(super) fn run(
        asset: &Asset,
        sizes: &Sizes,
        counter: &Counter<'_>,
    ) -> Result<FifoStudy, LabError> {
        let bench = Bench::new(asset, Scene::tiled_plane(asset, sizes.sweep_pixels))?;
        let layout = Layout::TILED;
        let unit = middle_unit().with(&[("mshrs", "4096")])?;
        let program = Program::compile(asset, layout);
        let maps = asset.shape.channel_count().div_ceil(MAP_CHANNELS);
        let control = Bc7::new(&asset.shape, maps, Order::Blocked { side: 4 })?;
        let name = format!("BC7, {maps} maps");
        let subjects = [
            [Material::new(&asset.metadata.name, asset, &program)],
            [Material::with_addresses(name, control.work(), control)],
        ];
        let deepest = DEPTHS[DEPTHS.len() - 1];
        let mut cases = Vec::new();
        for subject in 0..subjects.len() {
            cases.push((subject, deepest, 0));
            for latency in LATENCIES {
                cases.extend(DEPTHS.map(|depth| (subject, depth, latency)));
            }
        }
        let cycles: Result<Vec<u64>, LabError> = cases
            .par_iter()
            .map(|&(subject, depth, latency)| {
                let unit = unit_of(&unit, depth, latency)?;
                let timing = bench.run(&subjects[subject], &unit, &mut ())?;
                counter.one();
                Ok(timing.cycles)
            })
            .collect();
        let cycles = cycles?;
        let per_subject = cycles.chunks(cases.len() / subjects.len());
        let curves = per_subject.zip(&subjects).flat_map(|(cycles, [subject])| {
            let depths = cycles[1..].chunks(DEPTHS.len());
            let curve = |(cycles_of, latency): (&[u64], u32)| {
                FifoCurve::new(subject.name(), latency, cycles[0], cycles_of)
            };
            depths.zip(LATENCIES).map(curve).collect::<Vec<_>>()
        });
        Ok(FifoStudy {
            unit: unit.identity(),
            scene: bench.scene(),
            layout: layout.to_string(),
            depths: DEPTHS.to_vec(),
            curves: curves.collect(),
        })
    }
}

impl FifoCurve {
    fn new(subject: &str, latency_cycles: u32, without: u64, cycles: &[u64]) -> FifoCurve {
        let relative: Vec<f64> = cycles
            .iter()
            .map(|&cycles| without as f64 / cycles as f64)
            .collect();
        let enough = relative.iter().position(|&share| share >= ENOUGH);
        FifoCurve {
            subject: subject.to_owned(),
            latency_cycles,
            cycles_without_latency: without,
            cycles: cycles.to_vec(),
            relative,
            enough_texels: enough.map(|index| DEPTHS[index]),
        }
    }
}
