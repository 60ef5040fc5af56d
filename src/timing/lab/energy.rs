//! Energy: where the energy of a published table goes, with three ways to filter.
//!
//! Picojoules of the table rank designs; they are no estimate of a chip's power.

use super::bench::{Bench, Scene};
use super::{Counter, LabError, Sizes};
use ntmu_isa::Asset;
use ntmu_isa::layout::Layout;
use ntmu_isa::sampler::{Order, Sampler};
use ntmu_model::stream::Interleave;
use ntmu_model::time::Unit;
use ntmu_model::time::energy::{EnergyTable, Operation};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// The table.
const TABLE: &str = "energy";

/// Blocks of the decoded-texel cache where there is one.
const DECODED_BLOCKS: &str = "64";

/// Bars of the presets.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EnergyStudy {
    /// The table's name and hash.
    pub table: String,
    /// The scene.
    pub scene: String,
    /// The layout.
    pub layout: String,
    /// What the energy is divided among.
    pub parts: Vec<String>,
    /// One a unit and way.
    pub bars: Vec<EnergyBar>,
}

/// One unit that filters one way.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EnergyBar {
    /// The unit's name.
    pub unit: String,
    /// The unit's name and hash.
    pub identity: String,
    /// The way to filter.
    pub way: String,
    /// Decodes for each pixel.
    pub decodes_per_pixel: f64,
    /// Cycles per 4×4 block.
    pub cycles_per_block: f64,
    /// Picojoules of the table per 4×4 block, in the order of [`EnergyStudy::parts`].
    pub picojoules_per_block: Vec<f64>,
}

/// The parts, in the order of the texel's journey.
const PARTS: [&str; 9] = [
    "memory",
    "second level",
    "latent cache and tags",
    "addresses to inputs",
    "parameters from outside",
    "weight SRAM",
    "multiplications",
    "activations",
    "filter and output",
];

/// The part that an operation belongs to.
const fn part(operation: Operation) -> usize {
    match operation {
        Operation::MemoryBytes => 0,
        Operation::L2ReadBytes | Operation::L2FillBytes => 1,
        Operation::TagLookups | Operation::L1ReadBytes | Operation::L1FillBytes => 2,
        Operation::AddressSteps
        | Operation::UnpackedLatents
        | Operation::Interpolations
        | Operation::Embedded => 3,
        Operation::WeightFillBytes => 4,
        Operation::WeightSramReadBytes => 5,
        Operation::MacsBytes
        | Operation::MacsNarrow
        | Operation::MacsWide
        | Operation::MacsHalf => 6,
        Operation::Requantised | Operation::SkipAdds | Operation::ActivationBytes => 7,
        Operation::DecodedCacheReadBytes
        | Operation::DecodedCacheFillBytes
        | Operation::FilteredCodes
        | Operation::OutputBytes => 8,
    }
}

/// Ways to filter: a name, the sampler's order, and whether decoded texels are kept.
const WAYS: [(&str, Order, bool); 3] = [
    ("decode, then filter", Order::DecodeThenFilter, false),
    (
        "the same, decoded texels kept",
        Order::DecodeThenFilter,
        true,
    ),
    ("filter, then decode", Order::FilterThenDecode, false),
];

/// Runs of [`EnergyStudy::run`].
pub(super) fn runs() -> usize {
    WAYS.len() * Unit::presets().len()
}

impl EnergyStudy {
    /// Every preset with every way to filter, trilinearly, on the floor.
    pub(super) fn run(
        asset: &Asset,
        sizes: &Sizes,
        counter: &Counter<'_>,
    ) -> Result<EnergyStudy, LabError> {
        let table = EnergyTable::by_name(TABLE)?;
        let layout = Layout::TILED;
        let scene = Scene::tiled_plane(asset, sizes.sweep_pixels);
        let units = Unit::presets();
        let cases: Vec<_> = units
            .iter()
            .flat_map(|unit| WAYS.map(|way| (unit, way)))
            .collect();
        let bars: Result<Vec<EnergyBar>, LabError> = cases
            .par_iter()
            .map(|&(preset, (way, order, keeps))| {
                let sampler = Sampler {
                    order,
                    ..Sampler::default()
                };
                let bench = Bench::with(asset, scene.clone(), sampler, 1, Interleave::QUADS)?;
                let unit = if keeps {
                    preset.with(&[("decoded_cache_blocks", DECODED_BLOCKS)])?
                } else {
                    preset.clone()
                };
                let timing = bench.time(asset, layout, &unit)?;
                counter.one();
                let mut parts = vec![0.0; PARTS.len()];
                for level in table.of(&timing.operations, &unit).levels {
                    parts[part(level.operation)] += level.picojoules / timing.blocks;
                }
                Ok(EnergyBar {
                    unit: preset.name().to_owned(),
                    identity: unit.identity(),
                    way: way.to_owned(),
                    decodes_per_pixel: timing.decodes as f64 / timing.pixels as f64,
                    cycles_per_block: timing.cycles_per_block,
                    picojoules_per_block: parts,
                })
            })
            .collect();
        Ok(EnergyStudy {
            table: table.identity(),
            scene: scene.name(),
            layout: layout.to_string(),
            parts: PARTS.map(str::to_owned).to_vec(),
            bars: bars?,
        })
    }
}
