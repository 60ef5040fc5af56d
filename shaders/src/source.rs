//! Source: the shader text, and how it is put together for one asset.
//!
//! The kernels are never rewritten. What varies with the asset is data in buffers, except for the
//! few numbers that WGSL wants before it compiles: [`Sizes`], a header of constants.

use ntmu_isa::profile::Profile;
use ntmu_isa::{Asset, limits};

/// Invocations of one workgroup: a multiple of every common subgroup size.
pub const WORKGROUP: u32 = 64;

/// Lanes in one element of a vector in the shader: sixteen signed bytes.
pub const STEP_LANES: u32 = 16;

/// Words of one grid's taps before the codes: two axes of first, stride and phase; columns; rows.
pub(crate) const TAP_CORNER_WORDS: u32 = 10;

/// A shader file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stage {
    /// The file's stem: the name of the stage, as in the model.
    pub stem: &'static str,
    /// The file's text.
    pub text: &'static str,
    /// The functions by which other stages enter it.
    pub functions: &'static [&'static str],
}

macro_rules! stage {
    ($stem:literal, [$($function:literal),* $(,)?]) => {
        Stage {
            stem: $stem,
            text: include_str!(concat!("../wgsl/", $stem, ".wgsl")),
            functions: &[$($function),*],
        }
    };
}

/// Every file of the decode, in the order of the texel's journey; the first four carry the rest.
pub const STAGES: &[Stage] = &[
    stage!("spec", []),
    stage!("bindings", []),
    stage!("wide", ["wide_multiply", "wide_saturate"]),
    stage!(
        "vector",
        ["vector_start", "write_input", "write_lane", "read_lane"]
    ),
    stage!("round", ["rounding_shift", "rounding_shift_wide"]),
    stage!("rescale", ["requantizer_apply"]),
    stage!(
        "position",
        [
            "axis_position",
            "address_resolve",
            "axis_corners",
            "position"
        ]
    ),
    stage!("fetch", ["fetch"]),
    stage!("unpack", ["unpack", "latent_value"]),
    stage!("interpolate", ["corner_weights", "lerp"]),
    stage!(
        "embed",
        [
            "corner_input",
            "lerp_input",
            "wave_input",
            "level_input",
            "concat",
            "waves",
            "level",
        ]
    ),
    stage!("layer", ["dense", "rescale", "skip_term", "run_layer"]),
    stage!("activation", ["leak", "gate", "gate_argument", "activate"]),
    stage!("output", ["output_range", "emit"]),
    stage!("decode", ["decode"]),
];

/// Linked in where taps are asked for.
pub const TAPS: Stage = stage!("taps", ["tap_texel", "tap"]);

/// Linked in where they are not.
pub const NO_TAPS: Stage = stage!("no_taps", ["tap_texel", "tap"]);

/// What the shader must know of an asset before it is compiled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sizes {
    /// Elements of [`STEP_LANES`] lanes that the widest vector needs.
    pub vector_steps: u32,
    /// Vectors that are live at once.
    pub vector_count: u32,
    /// The rounding points. Constants, because a software adapter runs every case of a `switch`
    /// whose selector it only learns later.
    pub profile: Profile,
}

impl Sizes {
    /// The sizes of an asset.
    #[must_use]
    pub fn of(asset: &Asset) -> Sizes {
        let hidden = &asset.layers[..asset.layers.len() - 1];
        let widest = hidden
            .iter()
            .map(|layer| u32::from(layer.outputs))
            .fold(asset.shape.input_count(), u32::max);
        let longest_span = asset
            .layers
            .iter()
            .filter_map(|layer| layer.skip)
            .map(|skip| u32::from(skip.span))
            .fold(0, u32::max);
        Sizes {
            vector_steps: widest.div_ceil(STEP_LANES),
            // A layer's output, its input, and what is older up to the source of its skip path.
            vector_count: (longest_span + 1).max(2),
            profile: asset.profile,
        }
    }

    /// The largest sizes that any asset has.
    #[must_use]
    pub fn largest() -> Sizes {
        Sizes {
            vector_steps: u32::from(limits::MAX_LANES).div_ceil(STEP_LANES),
            vector_count: u32::from(limits::MAX_SKIP_SPAN) + 1,
            profile: Profile::NORMATIVE,
        }
    }

    /// Elements of one texel's vectors, 16 bytes each.
    #[must_use]
    pub const fn vector_elements(&self) -> u32 {
        self.vector_steps * self.vector_count
    }

    /// The sizes as WGSL constants.
    #[must_use]
    pub fn header(&self) -> String {
        let profile = &self.profile;
        [
            ("WORKGROUP", WORKGROUP),
            ("TAP_CORNER_WORDS", TAP_CORNER_WORDS),
            ("VECTOR_STEPS", self.vector_steps),
            ("VECTOR_COUNT", self.vector_count),
            ("PROFILE_INPUT", u32::from(profile.input.code())),
            ("PROFILE_LEAK", u32::from(profile.leak.code())),
            ("PROFILE_REQUANTIZE", u32::from(profile.requantize.code())),
            ("PROFILE_SKIP", u32::from(profile.skip.code())),
            ("PROFILE_OUTPUT", u32::from(profile.output.code())),
        ]
        .map(|(name, value)| format!("const {name}: u32 = {value}u;\n"))
        .concat()
    }

    /// The whole text of the decode for these sizes.
    #[must_use]
    pub fn source(&self, with_taps: bool) -> String {
        let taps = if with_taps { TAPS } else { NO_TAPS };
        let mut text = self.header();
        for stage in STAGES.iter().chain([&taps]) {
            text.push('\n');
            text.push_str(stage.text);
        }
        text
    }
}
