//! The engine: the same codes as [`crate::exec`], as fast as the processor allows.
//!
//! [`crate::exec`] runs a microprogram on one texel and shows every value on its way; it is the
//! reference. The engine knows the asset only, packs its layers once, and computes 64 texels at a
//! time (lanes are texels), or one texel of an 8-bit network on request (lanes are rows). What follows
//! the sums is fused with them for the normative profile; other roundings call the specification lane
//! by lane behind the same sums. Which instructions compute the sums is a [`Path`], chosen when the
//! engine is made.

mod batch;
mod decode;
mod embed;
mod general;
mod image;
#[allow(
    unsafe_code,
    reason = "vector instructions: their loads and stores take pointers, their calls need a feature"
)]
pub mod kernel;
mod lane;
mod path;
mod plan;
mod region;
mod register;
mod texel;
mod tile;

pub use batch::{Blocked, Input, Planar};
pub use path::Path;
pub use texel::Scratch;

use embed::Embed;
use kernel::Kernels;
use ntmu_isa::Asset;
use ntmu_isa::limits::LANE_BITS;
use plan::PlannedLayer;
use register::Widths;

/// A decoder of one asset.
#[derive(Clone, Debug)]
pub struct Engine<'a> {
    asset: &'a Asset,
    path: Path,
    kernels: Kernels,
    inputs: Inputs,
    layers: Vec<PlannedLayer>,
    widths: Widths,
}

/// What makes the inputs of the synthesizer.
#[derive(Clone, Debug)]
enum Inputs {
    /// Of up to 8 bits, as stored bytes.
    Bytes(Embed<u8>),
    /// Of up to 16 bits.
    Words(Embed<i16>),
}

/// The widest integers that are held as bytes.
const BYTE_BITS: u8 = 8;
const _: () = assert!(LANE_BITS.1 <= 16, "a word holds every integer lane");

impl<'a> Engine<'a> {
    /// The engine for an asset, with the fastest path of this processor.
    #[must_use]
    pub fn new(asset: &'a Asset) -> Engine<'a> {
        let (path, kernels) = Kernels::fastest();
        Engine::with_kernels(asset, path, kernels)
    }

    /// The engine for an asset with one path, if this processor can run it.
    #[must_use]
    pub fn with_path(asset: &'a Asset, path: Path) -> Option<Engine<'a>> {
        Kernels::new(path).map(|kernels| Engine::with_kernels(asset, path, kernels))
    }

    fn with_kernels(asset: &'a Asset, path: Path, kernels: Kernels) -> Engine<'a> {
        let is_narrow = asset.shape.input_bits <= BYTE_BITS;
        Engine {
            asset,
            path,
            kernels,
            inputs: if is_narrow {
                Inputs::Bytes(Embed::new(asset))
            } else {
                Inputs::Words(Embed::new(asset))
            },
            layers: plan::layers(asset),
            widths: Widths::of(asset),
        }
    }

    /// The asset.
    #[must_use]
    pub fn asset(&self) -> &'a Asset {
        self.asset
    }

    /// The instructions in use.
    #[must_use]
    pub fn path(&self) -> Path {
        self.path
    }

    /// Room for [`Engine::texel`].
    #[must_use]
    pub fn scratch(&self) -> Scratch {
        Scratch::new(self)
    }
}
