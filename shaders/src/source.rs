//! Source: the shader files, and how they are put together for one asset.

use crate::variant::Variant;

/// Invocations of one workgroup: a multiple of every common subgroup size.
pub const WORKGROUP: u32 = 64;

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

/// The files of every decode, in the order of the texel's journey; those up to `accumulate` carry the
/// rest.
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
    stage!("accumulate", ["signed_range", "accumulator_add"]),
    stage!(
        "position",
        [
            "axis_position",
            "address_resolve",
            "axis_corners",
            "pyramid_level",
            "position"
        ]
    ),
    stage!("fetch", ["fetch"]),
    stage!("unpack", ["unpack", "latent_value"]),
    stage!("interpolate", ["corner_weights", "lerp_input", "lerp"]),
    stage!(
        "embed",
        [
            "corner_input",
            "wave_input",
            "level_input",
            "sample",
            "waves",
            "level",
            "padding",
        ]
    ),
    stage!("dense", ["dense"]),
    stage!("layer", ["rescale", "skip_term", "run_layer"]),
    stage!(
        "activation",
        ["leak", "gate", "gate_argument", "table_index", "activate",]
    ),
    stage!("output", ["output_code", "emit"]),
    stage!("decode", ["decode"]),
];

/// Linked in where an asset has fp16 layers or float16 channels.
pub const HALF_STAGES: &[Stage] = &[
    stage!("float", ["float_add", "float_multiply", "float_to_integer"]),
    stage!(
        "half",
        [
            "half_product",
            "half_to_float",
            "half_round",
            "half_from_fixed",
            "half_fused",
        ]
    ),
    stage!(
        "half_layer",
        ["dense_half", "finish_half", "output_code_half"]
    ),
];

/// Linked in where it has none.
pub const NO_HALF: Stage = stage!(
    "no_half",
    [
        "half_from_fixed",
        "dense_half",
        "finish_half",
        "output_code_half"
    ]
);

/// Linked in where taps are asked for.
pub const TAPS: Stage = stage!("taps", ["tap_texel", "tap"]);

/// Linked in where they are not.
pub const NO_TAPS: Stage = stage!("no_taps", ["tap_texel", "tap"]);

/// The whole text of the decode for these constants.
#[must_use]
pub fn source(variant: &Variant, with_taps: bool) -> String {
    let taps = if with_taps { TAPS } else { NO_TAPS };
    let halves = if variant.has_half_layers || variant.has_float_output {
        HALF_STAGES
    } else {
        &[NO_HALF]
    };
    let mut text = variant.header();
    for stage in STAGES.iter().chain(halves).chain([&taps]) {
        text.push('\n');
        text.push_str(stage.text);
    }
    text
}
