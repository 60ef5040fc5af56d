//! Table: what a texel block costs, for the shape of every preset on every unit, and what it costs
//! where the set is stored as games store it.
//!
//! The assets are synthetic: time depends on a set's shape and on the order of the demands, and on no
//! number in it. Every row is held against the control of its unit and scene: the same demands on the
//! same front end, with the set in BC7.

pub mod document;
pub mod figures;

pub use figures::Figures;

use ntmu_conformance::synthetic::{self, Spec, SpecPrecision};
use ntmu_isa::layout::{Layout, LayoutError};
use ntmu_isa::preset::Preset;
use ntmu_isa::profile::Profile;
use ntmu_isa::sampler::{Sampler, SamplerError};
use ntmu_isa::shape::{OutputFormat, Shape};
use ntmu_isa::{Asset, AssetError, Program};
use ntmu_model::Material;
use ntmu_model::control::{Bc7, ControlError, Order};
use ntmu_model::sampler::Sampled;
use ntmu_model::stream::{AccessSpec, Interleave, SpecError, Stream, StreamError};
use ntmu_model::time::energy::{EnergyError, EnergyTable};
use ntmu_model::time::{Unit, UnitError};
use rayon::prelude::*;
use serde::Serialize;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};

/// Channels of every set: colour, normal, roughness, metalness or occlusion, height.
pub const CHANNELS: u16 = 9;
/// The seed of the synthetic assets.
pub const SEED: u64 = 1;
/// Channels of a map in BC7.
const MAP_CHANNELS: u16 = 4;
/// Where the control's blocks lie: Morton order in tiles of 8×8 blocks.
pub const CONTROL_ORDER: Order = Order::Morton { side: 8 };
/// Texels along both sides of a set unless another size is asked for.
pub const SIZE: u32 = 512;
/// Pixels of a scene's screen unless another is asked for.
pub const SCREEN: [u32; 2] = [256, 256];
/// The scenes unless others are named: every texel of mip 0, each decoded once, and a floor that
/// fills the screen from magnified at its lower edge to some mips at its upper one.
pub const ACCESSES: [&str; 2] = ["blocks:mip=0", "plane:pitch=40,size=8"];

/// What a table is about.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The units. One whose weights of four bits are faster than those of eight gets rows for them.
    pub units: Vec<Unit>,
    /// The shapes.
    pub presets: Vec<Preset>,
    /// Generated streams; files are refused.
    pub accesses: Vec<AccessSpec>,
    /// Texels along both sides of the sets' mip 0.
    pub size: u32,
    /// Pixels of a scene's screen; a texel scan has none.
    pub screen: [u32; 2],
    /// Where memory keeps the grids.
    pub layout: Layout,
    /// The prices of operations.
    pub energy: EnergyTable,
}

