//! Profile: every choice that an implementation may make differently, as data.

use crate::rescale::Requantizer;
use crate::round::Rounding;

/// The rounding points of the decode, by name. No mode is ambient: each is read from here.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Profile {
    /// The input quantiser: interpolated latents, and eight-bit corners.
    pub input: Rounding,
    /// The negative side of a leaky ReLU.
    pub leak: Rounding,
    /// Accumulator to activation, in every hidden layer; both steps of a hard GELU.
    pub requantize: Requantizer,
    /// The skip path's rescaling.
    pub skip: Requantizer,
    /// Accumulator to channel code.
    pub output: Requantizer,
}

impl Profile {
    /// The normative choices: ties up everywhere, TOSA single rounding.
    pub const NORMATIVE: Profile = Profile {
        input: Rounding::HalfUp,
        leak: Rounding::HalfUp,
        requantize: Requantizer::Single,
        skip: Requantizer::Single,
        output: Requantizer::Single,
    };
}

impl Default for Profile {
    fn default() -> Profile {
        Profile::NORMATIVE
    }
}
