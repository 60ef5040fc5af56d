//! Spec: what a synthetic asset is to look like, and specs that cover every choice.

use super::random::Random;
use ntmu_isa::latent::LatentFormat;
use ntmu_isa::position::{AddressMode, CornerSnap};
use ntmu_isa::profile::Profile;
use ntmu_isa::rescale::Requantizer;
use ntmu_isa::round::Rounding;
use ntmu_isa::shape::{GridShape, OutputFormat, Shape};

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

/// What a synthetic asset is to look like.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Spec {
    /// Sizes and sampling.
    pub shape: Shape,
    /// Implementation-defined choices.
    pub profile: Profile,
    /// Bits of a weight, 2..=8.
    pub weight_bits: u8,
    /// Widths of the hidden layers before the blocks.
    pub hidden: Vec<u16>,
    /// Residual blocks of square layers, as wide as the last hidden layer; none without one.
    pub blocks: u8,
    /// Layers of a block, which its skip path spans, 1..=3.
    pub block_span: u8,
    /// Of all hidden layers.
    pub activation: SpecActivation,
    /// Of all rescalings.
    pub scale: SpecScale,
}

impl Spec {
    /// A small asset: `width` × `height`, whole chain, grids of 2 and 3 channels of 4 bits at 1/8,
    /// one octave, two unorm8 channels, one hidden layer of 6 and one block, normative profile.
    #[must_use]
    pub fn small(width: u32, height: u32) -> Spec {
        Spec {
            shape: Shape {
                width,
                height,
                mip_count: Shape::max_mip_count(width, height),
                octaves: 1,
                snap: CornerSnap::Cell,
                address_mode: AddressMode::Wrap,
                grids: [grid(2, 4, 3), grid(3, 4, 3)],
                outputs: vec![OutputFormat::Unorm8; 2],
            },
            profile: Profile::NORMATIVE,
            weight_bits: 8,
            hidden: vec![6],
            blocks: 1,
            block_span: 2,
            activation: SpecActivation::Relu,
            scale: SpecScale::Arbitrary,
        }
    }
}

/// A grid of `channels` latents of `bits` bits at 1/2^`scale_log2`; one bit if `bits` is no width.
#[must_use]
pub fn grid(channels: u16, bits: u8, scale_log2: u8) -> GridShape {
    const ONE_BIT: LatentFormat = match LatentFormat::new(1) {
        Some(format) => format,
        None => panic!("a latent may have one bit"),
    };
    GridShape {
        channels,
        format: LatentFormat::new(bits).unwrap_or(ONE_BIT),
        scale_log2,
    }
}

/// Sizes at and around the edges that a grid of 1/8, 1/4 or 1/2 has, and some that are no power of
/// two.
const SIZES: [u32; 18] = [
    1, 2, 3, 4, 5, 7, 8, 9, 12, 15, 16, 17, 24, 31, 33, 40, 64, 100,
];

/// A spec from a seed. Small enough to decode whole; over some hundred seeds every value of every
/// enumeration, every width of a latent and weight, and every edge size occurs.
#[must_use]
pub fn arbitrary_spec(seed: u64) -> Spec {
    let mut random = Random::new(seed);
    let r = &mut random;
    let (width, height) = (r.choose(&SIZES), r.choose(&SIZES));
    let longest = i32::from(Shape::max_mip_count(width, height));
    let mip_count = if r.within(0, 3) == 0 {
        r.within(1, longest)
    } else {
        longest
    };
    let mut a_grid = |most: i32| {
        let (channels, bits) = (r.within(1, most), r.within(1, 8));
        grid(channels as u16, bits as u8, r.within(1, 3) as u8)
    };
    let grids = [a_grid(6), a_grid(8)];
    let channels = r.within(1, 9);
    let shape = Shape {
        width,
        height,
        mip_count: mip_count as u8,
        octaves: r.within(0, 3) as u8,
        snap: r.choose(&CornerSnap::ALL),
        address_mode: r.choose(&AddressMode::ALL),
        grids,
        outputs: (0..channels)
            .map(|_| r.choose(&OutputFormat::ALL))
            .collect(),
    };
    let profile = Profile {
        input: r.choose(&Rounding::ALL),
        leak: r.choose(&Rounding::ALL),
        requantize: r.choose(&Requantizer::ALL),
        skip: r.choose(&Requantizer::ALL),
        output: r.choose(&Requantizer::ALL),
    };
    let layers = r.within(0, 3);
    Spec {
        shape,
        profile,
        weight_bits: r.within(2, 8) as u8,
        hidden: (0..layers).map(|_| r.within(1, 17) as u16).collect(),
        blocks: r.within(0, 3) as u8,
        block_span: r.within(1, 3) as u8,
        activation: match r.within(0, 3) {
            0 => SpecActivation::Identity,
            1 => SpecActivation::Relu,
            2 => SpecActivation::Leaky(r.within(1, 7) as u8),
            _ => SpecActivation::HardGelu,
        },
        scale: r.choose(&[
            SpecScale::Arbitrary,
            SpecScale::PowerOfTwo,
            SpecScale::BelowTies,
        ]),
    }
}
