//! Presets: configurations with a name.

use crate::choices::{ActivationKind, Address, GridSampling, Precision, Snap, WaveForm};
use crate::config::{GridConfig, TrainConfig};
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
    sampling: [GridSampling; 2],
    octaves: u8,
    wave: WaveForm,
    padding: u8,
}

const LEAKY: ActivationKind = ActivationKind::Leaky { shift: 3 };
const GELU: ActivationKind = ActivationKind::HardGelu;
const GELU_3: ActivationKind = ActivationKind::ClampedHardGelu;
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
        sampling: [GridSampling::Corners, GridSampling::Interpolated],
        octaves: 3,
        wave: WaveForm::Triangle,
        padding: 0,
    }
}

impl Preset {
    /// The same with both grids interpolated, these waves and this padding.
    const fn interpolated(self, octaves: u8, wave: WaveForm, padding: u8) -> Preset {
        Preset {
            sampling: [GridSampling::Interpolated; 2],
            octaves,
            wave,
            padding,
            ..self
        }
    }

    /// Every preset; the first is the default.
    ///
    /// Grids are (channels, bits, log2 of the scale). The CNTC shapes are a reading of the
    /// paper's rates, which fits them all: grids (N/2, N), widths 64, 128, 128, four residual
    /// blocks of two square layers. The NTC shapes have the grids of the NTC paper's mip 0 and
    /// its three hidden layers of 64, but not its feature pyramid: coarse mips stride through the
    /// one pair of grids, so their rate is 15/16 of the original's. `rtxntc` has the synthesizer of
    /// the RTX SDK, 48-64-48-32, with its clamped hard GELU and its saw waves: two grids of 16
    /// interpolated features, one at half the other's resolution as two mips of its latents are,
    /// in the SDK's shape of 5 bits per texel; 12 waves, the level (once, in the SDK twice) and
    /// zeros. `tsnc` has that of Intel's SDK, 16-64-64 with ReLU: 12 interpolated features in the
    /// place of four block-compressed textures of three channels, no waves, the level and zeros.
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
            "the synthesizer of NVIDIA's RTX SDK, at 5 bits per texel",
            [(16, 4, 2), (16, 4, 3)],
            &[64, 48, 32],
            0,
            GELU_3,
        )
        .interpolated(3, WaveForm::Saw, 3),
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
            "the synthesizer of Intel's SDK",
            [(6, 4, 1), (6, 4, 2)],
            &[64, 64],
            0,
            RELU,
        )
        .interpolated(0, WaveForm::Triangle, 3),
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
            sampling: self.sampling,
            hidden: self.hidden.to_vec(),
            residual_blocks: self.residual_blocks,
            layers_per_block: 2,
            activation: self.activation,
            octaves: self.octaves,
            wave: self.wave,
            padding: self.padding,
            snap: Snap::Stride,
            address: Address::Wrap,
            precision: Precision::Int8,
            precision_per_layer: None,
            input_bits: 8,
            weight_bits: 8,
            activation_bits: 8,
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
