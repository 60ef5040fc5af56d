//! Presets: configurations with a name.

use crate::config::{ActivationKind, Address, GridConfig, Snap, TrainConfig};
use crate::error::TrainError;

/// A configuration with a name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Preset {
    /// The name, as the command line takes it.
    pub name: &'static str,
    /// One line on what it stands for.
    pub about: &'static str,
    grids: [(u16, u8, u8); 2],
    hidden: &'static [u16],
    residual_blocks: u8,
    activation: ActivationKind,
}

const LEAKY: ActivationKind = ActivationKind::Leaky { shift: 3 };
const GELU: ActivationKind = ActivationKind::HardGelu;
const RELU: ActivationKind = ActivationKind::Relu;

const fn preset(
    name: &'static str,
    about: &'static str,
    grids: [(u16, u8, u8); 2],
    hidden: &'static [u16],
    residual_blocks: u8,
    activation: ActivationKind,
) -> Preset {
    Preset {
        name,
        about,
        grids,
        hidden,
        residual_blocks,
        activation,
    }
}

impl Preset {
    /// Every preset; the first is the default.
    ///
    /// Grids are (channels, bits, log2 of the scale). The CNTC shapes are a reading of the
    /// paper's rates, which fits them all: grids (N/2, N), widths 64, 128, 128, four residual
    /// blocks of two square layers. The NTC shapes have the grids of the NTC paper's mip 0 and
    /// its three hidden layers of 64, but not its feature pyramid: coarse mips stride through the
    /// one pair of grids, so their rate is 15/16 of the original's. `rtxntc` has the layers of
    /// the RTX SDK (48-64-48-32-16); its 48 inputs become 49 here, 4·6 corners, 12 interpolated,
    /// 12 waves and the level, in the place of its two mips of 16 features. `tsnc` has the layers
    /// of Intel's SDK, whose latents are four block-compressed textures; a grid of one channel at
    /// half and one of seven at a quarter resolution give 16 inputs with one octave of waves.
    pub const ALL: [Preset; 14] = [
        preset(
            "default",
            "a compromise of quality, rate and hardware near CNTC-16's rate",
            [(8, 4, 3), (16, 4, 3)],
            &[64],
            2,
            LEAKY,
        ),
        preset(
            "cntc-16",
            "the CNTC paper's lowest rate",
            [(8, 4, 3), (16, 4, 3)],
            &[64],
            4,
            LEAKY,
        ),
        preset(
            "cntc-32",
            "the CNTC paper's middle rate",
            [(16, 4, 3), (32, 4, 3)],
            &[128],
            4,
            LEAKY,
        ),
        preset(
            "cntc-64",
            "the CNTC paper's highest rate",
            [(32, 4, 3), (64, 4, 3)],
            &[128],
            4,
            LEAKY,
        ),
        preset(
            "hw-16",
            "a synthesizer 16 wide",
            [(8, 4, 3), (16, 4, 3)],
            &[16],
            1,
            LEAKY,
        ),
        preset(
            "hw-32",
            "a synthesizer 32 wide",
            [(8, 4, 3), (16, 4, 3)],
            &[32],
            1,
            LEAKY,
        ),
        preset(
            "hw-48",
            "a synthesizer 48 wide",
            [(8, 4, 3), (16, 4, 3)],
            &[48],
            1,
            LEAKY,
        ),
        preset(
            "hw-64",
            "a synthesizer 64 wide",
            [(8, 4, 3), (16, 4, 3)],
            &[64],
            1,
            LEAKY,
        ),
        preset(
            "rtxntc",
            "the layers of NVIDIA's RTX SDK",
            [(6, 4, 3), (12, 4, 3)],
            &[64, 48, 32],
            0,
            GELU,
        ),
        preset(
            "ntc-0.2",
            "the NTC paper's lowest rate, without its pyramid",
            [(8, 2, 2), (12, 4, 3)],
            &[64, 64, 64],
            0,
            GELU,
        ),
        preset(
            "ntc-0.5",
            "the NTC paper's second rate, without its pyramid",
            [(12, 4, 2), (20, 4, 3)],
            &[64, 64, 64],
            0,
            GELU,
        ),
        preset(
            "ntc-1.0",
            "the NTC paper's third rate, without its pyramid",
            [(12, 2, 1), (10, 4, 2)],
            &[64, 64, 64],
            0,
            GELU,
        ),
        preset(
            "ntc-2.25",
            "the NTC paper's highest rate, without its pyramid",
            [(16, 4, 1), (12, 4, 2)],
            &[64, 64, 64],
            0,
            GELU,
        ),
        preset(
            "tsnc",
            "the layers of Intel's SDK",
            [(1, 4, 1), (7, 4, 2)],
            &[64, 64],
            0,
            RELU,
        ),
    ];

    /// The preset with this name.
    ///
    /// # Errors
    /// When there is none.
    pub fn by_name(name: &str) -> Result<Preset, TrainError> {
        Preset::ALL
            .into_iter()
            .find(|p| p.name == name)
            .ok_or_else(|| TrainError::Preset {
                found: name.to_owned(),
                allowed: Preset::ALL.map(|p| p.name).join(", "),
            })
    }

    /// Its configuration, at medium effort.
    #[must_use]
    pub fn config(&self) -> TrainConfig {
        TrainConfig {
            grids: self.grids.map(|(channels, bits, scale_log2)| GridConfig {
                channels,
                bits,
                scale_log2,
            }),
            hidden: self.hidden.to_vec(),
            residual_blocks: self.residual_blocks,
            layers_per_block: 2,
            activation: self.activation,
            octaves: if self.name == "tsnc" { 1 } else { 3 },
            snap: Snap::Stride,
            address: Address::Wrap,
            weight_bits: 8,
            encoder_width: 32,
            crop: 256,
            crops: 4,
            batch: 12_288,
            uniform_mips: 0.1,
            refine_latents: true,
            encoder_rate: 1e-3,
            latent_rate: 0.01,
            // A wider layer moves further at the same rate.
            synthesizer_rate: if self.hidden.iter().any(|&w| w > 64) {
                0.01
            } else {
                0.02
            },
            integer_rate: 0.6,
            effort: 50,
            steps: None,
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
