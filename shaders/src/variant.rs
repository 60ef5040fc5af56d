//! Variant: what the shader must know of an asset before it is compiled.
//!
//! The kernels are never rewritten. What varies with the asset is data in buffers, except for these
//! constants: sizes, the profile, and which kinds of layer there are. A software adapter runs every
//! case whose condition it only learns later; what a constant rules out costs nothing.

use crate::source::{TAP_CORNER_WORDS, WORKGROUP};
use ntmu_isa::filter::FilterRule;
use ntmu_isa::layer::{Layer, Parameters};
use ntmu_isa::position::PHASE_BITS;
use ntmu_isa::profile::Profile;
use ntmu_isa::shape::{LaneFormat, OutputFormat, Sampling};
use ntmu_isa::{Asset, limits};

/// How a vector keeps its lanes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lanes {
    /// Integers of eight bits or fewer, as bytes.
    Bytes,
    /// Wider integers, as 16-bit words.
    Words,
    /// Halves, as 16-bit words.
    Halves,
}

impl Lanes {
    /// Those of a register.
    #[must_use]
    pub const fn of(format: LaneFormat) -> Lanes {
        match format {
            LaneFormat::Integer { bits, .. } if bits <= 8 => Lanes::Bytes,
            LaneFormat::Integer { .. } => Lanes::Words,
            LaneFormat::Half => Lanes::Halves,
        }
    }

    /// The code in the shader.
    #[must_use]
    pub const fn code(self) -> u32 {
        self as u32
    }

    /// Lanes of one element, 128 bits.
    #[must_use]
    pub const fn per_element(self) -> u32 {
        match self {
            Lanes::Bytes => 16,
            Lanes::Words | Lanes::Halves => 8,
        }
    }
}

/// The arithmetic of a layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Arithmetic {
    /// Integers.
    Integer,
    /// Halves, summed in binary32.
    Half,
}

impl Arithmetic {
    /// That of a layer.
    #[must_use]
    pub const fn of(layer: &Layer) -> Arithmetic {
        match layer.parameters {
            Parameters::Integer(_) => Arithmetic::Integer,
            Parameters::Half(_) => Arithmetic::Half,
        }
    }

    /// The code in the shader.
    #[must_use]
    pub const fn code(self) -> u32 {
        self as u32
    }

    /// Weights in one element, 128 bits.
    #[must_use]
    pub const fn weights_per_element(self) -> u32 {
        match self {
            Arithmetic::Integer => 16,
            Arithmetic::Half => 8,
        }
    }
}

/// The constants of one compiled shader.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Variant {
    /// Elements of the largest vector, 16 bytes each.
    pub vector_elements: u32,
    /// Vectors that are live at once.
    pub vector_count: u32,
    /// Whether some vector is of bytes.
    pub has_bytes: bool,
    /// Whether some vector is of 16-bit words: integers or halves.
    pub has_words: bool,
    /// Whether some layer computes with integers.
    pub has_integer_layers: bool,
    /// Whether some layer computes with halves.
    pub has_half_layers: bool,
    /// Whether some channel is a float16.
    pub has_float_output: bool,
    /// A bit for the code of each activation of some layer.
    pub activations: u32,
    /// What each grid gives.
    pub samplings: [Sampling; 2],
    /// Bits of an input.
    pub input_bits: u8,
    /// The rounding points, and all else that an implementation may choose.
    pub profile: Profile,
}

impl Variant {
    /// The constants of an asset.
    #[must_use]
    pub fn of(asset: &Asset) -> Variant {
        let shape = &asset.shape;
        let layers = &asset.layers;
        let hidden = layers[..layers.len() - 1]
            .iter()
            .map(|layer| (u32::from(layer.outputs), Lanes::of(layer.output_format())));
        let vectors: Vec<(u32, Lanes)> =
            std::iter::once((shape.input_count(), Lanes::of(shape.input_format())))
                .chain(hidden)
                .collect();
        let longest_span = layers
            .iter()
            .filter_map(|layer| layer.skip)
            .map(|skip| u32::from(skip.span))
            .fold(0, u32::max);
        let has_lanes = |wanted: &[Lanes]| vectors.iter().any(|(_, lanes)| wanted.contains(lanes));
        let has_arithmetic = |wanted| layers.iter().any(|layer| Arithmetic::of(layer) == wanted);
        Variant {
            vector_elements: vectors
                .iter()
                .map(|(count, lanes)| count.div_ceil(lanes.per_element()))
                .fold(0, u32::max),
            // A layer's output, its input, and what is older up to the source of its skip path.
            vector_count: (longest_span + 1).max(2),
            has_bytes: has_lanes(&[Lanes::Bytes]),
            has_words: has_lanes(&[Lanes::Words, Lanes::Halves]),
            has_integer_layers: has_arithmetic(Arithmetic::Integer),
            has_half_layers: has_arithmetic(Arithmetic::Half),
            has_float_output: shape.outputs.contains(&OutputFormat::Float16),
            activations: layers
                .iter()
                .fold(0, |bits, layer| bits | 1 << layer.activation.code()),
            samplings: shape.grids.map(|grid| grid.sampling),
            input_bits: shape.input_bits,
            profile: asset.profile,
        }
    }

