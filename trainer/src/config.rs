//! Everything that decides what a training run makes.

use crate::choices::{
    ActivationKind, Address, FirstLatents, GridSampling, Optimiser, Precision, Pyramid, Snap,
    WaveForm,
};
use crate::error::TrainError;
use crate::plan::Plan;
use ntmu_isa::embed::WAVES_PER_OCTAVE;
use ntmu_isa::latent::LatentFormat;
use ntmu_isa::shape::GridShape;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// One grid of latents.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct GridConfig {
    /// Latents per cell, 1..=128.
    pub channels: u16,
    /// Bits of a latent, 1..=8.
    pub bits: u8,
    /// log2 of mip 0's resolution over the grid's, 1..=3.
    pub scale_log2: u8,
}

/// Everything that decides what a training run makes.
///
/// Two runs with equal configurations on equal texture sets and the same machine type give equal
/// bytes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrainConfig {
    /// Grid 0 and grid 1.
    pub grids: [GridConfig; 2],
    /// Which level of the grids serves a mip: `"single"`, `"ntc"`, `"every-mip"`, or
    /// `{ first = 4, each = 2 }`.
    #[serde(with = "crate::choices::pyramid")]
    pub pyramid: Pyramid,
    /// What each grid gives the synthesizer. CNTC concatenates the corners of grid 0 and
    /// interpolates grid 1.
    pub sampling: [GridSampling; 2],
    /// Widths of the plain hidden layers, 1..=384, each with the activation; at least one.
    pub hidden: Vec<u16>,
    /// Residual blocks after the plain layers, as wide as the last of them.
    pub residual_blocks: u8,
    /// Square layers in a residual block, 1..=3; the last of them has no activation.
    pub layers_per_block: u8,
    /// The activation of the hidden layers.
    pub activation: ActivationKind,
    /// Octaves of the waves, 0..=3.
    pub octaves: u8,
    /// See [`WaveForm`].
    pub wave: WaveForm,
    /// Zeros after the level, 0..=15.
    pub padding: u8,
    /// See [`Snap`].
    pub snap: Snap,
    /// See [`Address`].
    pub address: Address,
    /// The arithmetic of every layer.
    pub precision: Precision,
    /// The arithmetic of each layer, first layer first, in the place of `precision`.
    pub precision_per_layer: Option<Vec<Precision>>,
    /// Bits of an input, 4..=16 as far as the sums of the first layer stay exact in training; at
    /// most 12 where that layer is fp16.
    pub input_bits: u8,
    /// Bits of an integer layer's weight, 2..=8.
    pub weight_bits: u8,
    /// Those of each layer, first layer first, in the place of `weight_bits`.
    pub weight_bits_per_layer: Option<Vec<u8>>,
    /// Bits of an activation between two layers of which one is of integers, 4..=16 as far as sums
    /// stay exact in training: 8 at any width, more in narrow layers.
    pub activation_bits: u8,
    /// Channels of the encoder's convolutions, a multiple of 2; ELIC has 192.
    pub encoder_width: u16,
    /// Side of a training crop in texels of mip 0, a multiple of 64 from 64 to 4096, where the plan
    /// says nothing else; so are the next six.
    pub crop: u32,
    /// Crops in a step of an encoder stage.
    pub crops: u16,
    /// Texels in a step, a multiple of 768 (eight chunks of whole tiles); a small set gets fewer.
    pub batch: u32,
    /// The share of texels whose mip is drawn uniformly, 0..=1.
    pub uniform_mips: f64,
    /// Where latents start that no encoder makes, where the plan does not say.
    pub first_latents: FirstLatents,
    /// What moves the synthesizer's parameters, where the plan does not say.
    pub optimiser: Optimiser,
    /// Learning rate of the encoder and its constructors.
    pub encoder_rate: f64,
    /// Learning rate of the latents, whose reals are −½..=½. Where the plan has no rate of its own, a
    /// stage of n < 4,000 steps takes √(4,000 ∕ n) times as much.
    pub latent_rate: f64,
    /// Learning rate of the synthesizer. Where the plan has no rate of its own and there are two
    /// residual blocks or more, a fall of n > 2,000 steps takes √(2,000 ∕ n) of it, and layers of
    /// w > 64 take 64 ∕ w.
    pub synthesizer_rate: f64,
    /// All rates of every stage, as a factor. A run may be resumed with another: it is the way on
    /// after a divergence.
    pub rate_factor: f64,
    /// How much the squared error of a map's channels counts in the loss, by the map's name; 1 for a
    /// map that is not named. The weights are scaled so that their mean over all channels is 1.
    pub weights: BTreeMap<String, f64>,
    /// How much work to spend, 0..=100; see [`TrainConfig::with_effort`].
    pub effort: u8,
    /// What is trained, stage after stage; without it that follows from the effort and the set's
    /// texels.
    pub plan: Option<Plan>,
    /// Seconds that the run may take, evaluation included: before the first step the steps of all
    /// stages are scaled by one factor so that they fit.
    pub seconds: Option<f64>,
    /// Decibels over every texel of every mip and channel at which the run ends, once the asset
    /// reaches them.
    pub target_psnr: Option<f64>,
    /// Rounds in which latents settle when training is over, see [`crate::settle()`]. Without it, where
    /// the plan is an effort's, until a round brings less than 0.03 dB, but at most one for every four
    /// passes over the texels, or as many as fit a tenth of the time, and never more than eight; none
    /// for other plans.
    pub settle: Option<u32>,
    /// The seed of every random number.
    pub seed: u64,
    /// Steps between two checkpoints.
    pub checkpoint_every: u64,
}

