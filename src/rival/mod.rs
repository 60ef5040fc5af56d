//! Rivals: the block codecs that games use today, on the same sets, mips and metrics as the neural
//! ones.
//!
//! ```text
//! TextureSet ─► Packing ─► packs, each with its mips ─► astcenc | BC4, BC5, BC7 ─► Coded
//! ```
//!
//! | module | answers |
//! |---|---|
//! | [`packing`] | which channels share an image, which are not stored at all |
//! | [`normal`] | when the third channel of a normal map follows from the other two |
//! | [`astc`], [`astcenc`] | ASTC, by Arm's own encoder |
//! | [`bc`] | BC4, BC5 and BC7 |
//!
//! A codec's result is a chain of mips in the set's own channels, whatever the codec did with them,
//! so that [`crate::quality::Quality::measure`] compares like with like.

use crate::metrics;
use ndarray::Array3;
use std::path::PathBuf;

pub mod astc;
mod astc_files;
pub mod astcenc;
pub mod bc;
pub mod normal;
pub mod packing;
#[cfg(test)]
mod tests;

/// A texture set after a block codec.
#[derive(Clone, Debug, PartialEq)]
pub struct Coded {
    /// As decoded: one array per mip, \[channel, row, column\], 0..=1.
    pub mips: Vec<Array3<f32>>,
    /// Bits of all blocks, per mip.
    pub bits: Vec<u64>,
    /// What was stored together and how, in words: `color+opacity as RGBA, sRGB`.
    pub packs: Vec<String>,
    /// The encoder with its version.
    pub encoder: String,
    /// Seconds of encoding, the encoder's own reading of files included.
    pub encode_seconds: f64,
    /// Seconds of decoding.
    pub decode_seconds: f64,
}

impl Coded {
    /// Bits per pixel and channel with the blocks of every mip over the texels of mip 0: what
    /// compares with [`crate::quality::bppc`], where one pair of grids serves the whole chain.
    #[must_use]
    pub fn bppc(&self) -> f64 {
        self.over_mip0(self.bits.iter().sum())
    }

    /// Bits per pixel and channel of mip 0 alone: the rate that a block format is named after.
    #[must_use]
    pub fn bppc_mip0(&self) -> f64 {
        self.over_mip0(self.bits.first().copied().unwrap_or(0))
    }

    fn over_mip0(&self, bits: u64) -> f64 {
        let (channels, height, width) = self.mips.first().map_or((0, 0, 0), Array3::dim);
        metrics::bppc(bits, 0, width as u32, height as u32, channels)
    }
}

/// Why a block codec gave no result.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RivalError {
    /// There is no `astcenc` on this machine.
    #[error(
        "astcenc: found none (looked for {looked_for}); it comes with `apt-get install astcenc`, or \
         from github.com/ARM-software/astc-encoder; the variable NTMU_ASTCENC may name it"
    )]
    NoAstcenc {
        /// The programs tried.
        looked_for: String,
    },
    /// `astcenc` failed.
    #[error("{command}: {found}")]
    Astcenc {
        /// What was run.
        command: String,
        /// Its status and what it said.
        found: String,
    },
    /// The block size is none of ASTC's.
    #[error("ASTC block: found {found:?}; allowed: {allowed}")]
    Block {
        /// What was found.
        found: String,
        /// The sizes of ASTC.
        allowed: String,
    },
    /// The encoder's effort is out of range.
    #[error(
        "ASTC quality: found {found:?}; allowed: 0 to 100, fastest, fast, medium, thorough, \
         verythorough, exhaustive"
    )]
    AstcQuality {
        /// What was found.
        found: String,
    },
    /// A file of the encoder cannot be read or written.
    #[error("{}: {found}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        found: String,
    },
}
