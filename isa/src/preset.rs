//! Preset: the sizes of a synthesizer and its grids, with a name.
//!
//! A preset is the shape of what a texture set becomes, without its numbers: the trainer fills it
//! with trained ones, a test or a timing study with any. How many cycles a texel takes depends on
//! the shape alone.

use crate::embed::Wave;
use crate::latent::LatentFormat;
use crate::position::{AddressMode, CornerSnap};
use crate::pyramid::Pyramid;
use crate::shape::{GridShape, OutputFormat, Sampling, Shape};

/// The activation of a synthesizer's hidden layers, without the scales that an
/// [`Activation`](crate::activation::Activation) gets from its layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
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
    /// The same of min(x, 3), as in NVIDIA's RTX SDK.
    #[serde(rename = "hard-gelu-3")]
    ClampedHardGelu,
}

/// The sizes of a synthesizer and its grids, with a name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Preset {
    /// The name, as the command line takes it.
    pub name: &'static str,
    /// One line on what it stands for.
    pub about: &'static str,
    /// Which level of the grids serves a mip.
    pub pyramid: Pyramid,
    /// Grid 0 and grid 1.
    pub grids: [GridShape; 2],
    /// Widths of the plain hidden layers, each with the activation; at least one.
    pub hidden: &'static [u16],
    /// Residual blocks of [`Preset::LAYERS_PER_BLOCK`] square layers after the plain layers, as wide
    /// as the last of them. A skip path spans each block; its last layer has no activation.
    pub residual_blocks: u8,
    /// The activation of the hidden layers.
    pub activation: ActivationKind,
    /// Octaves of the waves, 0..=3.
    pub octaves: u8,
    /// The form of the waves.
    pub wave: Wave,
    /// Zeros after the level, 0..=15.
    pub padding: u8,
}

const LEAKY: ActivationKind = ActivationKind::Leaky { shift: 3 };
const GELU: ActivationKind = ActivationKind::HardGelu;
const GELU_3: ActivationKind = ActivationKind::ClampedHardGelu;
const RELU: ActivationKind = ActivationKind::Relu;

/// Evaluated in constants alone, where a width that no latent has stops the build.
const fn grid((channels, bits, scale_log2): (u16, u8, u8), sampling: Sampling) -> GridShape {
    GridShape {
        channels,
        format: match LatentFormat::new(bits) {
            Some(format) => format,
            None => panic!("a latent has 1..=8 bits"),
        },
        scale_log2,
        sampling,
    }
}

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
        pyramid: Pyramid::SINGLE,
        grids: [
            grid(grids[0], Sampling::Corners),
            grid(grids[1], Sampling::Interpolated),
        ],
        hidden,
        residual_blocks,
        activation,
        octaves: 3,
        wave: Wave::Triangle,
        padding: 0,
    }
}

impl Preset {
    /// Square layers in a residual block.
    pub const LAYERS_PER_BLOCK: u8 = 2;
    /// Where the first corner lies when the stride is more than one cell.
    pub const SNAP: CornerSnap = CornerSnap::Stride;
    /// What a corner outside the grid means.
    pub const ADDRESS_MODE: AddressMode = AddressMode::Wrap;
    /// Bits of an input of the synthesizer.
    pub const INPUT_BITS: u8 = 8;

    /// The same with this pyramid.
    const fn with_pyramid(self, pyramid: Pyramid) -> Preset {
        Preset { pyramid, ..self }
    }

