//! Specs of the presets' shapes, so that each has programs and timings without the trainer.

use super::spec::{Spec, SpecActivation, SpecKind, SpecScale};
use ntmu_isa::preset::{ActivationKind, Preset};
use ntmu_isa::profile::Profile;
use ntmu_isa::shape::OutputFormat;

/// The arithmetic of a preset's layers. Values between two layers have eight bits where they are
/// integers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum SpecPrecision {
    /// Integers, weights of eight bits.
    Int8,
    /// Integers, weights of four bits.
    Int4,
    /// Halves.
    Fp16,
    /// The first and the last layer in halves, which keep most of the quality, and those between in
    /// integers with weights of eight bits.
    Mixed,
}

impl SpecPrecision {
    /// Every precision.
    pub const ALL: [SpecPrecision; 4] = [
        SpecPrecision::Int8,
        SpecPrecision::Int4,
        SpecPrecision::Fp16,
        SpecPrecision::Mixed,
    ];

    /// The name in tables and JSON.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            SpecPrecision::Int8 => "int8",
            SpecPrecision::Int4 => "int4",
            SpecPrecision::Fp16 => "fp16",
            SpecPrecision::Mixed => "mixed",
        }
    }

    /// The arithmetic of each of `layers` layers.
    fn kinds(self, layers: usize) -> Vec<SpecKind> {
        let integer = |weight_bits| SpecKind::Integer {
            weight_bits,
            output_bits: 8,
        };
        let half = SpecKind::Half { quantize: None };
        match self {
            SpecPrecision::Int8 => vec![integer(8); layers],
            SpecPrecision::Int4 => vec![integer(4); layers],
            SpecPrecision::Fp16 => vec![half; layers],
            SpecPrecision::Mixed => (0..layers)
                .map(|layer| {
                    if layer == 0 || layer + 1 == layers {
                        half
                    } else {
                        integer(8)
                    }
                })
                .collect(),
        }
    }
}

impl Spec {
    /// A set of this size in a preset's shape: unorm8 channels, normative profile, and the layers,
    /// activations and skip paths that an asset from the trainer has.
    ///
    /// Sizes outside the limits of an asset are for [`asset`](super::asset) to refuse.
    #[must_use]
    pub fn of_preset(
        preset: &Preset,
        width: u32,
        height: u32,
        channels: u16,
        mip_count: u8,
        precision: SpecPrecision,
    ) -> Spec {
        let outputs = vec![OutputFormat::Unorm8; usize::from(channels)];
        Spec {
            shape: preset.shape(width, height, mip_count, outputs),
            profile: Profile::NORMATIVE,
            kinds: precision.kinds(preset.layers(channels).len()),
            hidden: preset.hidden.to_vec(),
            blocks: preset.residual_blocks,
            block_span: Preset::LAYERS_PER_BLOCK,
            has_plain_block_ends: true,
            activation: match preset.activation {
                ActivationKind::Relu => SpecActivation::Relu,
                ActivationKind::Leaky { shift } => SpecActivation::Leaky(shift),
                ActivationKind::HardGelu => SpecActivation::HardGelu,
                ActivationKind::ClampedHardGelu => SpecActivation::ClampedGelu,
            },
            scale: SpecScale::Arbitrary,
            reach: 0,
        }
    }
}
