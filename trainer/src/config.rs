//! Everything that decides what a training run makes.

use crate::error::TrainError;
use ntmu_isa::activation::MAX_LEAK_SHIFT;
use ntmu_isa::embed::{MAX_OCTAVES, WAVES_PER_OCTAVE};
use ntmu_isa::latent::LatentFormat;
use ntmu_isa::limits;
use ntmu_isa::position::{AddressMode, CornerSnap};
use ntmu_isa::shape::GridShape;
use serde::{Deserialize, Serialize};

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

/// The activation of the hidden layers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ActivationKind {
    /// max(x, 0).
    Relu,
    /// x for x ≥ 0, x / 2^shift below.
    Leaky {
        /// n of the slope 2^−n, 1..=7.
        shift: u8,
    },
    /// x · clamp(x/3 + ½, 0, 1).
    HardGelu,
}

/// Where the first corner lies when the stride is more than one cell; see
/// [`ntmu_isa::position::CornerSnap`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Snap {
    /// The cell just below the texel centre.
    Cell,
    /// The multiple of the stride just below the texel centre.
    Stride,
}

impl From<Snap> for CornerSnap {
    fn from(snap: Snap) -> CornerSnap {
        match snap {
            Snap::Cell => CornerSnap::Cell,
            Snap::Stride => CornerSnap::Stride,
        }
    }
}

/// What a corner outside the grid means; see [`ntmu_isa::position::AddressMode`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Address {
    /// The grid repeats.
    Wrap,
    /// The grid repeats, every other copy reversed.
    Mirror,
    /// The edge cell continues.
    Clamp,
}

impl From<Address> for AddressMode {
    fn from(address: Address) -> AddressMode {
        match address {
            Address::Wrap => AddressMode::Wrap,
            Address::Mirror => AddressMode::Mirror,
            Address::Clamp => AddressMode::Clamp,
        }
    }
}

/// Steps of each stage, in the order in which they run.
///
/// A step count is part of the configuration and never follows from a clock, so that the same
/// configuration makes the same bytes on a slow day.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Steps {
    /// Encoder, constructors and synthesizer on crops, uniform noise on the latents.
    pub encoder: u64,
    /// Latents and synthesizer on the whole set, uniform noise on the latents.
    pub refine: u64,
    /// The same with rounded latents and the integer synthesizer.
    pub integer: u64,
}

/// Everything that decides what a training run makes.
///
/// Two runs with equal configurations on equal texture sets and the same machine type give equal
/// bytes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrainConfig {
    /// Grid 0, whose corners are concatenated, and grid 1, which is interpolated.
    pub grids: [GridConfig; 2],
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
    /// See [`Snap`].
    pub snap: Snap,
    /// See [`Address`].
    pub address: Address,
    /// Bits of a weight, 2..=8.
    pub weight_bits: u8,
    /// Channels of the encoder's convolutions, a multiple of 2; ELIC has 192.
    pub encoder_width: u16,
    /// Side of a training crop in texels of mip 0, a multiple of 64 from 64 to 4096.
    pub crop: u32,
    /// Crops in a step of the encoder stage.
    pub crops: u16,
    /// Texels in a step, a multiple of 768 (eight chunks of whole tiles).
    pub batch: u32,
    /// The share of texels whose mip is drawn uniformly, 0..=1.
    pub uniform_mips: f64,
    /// Whether the latents are parameters of their own after the encoder stage. The paper keeps
    /// the encoder to the end; without this flag the grids stay what the encoder made them, and
    /// only the synthesizer is trained further.
    pub refine_latents: bool,
    /// Learning rate of the encoder and its constructors.
    pub encoder_rate: f64,
    /// Learning rate of the latents, whose reals are −½..=½.
    pub latent_rate: f64,
    /// Learning rate of the synthesizer.
    pub synthesizer_rate: f64,
    /// Both of these rates in the integer stage, as a factor.
    pub integer_rate: f64,
    /// How much work to spend, 0..=100; see [`TrainConfig::with_effort`].
    pub effort: u8,
    /// Steps of each stage; without them they follow from the effort and the set's texels.
    pub steps: Option<Steps>,
    /// The seed of every random number.
    pub seed: u64,
    /// Steps between two checkpoints.
    pub checkpoint_every: u64,
}

/// The widest hidden layer: 384 · 127 · 255 + 2^22 is just below 2^24, so that training can hold
/// accumulators in floats exactly. The inputs have no zero point and may be twice as many.
pub(crate) const WIDEST: u16 = 384;
const _: () = assert!(WIDEST as u32 * 127 * 255 + (1 << 22) < 1 << 24);