    /// The largest sizes and every kind that an asset may have, by the normative profile.
    #[must_use]
    pub const fn largest() -> Variant {
        Variant {
            vector_elements: (limits::MAX_LANES as u32).div_ceil(Lanes::Words.per_element()),
            vector_count: limits::MAX_SKIP_SPAN as u32 + 1,
            has_bytes: true,
            has_words: true,
            has_integer_layers: true,
            has_half_layers: true,
            has_float_output: true,
            activations: u32::MAX,
            samplings: [Sampling::Corners, Sampling::Interpolated],
            input_bits: 8,
            profile: Profile::NORMATIVE,
        }
    }

    /// Elements of one texel's vectors, 16 bytes each.
    #[must_use]
    pub const fn texel_elements(&self) -> u32 {
        self.vector_elements * self.vector_count
    }

    /// Bits of the fractions among a grid's corners.
    ///
    /// A phase has four. The exact rule gives the same number whatever the fractions' bits, so it
    /// keeps the four, and 32 bits hold its sums; the others round at the profile's.
    const fn lerp_fraction_bits(&self) -> u8 {
        match self.profile.interpolate {
            FilterRule::Exact => PHASE_BITS,
            FilterRule::Factored | FilterRule::Separable | FilterRule::AllOnes => {
                self.profile.subtexel_bits
            }
        }
    }

    /// What the register of the inputs holds.
    const fn input_lanes(&self) -> Lanes {
        Lanes::of(LaneFormat::Integer {
            bits: self.input_bits,
            zero_point: 0,
        })
    }

    /// The constants as WGSL.
    #[must_use]
    pub fn header(&self) -> String {
        let Variant { profile, .. } = self;
        let [grid0, grid1] = self.samplings;
        let numbers = [
            ("WORKGROUP", WORKGROUP),
            ("TAP_CORNER_WORDS", TAP_CORNER_WORDS),
            ("LANES_BYTES", Lanes::Bytes.code()),
            ("LANES_WORDS", Lanes::Words.code()),
            ("LANES_HALVES", Lanes::Halves.code()),
            ("ARITHMETIC_INTEGER", Arithmetic::Integer.code()),
            ("ARITHMETIC_HALF", Arithmetic::Half.code()),
            ("VECTOR_ELEMENTS", self.vector_elements),
            ("VECTOR_COUNT", self.vector_count),
            ("HAS_ACTIVATION", self.activations),
            ("SAMPLING_GRID0", u32::from(grid0.code())),
            ("SAMPLING_GRID1", u32::from(grid1.code())),
            ("INPUT_BITS", u32::from(self.input_bits)),
            ("INPUT_LANES", self.input_lanes().code()),
            ("LERP_FRACTION_BITS", u32::from(self.lerp_fraction_bits())),
            ("PROFILE_INTERPOLATE", u32::from(profile.interpolate.code())),
            ("PROFILE_INPUT", u32::from(profile.input.code())),
            (
                "PROFILE_ACCUMULATOR_BITS",
                u32::from(profile.accumulator.bits),
            ),
            (
                "PROFILE_OVERFLOW",
                u32::from(profile.accumulator.overflow.code()),
            ),
            ("PROFILE_LEAK", u32::from(profile.leak.code())),
            ("PROFILE_REQUANTIZE", u32::from(profile.requantize.code())),
            ("PROFILE_SKIP", u32::from(profile.skip.code())),
            ("PROFILE_RESIDUAL_BITS", u32::from(profile.residual_bits)),
            ("PROFILE_OUTPUT", u32::from(profile.output.code())),
            ("PROFILE_SUM", u32::from(profile.sum.code())),
            ("PROFILE_CONVERT", u32::from(profile.convert.code())),
        ]
        .map(|(name, value)| format!("const {name}: u32 = {value}u;\n"));
        let flags = [
            ("HAS_BYTES", self.has_bytes),
            ("HAS_WORDS", self.has_words),
            ("HAS_INTEGER_LAYERS", self.has_integer_layers),
            ("HAS_HALF_LAYERS", self.has_half_layers),
            ("HAS_FLOAT_OUTPUT", self.has_float_output),
        ]
        .map(|(name, value)| format!("const {name}: bool = {value};\n"));
        numbers.concat() + &flags.concat()
    }
}
