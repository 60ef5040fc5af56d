//! Spec: what a synthetic asset is to look like.

use ntmu_isa::latent::LatentFormat;
use ntmu_isa::profile::Profile;
use ntmu_isa::shape::{GridShape, OutputFormat, Sampling, Shape};

/// The activation of a synthetic asset's hidden layers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SpecActivation {
    /// None.
    Identity,
    /// ReLU.
    Relu,
    /// Leaky ReLU with slope 2^−n.
    Leaky(u8),
    /// Hard GELU.
    HardGelu,
    /// Hard GELU of an argument limited to 3.
    ClampedGelu,
    /// A table; ReLU in fp16 layers, which have none.
    Table,
}

/// The multipliers of a synthetic asset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SpecScale {
    /// Whatever fits best.
    Arbitrary,
    /// Powers of two, so that roundings often meet ties.
    PowerOfTwo,
    /// 7/5 times a power of two, rounded down: odd multiples of 5 land just below ties, and beyond
    /// them where a narrow multiplier rounds the mantissa up.
    BelowTies,
}

/// The arithmetic of a layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SpecKind {
    /// Integers.
    Integer {
        /// Bits of a weight, 2..=8.
        weight_bits: u8,
        /// Bits of an output, 4..=16.
        output_bits: u8,
    },
    /// fp16, into halves or into integers of these bits. Before an integer layer it gives integers
    /// in any case, of eight bits if none are named.
    Half {
        /// Bits of an output, 4..=16.
        quantize: Option<u8>,
    },
}

/// What a synthetic asset is to look like.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Spec {
    /// Sizes and sampling.
    pub shape: Shape,
    /// Implementation-defined choices.
    pub profile: Profile,
    /// The arithmetic of the layers, one after the other and then from the first again.
    pub kinds: Vec<SpecKind>,
    /// Widths of the hidden layers before the blocks.
    pub hidden: Vec<u16>,
    /// Residual blocks of square layers, as wide as the last hidden layer; none without one. A skip
    /// path between layers that cannot share one is left out.
    pub blocks: u8,
    /// Layers of a block, which its skip path spans, 1..=3.
    pub block_span: u8,
    /// Whether the last layer of a block has no activation, as none has that the trainer makes.
    pub has_plain_block_ends: bool,
    /// Of all other hidden layers.
    pub activation: SpecActivation,
    /// Of all rescalings.
    pub scale: SpecScale,
    /// log2 of what the sums of fp16 layers and `Float16` channels reach, −12..=15.
    pub reach: i8,
}

impl Spec {
    /// A small asset: `width` × `height`, whole chain, grids of 2 and 3 channels of 4 bits at 1/8,
    /// the corners of the first and the second interpolated, one octave, two unorm8 channels, one
    /// hidden layer of 6 and one block of eight-bit integers, normative profile.
    #[must_use]
    pub fn small(width: u32, height: u32) -> Spec {
        Spec {
            shape: Shape {
                octaves: 1,
                ..Shape::whole_chain(
                    width,
                    height,
                    [corners(2, 4, 3), interpolated(3, 4, 3)],
                    vec![OutputFormat::Unorm8; 2],
                )
            },
            profile: Profile::NORMATIVE,
            kinds: vec![SpecKind::Integer {
                weight_bits: 8,
                output_bits: 8,
            }],
            hidden: vec![6],
            blocks: 1,
            block_span: 2,
            has_plain_block_ends: false,
            activation: SpecActivation::Relu,
            scale: SpecScale::Arbitrary,
            reach: 0,
        }
    }

    /// The same with integer layers of these bits of weights and outputs.
    #[must_use]
    pub fn with_bits(self, weight_bits: u8, output_bits: u8) -> Spec {
        let kind = SpecKind::Integer {
            weight_bits,
            output_bits,
        };
        Spec {
            kinds: vec![kind],
            ..self
        }
    }

    /// The same with fp16 layers.
    #[must_use]
    pub fn with_halves(self) -> Spec {
        Spec {
            kinds: vec![SpecKind::Half { quantize: None }],
            ..self
        }
    }

    /// The arithmetic of a layer, from 0.
    #[must_use]
    pub fn kind(&self, layer: usize) -> SpecKind {
        let default = SpecKind::Integer {
            weight_bits: 8,
            output_bits: 8,
        };
        self.kinds
            .iter()
            .cycle()
            .nth(layer)
            .copied()
            .unwrap_or(default)
    }
}

/// A grid of `channels` latents of `bits` bits at 1/2^`scale_log2`, of which the synthesizer gets the
/// four corners; one bit if `bits` is no width.
#[must_use]
pub fn corners(channels: u16, bits: u8, scale_log2: u8) -> GridShape {
    const ONE_BIT: LatentFormat = match LatentFormat::new(1) {
        Some(format) => format,
        None => panic!("a latent may have one bit"),
    };
    GridShape {
        channels,
        format: LatentFormat::new(bits).unwrap_or(ONE_BIT),
        scale_log2,
        sampling: Sampling::Corners,
    }
}

/// As [`corners`], of which the synthesizer gets one interpolated latent a channel.
#[must_use]
pub fn interpolated(channels: u16, bits: u8, scale_log2: u8) -> GridShape {
    GridShape {
        sampling: Sampling::Interpolated,
        ..corners(channels, bits, scale_log2)
    }
}