/// Chunks of a batch. Fixed, so that sums do not depend on the number of threads.
pub(crate) const CHUNKS: usize = 8;
/// Texels that pass through the layers together.
pub(crate) const TILE: usize = 96;

impl TrainConfig {
    /// Inputs of the synthesizer: 4·c0 + c1 + waves + the level.
    #[must_use]
    pub fn input_count(&self) -> usize {
        4 * usize::from(self.grids[0].channels)
            + usize::from(self.grids[1].channels)
            + usize::from(WAVES_PER_OCTAVE) * usize::from(self.octaves)
            + 1
    }

    /// Whether every field is in range.
    ///
    /// # Errors
    /// The first field that is not.
    pub fn validate(&self) -> Result<(), TrainError> {
        for (index, grid) in self.grids.iter().enumerate() {
            let field = |name: &str| format!("grids[{index}].{name}");
            range(
                field("channels"),
                grid.channels,
                1,
                limits::MAX_GRID_CHANNELS,
            )?;
            let (low, high) = limits::LATENT_BITS;
            range(field("bits"), grid.bits, low, high)?;
            let (low, high) = limits::GRID_SCALE_LOG2;
            range(field("scale_log2"), grid.scale_log2, low, high)?;
        }
        range("octaves", self.octaves, 0, MAX_OCTAVES)?;
        range(
            "inputs",
            self.input_count(),
            1,
            usize::from(limits::MAX_LANES),
        )?;
        if self.hidden.is_empty() {
            return Err(TrainError::config("hidden", "no layer", "at least one"));
        }
        for (index, &width) in self.hidden.iter().enumerate() {
            range(format!("hidden[{index}]"), width, 1, WIDEST)?;
        }
        range(
            "layers_per_block",
            self.layers_per_block,
            1,
            limits::MAX_SKIP_SPAN,
        )?;
        let blocks = usize::from(self.residual_blocks) * usize::from(self.layers_per_block);
        let layers = self.hidden.len() + blocks + 1;
        range("layers", layers, 2, usize::from(limits::MAX_LAYERS))?;
        if let ActivationKind::Leaky { shift } = self.activation {
            range("activation.shift", shift, 1, MAX_LEAK_SHIFT)?;
        }
        let (low, high) = limits::WEIGHT_BITS;
        range("weight_bits", self.weight_bits, low, high)?;
        range("encoder_width", self.encoder_width, 4, 512)?;
        multiple("encoder_width", u32::from(self.encoder_width), 2)?;
        range("crop", self.crop, 64, 4096)?;
        multiple("crop", self.crop, 64)?;
        range("crops", self.crops, 1, 64)?;
        range("batch", self.batch, (CHUNKS * TILE) as u32, 1 << 22)?;
        multiple("batch", self.batch, (CHUNKS * TILE) as u32)?;
        range("uniform_mips", self.uniform_mips, 0.0, 1.0)?;
        range("encoder_rate", self.encoder_rate, 0.0, 1.0)?;
        range("latent_rate", self.latent_rate, 0.0, 1.0)?;
        range("synthesizer_rate", self.synthesizer_rate, 0.0, 1.0)?;
        range("integer_rate", self.integer_rate, 0.0, 10.0)?;
        range("checkpoint_every", self.checkpoint_every, 1, u64::MAX)?;
        range("effort", self.effort, 0, 100)?;
        if let Some(steps) = self.steps {
            let most = 100_000_000;
            range("steps.encoder", steps.encoder, 0, most)?;
            range("steps.refine", steps.refine, 0, most)?;
            range("steps.integer", steps.integer, 0, most)?;
        }
        Ok(())
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
        })
    }
}

fn range<T: PartialOrd + std::fmt::Display>(
    field: impl Into<String>,
    found: T,
    low: T,
    high: T,
) -> Result<(), TrainError> {
    // A NaN fails both comparisons, as it should.
    if found >= low && found <= high {
        Ok(())
    } else {
        Err(TrainError::config(field, found, format!("{low}..={high}")))
    }
}

fn multiple(field: &str, found: u32, of: u32) -> Result<(), TrainError> {
    if found.is_multiple_of(of) {
        Ok(())
    } else {
        Err(TrainError::config(
            field,
            found,
            format!("a multiple of {of}"),
        ))
    }
}
