//! Presets: configurations with a name.

use crate::choices::{FirstLatents, Optimiser, Precision};
use crate::config::{GridConfig, TrainConfig};
use crate::error::TrainError;
use ntmu_isa::preset;
use std::collections::BTreeMap;
use std::ops::Deref;

/// A configuration with a name: one of isa's shapes, and how to train it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Preset {
    shape: preset::Preset,
}

impl Deref for Preset {
    type Target = preset::Preset;

    fn deref(&self) -> &preset::Preset {
        &self.shape
    }
}

impl Preset {
    /// Every preset, in the order of [`preset::Preset::ALL`]; the first is the default.
    pub const ALL: [Preset; preset::Preset::ALL.len()] = {
        let shapes = preset::Preset::ALL;
        let mut all = [Preset { shape: shapes[0] }; preset::Preset::ALL.len()];
        let mut index = 0;
        while index < all.len() {
            all[index].shape = shapes[index];
            index += 1;
        }
        all
    };

    /// The preset with this name.
    ///
    /// # Errors
    /// When there is none.
    pub fn by_name(name: &str) -> Result<Preset, TrainError> {
        preset::Preset::by_name(name)
            .map(|shape| Preset { shape })
            .ok_or_else(|| TrainError::Preset {
                found: name.to_owned(),
                allowed: Preset::ALL.map(|p| p.name).join(", "),
            })
    }

    /// Its configuration, at medium effort.
    #[must_use]
    pub fn config(&self) -> TrainConfig {
        TrainConfig {
            grids: self.grids.map(|grid| GridConfig {
                channels: grid.channels,
                bits: grid.format.bits(),
                scale_log2: grid.scale_log2,
            }),
            pyramid: self.pyramid,
            sampling: self.grids.map(|grid| grid.sampling.into()),
            hidden: self.hidden.to_vec(),
            residual_blocks: self.residual_blocks,
            layers_per_block: preset::Preset::LAYERS_PER_BLOCK,
            activation: self.activation,
            octaves: self.octaves,
            wave: self.wave.into(),
            padding: self.padding,
            snap: preset::Preset::SNAP.into(),
            address: preset::Preset::ADDRESS_MODE.into(),
            precision: Precision::Int8,
            precision_per_layer: None,
            input_bits: preset::Preset::INPUT_BITS,
            weight_bits: 8,
            weight_bits_per_layer: None,
            activation_bits: 8,
            encoder_width: 32,
            crop: 256,
            crops: 4,
            batch: 12_288,
            uniform_mips: 0.1,
            first_latents: FirstLatents::Components,
            optimiser: Optimiser::Muon,
            encoder_rate: 1e-3,
            latent_rate: 0.005,
            synthesizer_rate: 0.02,
            rate_factor: 1.0,
            weights: BTreeMap::new(),
            effort: 50,
            plan: None,
            seconds: None,
            target_psnr: None,
            settle: None,
            seed: 0,
            checkpoint_every: 2000,
        }
    }
}

impl Default for TrainConfig {
    fn default() -> TrainConfig {
        Preset::ALL[0].config()
    }
}
