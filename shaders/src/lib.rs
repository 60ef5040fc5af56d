//! The twin: the same decode in WGSL, run through wgpu.
//!
//! `wgsl/` holds one file a stage, with the stems of the model's stages; the functions have the
//! specification's names. The shaders know the specification's numbers ([`spec`]) and share no
//! arithmetic with the model, so that two implementations agreeing means something. They compute
//! with integers only: WGSL leaves too much of its floats open, so the binary32 sums of fp16 layers
//! are computed on their bits.
//!
//! | module | answers |
//! |---|---|
//! | [`spec`] | which numbers the shaders take from the specification |
//! | [`variant`] | what the shader must know of an asset before it is compiled |
//! | [`source`] | which files there are, and what text is compiled for an asset |
//! | `pack` | what the buffers hold |
//! | `part` | what each pass runs |
//! | [`gpu`] | which device, and how work reaches it |
//! | [`twin`] | one asset on one device: mips, texels, taps |
//! | [`taps`] | every intermediate value of one texel |
//!
//! ```no_run
//! # fn example(asset: &ntmu_isa::Asset) -> Result<(), ntmu_shaders::TwinError> {
//! let twin = ntmu_shaders::Twin::new(asset)?;
//! let codes: Vec<i32> = twin.mip(0)?;
//! # Ok(())
//! # }
//! ```

#![forbid(unsafe_code)]

pub mod error;
pub mod gpu;
mod pack;
mod part;
pub mod source;
pub mod spec;
pub mod taps;
pub mod twin;
pub mod variant;

#[cfg(test)]
mod check;
#[cfg(test)]
mod probe;

pub use error::TwinError;
pub use gpu::{AdapterInfo, Gpu};
pub use taps::{GridTap, LayerTap, Taps};
pub use twin::Twin;