/// Why there is no such table.
#[derive(Debug, thiserror::Error)]
pub enum TableError {
    /// A set of this size, or a preset, is beyond the limits of an asset.
    #[error("{preset}: {source}")]
    Asset {
        /// The preset.
        preset: &'static str,
        /// What is refused.
        source: AssetError,
    },
    /// The layout does not fit the shape.
    #[error("{preset}: {source}")]
    Layout {
        /// The preset.
        preset: &'static str,
        /// What is refused.
        source: LayoutError,
    },
    /// There is no control of this size.
    #[error(transparent)]
    Control(#[from] ControlError),
    /// There is no such stream for a set of this size.
    #[error("{access}: {source}")]
    Stream {
        /// The stream.
        access: String,
        /// What is refused.
        source: StreamError,
    },
    /// A trilinear sampler does not fit the shape.
    #[error(transparent)]
    Sampler(#[from] SamplerError),
    /// A trace file names no shape that every preset could have.
    #[error("access: found the file {}; allowed: a generated stream", path.display())]
    File {
        /// The file.
        path: PathBuf,
    },
    /// No such stream.
    #[error("access: {0}")]
    Access(#[from] SpecError),
    /// No such unit.
    #[error(transparent)]
    Unit(#[from] UnitError),
    /// No such table of energies.
    #[error(transparent)]
    Energy(#[from] EnergyError),
}

/// What is decoded in a row.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Subject {
    /// The preset's name, or `BC7`.
    pub name: String,
    /// The arithmetic of its layers; empty where there are none.
    pub precision: String,
    /// The identity of the asset's profile; empty where there is none.
    pub profile: String,
}

/// One subject on one unit in one scene.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// What is decoded.
    pub subject: Subject,
    /// The unit's identity.
    pub unit: String,
    /// The stream, in full.
    pub access: String,
    /// What it costs.
    pub figures: Figures,
    /// Cycles, bytes and picojoules, each divided by the control's.
    pub to_control: Ratios,
}

/// Quotients of two rows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Ratios {
    /// Of cycles per block.
    pub cycles: f64,
    /// Of bytes per block.
    pub bytes: f64,
    /// Of picojoules per block.
    pub picojoules: f64,
}

/// All rows: scene by scene, unit by unit, the control first.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Table {
    /// Texels along both sides of mip 0.
    pub size: u32,
    /// Channels of a set.
    pub channels: u16,
    /// Pixels of a scene's screen.
    pub screen: [u32; 2],
    /// The layout's name.
    pub layout: String,
    /// The identity of the table of energies.
    pub energy: String,
    /// The rows.
    pub rows: Vec<Row>,
}

/// A subject with what its runs need.
struct Candidate {
    subject: Subject,
    precision: Option<SpecPrecision>,
    decoded: Decoded,
}

enum Decoded {
    Set(Box<(Asset, Program)>),
    Control(Bc7),
}

impl Candidate {
    fn material(&self) -> Material<'_> {
        let name = self.subject.name.as_str();
        match &self.decoded {
            Decoded::Set(set) => Material::new(name, &set.0, &set.1),
            Decoded::Control(bc7) => Material::with_addresses(name, bc7.work(), bc7.clone()),
        }
    }

    /// Weights of four bits are a row of their own only where they are faster.
    fn belongs_to(&self, unit: &Unit) -> bool {
        match self.precision {
            None | Some(SpecPrecision::Int8 | SpecPrecision::Fp16) => true,
            Some(SpecPrecision::Int4) => unit.narrow_columns > 1,
            Some(SpecPrecision::Mixed) => false,
        }
    }
}

impl Plan {
    /// Every preset on these units in the usual scenes, at sizes that make the table in a minute or
    /// two. Without units: the preset units and, so that there is one with a faster rate for weights
    /// of four bits, the largest with an array that splits its multipliers.
    ///
    /// # Errors
    /// None, as the tests show: all that is named here exists.
    pub fn usual(units: Vec<Unit>) -> Result<Plan, TableError> {
        let units = if units.is_empty() {
            let split = Unit::desktop().with(&[("narrow_columns", "2")])?;
            Unit::presets().into_iter().chain([split]).collect()
        } else {
            units
        };
        let accesses = ACCESSES.iter().map(|text| text.parse());
        Ok(Plan {
            units,
            presets: Preset::ALL.to_vec(),
            accesses: accesses.collect::<Result<_, _>>()?,
            size: SIZE,
            screen: SCREEN,
            layout: Layout::TILED,
            energy: EnergyTable::by_name("energy")?,
        })
    }

    /// Rows that [`run`] makes.
    #[must_use]
    pub fn rows(&self) -> u64 {
        let of_unit = |unit: &Unit| {
            let precisions = if unit.narrow_columns > 1 { 3 } else { 2 };
            1 + precisions * self.presets.len()
        };
        let rows: usize = self.units.iter().map(of_unit).sum();
        (rows * self.accesses.len()) as u64
    }

    /// The shape of a set without its grids: what the controls and the scenes know of it.
    fn shape(&self, preset: &Preset) -> Shape {
        let outputs = vec![OutputFormat::Unorm8; usize::from(CHANNELS)];
        preset.shape(self.size, self.size, self.mip_count(), outputs)
    }

    fn mip_count(&self) -> u8 {
        Shape::max_mip_count(self.size.max(1), self.size.max(1))
    }

    fn set(&self, preset: &Preset, precision: SpecPrecision) -> Result<Candidate, TableError> {
        let (size, mips) = (self.size, self.mip_count());
        let spec = Spec::of_preset(preset, size, size, CHANNELS, mips, precision);
        let asset = synthetic::asset(&spec, SEED).map_err(|source| TableError::Asset {
            preset: preset.name,
            source,
        })?;
        let fits = self.layout.check(&asset.shape);
        fits.map_err(|source| TableError::Layout {
            preset: preset.name,
            source,
        })?;
        let program = Program::compile(&asset, self.layout);
        Ok(Candidate {
            subject: Subject {
                name: preset.name.to_owned(),
                precision: precision.name().to_owned(),
                profile: asset.profile.identity(),
            },
            precision: Some(precision),
            decoded: Decoded::Set(Box::new((asset, program))),
        })
    }