/// The width up to which a deep synthesizer takes its whole learning rate.
const WIDE: u16 = 64;

/// The widest hidden layer: 384 · 127 · 255 + 2^22 is just below 2^24, so that training can hold
/// accumulators in floats exactly. Other widths of bits are checked layer by layer.
pub(crate) const WIDEST: u16 = 384;
const _: () = assert!(WIDEST as u32 * 127 * 255 + BIAS_LIMIT < 1 << 24);

/// The largest bias of an integer layer before the zero point is folded in.
pub(crate) const BIAS_LIMIT: u32 = 1 << 22;

/// Chunks of a batch. Fixed, so that sums do not depend on the number of threads.
pub(crate) const CHUNKS: usize = 8;
/// Texels that pass through the layers together.
pub(crate) const TILE: usize = 96;

impl TrainConfig {
    /// Inputs of the synthesizer: those of both grids, the waves, the level, the padding.
    #[must_use]
    pub fn input_count(&self) -> usize {
        let of_grid = |g: usize| match self.sampling[g] {
            GridSampling::Corners => 4 * usize::from(self.grids[g].channels),
            GridSampling::Interpolated => usize::from(self.grids[g].channels),
        };
        of_grid(0)
            + of_grid(1)
            + usize::from(WAVES_PER_OCTAVE) * usize::from(self.octaves)
            + 1
            + usize::from(self.padding)
    }

    /// Layers of the synthesizer.
    #[must_use]
    pub fn layer_count(&self) -> usize {
        let blocks = usize::from(self.residual_blocks) * usize::from(self.layers_per_block);
        self.hidden.len() + blocks + 1
    }

    /// The arithmetic of a layer; the configuration is valid.
    pub(crate) fn precision_of(&self, layer: usize) -> Precision {
        let listed = self.precision_per_layer.as_ref();
        listed
            .and_then(|list| list.get(layer).copied())
            .unwrap_or(self.precision)
    }

    /// The bits of a layer's weights; the configuration is valid.
    pub(crate) fn weight_bits_of(&self, layer: usize) -> u8 {
        let listed = self.weight_bits_per_layer.as_ref();
        listed
            .and_then(|list| list.get(layer).copied())
            .unwrap_or(self.weight_bits)
    }

    /// The synthesizer's learning rate where a plan has none, in a short stage.
    pub(crate) fn own_synthesizer_rate(&self) -> f64 {
        let widest = self.hidden.iter().copied().max().unwrap_or(0);
        if self.is_deep() && widest > WIDE {
            self.synthesizer_rate * f64::from(WIDE) / f64::from(widest)
        } else {
            self.synthesizer_rate
        }
    }

    /// Where latents start that no encoder makes.
    pub(crate) fn first_latents(&self) -> FirstLatents {
        let of_plan = self.plan.as_ref().and_then(|plan| plan.first_latents);
        of_plan.unwrap_or(self.first_latents)
    }

    /// Whether the synthesizer is one of those that run away at a high learning rate.
    pub(crate) const fn is_deep(&self) -> bool {
        self.residual_blocks >= 2
    }

    /// The shape of grid `grid`; the configuration is valid.
    pub(crate) fn grid_shape(&self, grid: usize) -> Result<GridShape, TrainError> {
        let GridConfig {
            channels,
            bits,
            scale_log2,
        } = self.grids[grid];
        let format = LatentFormat::new(bits)
            .ok_or_else(|| TrainError::config(format!("grids[{grid}].bits"), bits, "1..=8"))?;
        Ok(GridShape {
            channels,
            format,
            scale_log2,
            sampling: self.sampling[grid].into(),
        })
    }
}
