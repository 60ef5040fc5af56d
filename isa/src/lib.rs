//! The specification of a neural texture unit: what every bit means.
//!
//! Read the modules in this order; it is the order of the texel's journey.
//!
//! | module | answers |
//! |---|---|
//! | [`round`], [`rescale`] | how a number loses bits, and by whose rule |
//! | [`accumulate`], [`half`] | how an integer and an fp16 layer sum |
//! | [`filter`] | how a number between neighbours is made |
//! | [`latent`] | what a stored code of a grid stands for |
//! | [`position`] | which grid cells surround a texel of a mip, and how far in it lies |
//! | [`embed`] | the integers that enter the synthesizer: latents, waves, level |
//! | [`activation`] | what happens between two layers |
//! | [`profile`] | every choice that an implementation may make differently, as data |
//! | [`shape`], [`layer`], [`asset`] | one compressed texture set, validated |
//! | [`preset`] | shapes of synthesizers worth comparing, with names |
//! | [`format`](mod@format) | that asset as bytes: the `.ntx` file |
//! | [`layout`] | where a unit's memory keeps the grids |
//! | [`sampler`] | what a request by normalised coordinates means |
//! | [`instruction`], [`program`], [`link`] | the microprogram that decodes one texel, or one sample |
//! | [`assembly`], [`image`], [`manual`] | that program as text and as bytes, and its reference manual |
//!
//! Three words never mix: a *code* is packed bits as stored, a *value* is the integer that a code
//! stands for, a *real* is what the value means. Nothing in this crate computes with floats, except
//! the sums of fp16 layers in [`half`].

#![forbid(unsafe_code)]

pub mod accumulate;
pub mod activation;
pub mod assembly;
pub mod asset;
mod check_layers;
pub mod embed;
pub mod error;
pub mod filter;
pub mod format;
pub mod half;
pub mod image;
pub mod instruction;
pub mod latent;
pub mod layer;
pub mod layout;
mod layout_code;
pub mod limits;
pub mod link;
pub mod manual;
pub mod position;
pub mod preset;
pub mod profile;
pub mod program;
pub mod pyramid;
pub mod rescale;
pub mod round;
pub mod sampler;
pub mod shape;

pub use asset::Asset;
pub use error::AssetError;
pub use program::Program;