    /// The control, and every preset in every precision that one of the units has a row for.
    fn candidates(&self) -> Result<Vec<Candidate>, TableError> {
        let Some(first) = self.presets.first() else {
            return Ok(Vec::new());
        };
        // Before anything as large as the size says is made.
        let maps = CHANNELS.div_ceil(MAP_CHANNELS);
        let control = Candidate {
            subject: Subject {
                name: "BC7".to_owned(),
                precision: String::new(),
                profile: String::new(),
            },
            precision: None,
            decoded: Decoded::Control(Bc7::new(&self.shape(first), maps, CONTROL_ORDER)?),
        };
        let is_split = self.units.iter().any(|unit| unit.narrow_columns > 1);
        let narrow = is_split.then_some(SpecPrecision::Int4);
        let precisions: Vec<SpecPrecision> = [SpecPrecision::Int8, SpecPrecision::Fp16]
            .into_iter()
            .chain(narrow)
            .collect();
        let pairs: Vec<(Preset, SpecPrecision)> = self
            .presets
            .iter()
            .flat_map(|&preset| precisions.iter().map(move |&precision| (preset, precision)))
            .collect();
        let sets: Vec<Candidate> = pairs
            .par_iter()
            .map(|(preset, precision)| self.set(preset, *precision))
            .collect::<Result<_, _>>()?;
        Ok([control].into_iter().chain(sets).collect())
    }

    fn stream<'m>(
        &self,
        access: &AccessSpec,
        materials: &'m [Sampled],
    ) -> Result<Stream<'m>, TableError> {
        let stream = match access {
            AccessSpec::Texels(spec) => Stream::texels(spec, materials),
            AccessSpec::Scene(spec) => {
                Stream::scene(spec, self.screen, materials, Interleave::QUADS)
            }
            AccessSpec::File(path) => return Err(TableError::File { path: path.clone() }),
        };
        stream.map_err(|source| TableError::Stream {
            access: access.to_string(),
            source,
        })
    }
}

/// Runs the plan, on all cores. `after_row` is called with the rows done.
///
/// # Errors
/// When a set of this size, or the layout, or a stream is refused.
pub fn run(plan: &Plan, after_row: impl Fn(u64) + Sync) -> Result<Table, TableError> {
    let candidates = plan.candidates()?;
    // Where the decodes lie is the same for all: it depends on the chain and the sampler.
    let sampled: Vec<Sampled> = plan
        .presets
        .first()
        .map(|preset| Sampled::new(plan.shape(preset), Sampler::default(), Profile::NORMATIVE))
        .into_iter()
        .collect::<Result<_, _>>()?;
    let mut runs = Vec::new();
    for access in &plan.accesses {
        let stream = plan.stream(access, &sampled)?;
        for unit in &plan.units {
            let of_unit = candidates.iter().filter(|c| c.belongs_to(unit));
            runs.extend(of_unit.map(|c| (access.to_string(), stream.clone(), unit, c)));
        }
    }
    let done = AtomicU64::new(0);
    let mut rows: Vec<Row> = runs
        .par_iter()
        .map(|(access, stream, unit, candidate)| {
            let materials = [candidate.material()];
            let row = Row {
                subject: candidate.subject.clone(),
                unit: unit.identity(),
                access: access.clone(),
                figures: Figures::of(unit, &materials, stream, &plan.energy),
                to_control: Ratios::default(),
            };
            after_row(done.fetch_add(1, Ordering::Relaxed) + 1);
            row
        })
        .collect();
    let mut control: Option<Figures> = None;
    for row in &mut rows {
        if row.subject.precision.is_empty() {
            control = Some(row.figures.clone());
        }
        if let Some(control) = &control {
            row.to_control = row.figures.over(control);
        }
    }
    Ok(Table {
        size: plan.size,
        channels: CHANNELS,
        screen: plan.screen,
        layout: plan.layout.to_string(),
        energy: plan.energy.identity(),
        rows,
    })
}
