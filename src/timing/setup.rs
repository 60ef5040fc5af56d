//! Setup: what is run, checked.

use crate::isa::layout::{Layout, LayoutError};
use crate::isa::sampler::{Sampler, SamplerError};
use crate::isa::{Asset, Program};
use crate::model::Material;
use crate::model::sampler::Sampled;
use crate::model::stream::{AccessSpec, Interleave};
use crate::model::time::Unit;
use serde::Serialize;

/// What is to be run, unchecked.
#[derive(Clone, Debug)]
pub struct Choices {
    /// The hardware.
    pub unit: Unit,
    /// The assets, one material each.
    pub assets: Vec<Asset>,
    /// How often the assets are taken, each time as materials of their own.
    pub copies: u32,
    /// Where memory keeps the grids.
    pub layout: Layout,
    /// Where the demands come from.
    pub access: AccessSpec,
    /// How samples are filtered; texel scans and files of texels are not.
    pub sampler: Sampler,
    /// Pixels of a scene's screen along x and y.
    pub screen: [u32; 2],
    /// How materials share a scene's screen.
    pub interleave: Interleave,
}

/// Why it cannot be run.
#[derive(Debug, thiserror::Error)]
pub enum SetupError {
    /// No asset, no copy, or more materials than a demand can number.
    #[error(
        "materials: found {found} ({assets} assets, {copies} copies of each); allowed: 1..={}",
        u16::MAX
    )]
    Materials {
        /// Materials.
        found: u64,
        /// Assets.
        assets: usize,
        /// Copies of each.
        copies: u32,
    },
    /// The layout does not suit an asset.
    #[error("{asset}: {error}")]
    Layout {
        /// The asset's name.
        asset: String,
        /// Why.
        error: LayoutError,
    },
    /// The sampler does not suit an asset.
    #[error("{asset}: {error}")]
    Sampler {
        /// The asset's name.
        asset: String,
        /// Why.
        error: SamplerError,
    },
}

/// What is run.
#[derive(Debug)]
pub struct Setup {
    choices: Choices,
    programs: Vec<Program>,
    sampled: Vec<Sampled>,
}

/// What a result was made with: every name with its hash, every choice as its text.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Identities {
    /// The unit.
    pub unit: String,
    /// The assets; with copies, each of them as many times.
    pub materials: Vec<MaterialIdentity>,
    /// How often the assets were taken.
    pub copies: u32,
    /// The layout.
    pub layout: String,
    /// The access with all its options.
    pub access: String,
    /// Pixels of the screen along x and y, for a scene.
    pub screen_pixels: Option<[u32; 2]>,
    /// How the materials share the screen, for a scene with more than one.
    pub interleave: Option<String>,
    /// The sampler, except for a texel scan.
    pub sampler: Option<Sampler>,
}

/// An asset of a run.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct MaterialIdentity {
    /// The asset's name.
    pub name: String,
    /// The profile by which it is decoded.
    pub profile: String,
    /// Texels of mip 0 along x and y.
    pub size_texels: [u32; 2],
    /// Multiplications of a texel.
    pub macs_per_texel: u64,
    /// Bytes of the grids in memory, in this layout.
    pub grid_bytes: u64,
    /// Bytes of parameters.
    pub parameter_bytes: u64,
}

impl Setup {
    /// The choices, checked against each other. The access is checked by
    /// [`Source::new`](super::source::Source::new), which reads it.
    ///
    /// # Errors
    /// The first choice that does not suit an asset.
    pub fn new(choices: Choices) -> Result<Setup, SetupError> {
        let found = choices.assets.len() as u64 * u64::from(choices.copies);
        if found == 0 || found > u64::from(u16::MAX) {
            return Err(SetupError::Materials {
                found,
                assets: choices.assets.len(),
                copies: choices.copies,
            });
        }
        let mut programs = Vec::new();
        let mut sampled = Vec::new();
        for asset in &choices.assets {
            let name = || asset.metadata.name.clone();
            let layout = choices.layout;
            layout
                .check(&asset.shape)
                .map_err(|error| SetupError::Layout {
                    asset: name(),
                    error,
                })?;
            programs.push(Program::compile(asset, layout));
            let (shape, profile) = (asset.shape.clone(), asset.profile);
            let one = Sampled::new(shape, choices.sampler.clone(), profile);
            sampled.push(one.map_err(|error| SetupError::Sampler {
                asset: name(),
                error,
            })?);
        }
        let once = sampled.len();
        let sampled = sampled.into_iter().cycle();
        let sampled = sampled.take(once * choices.copies as usize).collect();
        Ok(Setup {
            choices,
            programs,
            sampled,
        })
    }

    /// The hardware.
    #[must_use]
    pub fn unit(&self) -> &Unit {
        &self.choices.unit
    }

    /// Where the demands come from.
    #[must_use]
    pub fn access(&self) -> &AccessSpec {
        &self.choices.access
    }

    /// Pixels of a scene's screen along x and y.
    #[must_use]
    pub fn screen(&self) -> [u32; 2] {
        self.choices.screen
    }

    /// How materials share a scene's screen.
    #[must_use]
    pub fn interleave(&self) -> Interleave {
        self.choices.interleave
    }

    /// The materials' shapes behind the sampler, in the order of [`Setup::materials`].
    #[must_use]
    pub fn sampled(&self) -> &[Sampled] {
        &self.sampled
    }

    /// The materials: all assets, then all of them again for each further copy.
    #[must_use]
    pub fn materials(&self) -> Vec<Material<'_>> {
        let pairs = self.choices.assets.iter().zip(&self.programs);
        let mut materials = Vec::with_capacity(self.sampled.len());
        for copy in 1..=self.choices.copies {
            materials.extend(pairs.clone().map(|(asset, program)| {
                let name = match (copy, &asset.metadata.name) {
                    (1, name) => name.clone(),
                    (copy, name) => format!("{name} ({copy})"),
                };
                Material::new(name, asset, program)
            }));
        }
        materials
    }

    /// What results print.
    #[must_use]
    pub fn identities(&self) -> Identities {
        let choices = &self.choices;
        let is_scene = matches!(choices.access, AccessSpec::Scene(_));
        let is_scan = matches!(choices.access, AccessSpec::Texels(_));
        let materials = choices.assets.iter().map(|asset| MaterialIdentity {
            name: asset.metadata.name.clone(),
            profile: asset.profile.identity(),
            size_texels: [asset.shape.width, asset.shape.height],
            macs_per_texel: u64::from(asset.macs()),
            grid_bytes: choices.layout.total_bytes(&asset.shape),
            parameter_bytes: asset.parameter_bits().div_ceil(8),
        });
        Identities {
            unit: choices.unit.identity(),
            materials: materials.collect(),
            copies: choices.copies,
            layout: choices.layout.to_string(),
            access: choices.access.to_string(),
            screen_pixels: is_scene.then_some(choices.screen),
            interleave: (is_scene && self.sampled.len() > 1)
                .then(|| choices.interleave.to_string()),
            sampler: (!is_scan).then(|| choices.sampler.clone()),
        }
    }
}