    /// The same with both grids interpolated, these waves and this padding.
    const fn interpolated(mut self, octaves: u8, wave: Wave, padding: u8) -> Preset {
        self.grids[0].sampling = Sampling::Interpolated;
        Preset {
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
    /// blocks of two square layers. The NTC shapes have the grids of the NTC paper's mip 0, its
    /// feature pyramid and its three hidden layers of 64. `rtxntc` has the synthesizer of
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
        .interpolated(3, Wave::Saw, 3),
        preset(
            "ntc-0.2",
            "the NTC paper's lowest rate",
            [(8, 2, 2), (12, 4, 3)],
            &[64, 64, 64],
            0,
            GELU,
        )
        .with_pyramid(Pyramid::NTC),
        preset(
            "ntc-0.5",
            "the NTC paper's second rate",
            [(12, 4, 2), (20, 4, 3)],
            &[64, 64, 64],
            0,
            GELU,
        )
        .with_pyramid(Pyramid::NTC),
        preset(
            "ntc-1.0",
            "the NTC paper's third rate",
            [(12, 2, 1), (10, 4, 2)],
            &[64, 64, 64],
            0,
            GELU,
        )
        .with_pyramid(Pyramid::NTC),
        preset(
            "ntc-2.25",
            "the NTC paper's highest rate",
            [(16, 4, 1), (12, 4, 2)],
            &[64, 64, 64],
            0,
            GELU,
        )
        .with_pyramid(Pyramid::NTC),
        preset(
            "tsnc",
            "the synthesizer of Intel's SDK",
            [(6, 4, 1), (6, 4, 2)],
            &[64, 64],
            0,
            RELU,
        )
        .interpolated(0, Wave::Triangle, 3),
    ];

    /// The preset with this name, if there is one.
    #[must_use]
    pub fn by_name(name: &str) -> Option<Preset> {
        Preset::ALL.into_iter().find(|preset| preset.name == name)
    }

    /// The shape of a texture set of this size in this preset. What is beyond the limits of an asset
    /// is for [`Asset::new`](crate::Asset::new) to refuse.
    #[must_use]
    pub fn shape(
        &self,
        width: u32,
        height: u32,
        mip_count: u8,
        outputs: Vec<OutputFormat>,
    ) -> Shape {
        Shape {
            width,
            height,
            mip_count,
            octaves: self.octaves,
            wave: self.wave,
            padding: self.padding,
            input_bits: Preset::INPUT_BITS,
            snap: Preset::SNAP,
            address_mode: Preset::ADDRESS_MODE,
            pyramid: self.pyramid,
            grids: self.grids,
            outputs,
        }
    }

    /// Inputs of the synthesizer.
    #[must_use]
    pub fn input_count(&self) -> u32 {
        self.shape(1, 1, 1, Vec::new()).input_count()
    }

    /// Inputs and outputs of every layer, first layer first, for a set of this many channels.
    #[must_use]
    pub fn layers(&self, channels: u16) -> Vec<(u16, u16)> {
        let square = self.hidden.last().copied();
        let squares = usize::from(self.residual_blocks) * usize::from(Preset::LAYERS_PER_BLOCK);
        let widths = self.hidden.iter().copied();
        let outputs = widths.chain(square.into_iter().cycle().take(squares));
        let mut inputs = self.input_count() as u16;
        outputs
            .chain([channels])
            .map(|outputs| (std::mem::replace(&mut inputs, outputs), outputs))
            .collect()
    }

    /// Multiplications per texel, for a set of this many channels.
    #[must_use]
    pub fn macs(&self, channels: u16) -> u32 {
        self.layers(channels)
            .into_iter()
            .map(|(inputs, outputs)| u32::from(inputs) * u32::from(outputs))
            .sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::activation::MAX_LEAK_SHIFT;
    use crate::asset::check_shape;
    use crate::limits;
    use std::collections::BTreeSet;

    fn named(name: &str) -> Preset {
        Preset::by_name(name).unwrap()
    }

    #[test]
    fn names_are_unique_and_find_their_preset() {
        let names: BTreeSet<&str> = Preset::ALL.iter().map(|preset| preset.name).collect();
        assert_eq!(names.len(), Preset::ALL.len());
        for preset in Preset::ALL {
            assert_eq!(Preset::by_name(preset.name), Some(preset));
        }
        assert_eq!(Preset::by_name("cntc-17"), None);
    }

    #[test]
    fn every_preset_is_within_the_limits_of_an_asset() {
        let channels = limits::MAX_CHANNELS;
        for preset in Preset::ALL {
            let outputs = vec![OutputFormat::Unorm8; usize::from(channels)];
            let size = limits::MAX_SIZE;
            let shape = preset.shape(size, size, Shape::max_mip_count(size, size), outputs);
            assert_eq!(check_shape(&shape), Ok(()), "{}", preset.name);
            let layers = preset.layers(channels);
            assert!(layers.len() <= usize::from(limits::MAX_LAYERS));
            assert!(
                layers
                    .iter()
                    .all(|&(inputs, _)| inputs <= limits::MAX_LANES)
            );
            assert!(!preset.hidden.is_empty(), "{}", preset.name);
            if let ActivationKind::Leaky { shift } = preset.activation {
                assert!((1..=MAX_LEAK_SHIFT).contains(&shift));
            }
        }
        const { assert!(Preset::LAYERS_PER_BLOCK <= limits::MAX_SKIP_SPAN) };
    }

    #[test]
    fn the_cntc_presets_have_the_parameters_that_fit_the_papers_rates() {
        // Of nine channels; 37k, 146k and 158k.
        let macs = ["cntc-16", "cntc-32", "cntc-64"].map(|name| named(name).macs(9));
        assert_eq!(macs, [37_248, 146_176, 158_464]);
    }

    #[test]
    fn the_peers_networks_have_the_widths_that_they_are_known_for() {
        let widths = |name| -> Vec<u16> {
            let layers = named(name).layers(16);
            layers.into_iter().map(|(inputs, _)| inputs).collect()
        };
        assert_eq!(widths("rtxntc"), [48, 64, 48, 32]);
        assert_eq!(widths("tsnc"), [16, 64, 64]);
        for (name, inputs) in [
            ("ntc-0.2", 57),
            ("ntc-0.5", 81),
            ("ntc-1.0", 71),
            ("ntc-2.25", 89),
        ] {
            assert_eq!(widths(name), [inputs, 64, 64, 64], "{name}");
        }
        assert_eq!(named("rtxntc").macs(16), 8192);
        assert_eq!(named("tsnc").macs(16), 6144);
    }

    #[test]
    fn a_pyramid_is_where_the_peer_has_one() {
        for preset in Preset::ALL {
            let expected = if preset.name.starts_with("ntc-") {
                Pyramid::NTC
            } else {
                Pyramid::SINGLE
            };
            assert_eq!(preset.pyramid, expected, "{}", preset.name);
        }
    }
}
