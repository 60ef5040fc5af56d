//! ntmu: a bit-exact, cycle-aware model of a texture unit that decodes neural-compressed textures.
//!
//! The rooms of the house, each a crate: [`isa`] the specification, [`model`] the hardware,
//! [`conformance`] what is promised to others, `shaders` the GPU twin (feature `gpu`), `trainer`
//! what makes assets (feature `train`). This crate is where they meet: texture sets, metrics, and
//! the `ntmu` binary.
//!
//! ```
//! use ntmu::isa::{Program, layout::Layout};
//! use ntmu::model::{Request, exec::Decoder};
//!
//! let asset = ntmu::built_in::asset()?;
//! let program = Program::compile(&asset, Layout::LINEAR);
//! let request = Request::new(&asset.shape, 10, 20, 0)?;
//! let codes = Decoder::new(&asset, &program).texel(request, &mut ());
//! assert_eq!(codes.len(), 9);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![forbid(unsafe_code)]

pub use ntmu_conformance as conformance;
pub use ntmu_isa as isa;
pub use ntmu_model as model;
#[cfg(feature = "gpu")]
pub use ntmu_shaders as shaders;
#[cfg(feature = "train")]
pub use ntmu_trainer as trainer;

pub mod access;
pub mod analysis;
pub mod beside;
pub mod brick_wall;
pub mod built_in;
pub mod curve;
pub mod decoded;
mod drawing;
pub mod evaluate;
pub mod metrics;
pub mod precision;
pub mod quality;
pub mod report;
pub mod rival;
pub mod study;
pub mod texture_set;
pub mod timing;
#[cfg(feature = "train")]
pub mod training_source;
#[cfg(feature = "gpu")]
pub mod twin_device;

/// The book's chapter, so that its code is compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../docs/src/decoding.md")]
pub struct DecodingFromRust;
