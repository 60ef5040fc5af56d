//! Texture sets: the images of one material, read as one stack of channels with its mip chain.
//!
//! A set is read from a directory of image files ([`TextureSet::read`] lists the naming
//! conventions) or from a TOML manifest. Every value stays what the file stores: a code divided
//! by the largest code of its depth. Nothing is linearised, re-oriented or resampled here; the
//! [`Encoding`] of a map only says what its codes stand for.

use ndarray::Array3;

mod decode;
mod error;
mod exr_file;
mod manifest;
mod mips;
mod naming;
mod read;
#[cfg(test)]
mod tests;
mod write;

pub use error::TextureSetError;
pub use mips::{mip_chain, mip_count};
pub use ntmu_isa::asset::Encoding;
pub use write::{Depth, MapWriter, WriteMapError, write_map};

/// Most channels a set may have: the widest output the synthesizer is specified for.
pub const MAX_CHANNELS: usize = 16;

/// Largest width or height of a set, in texels.
pub const MAX_SIZE: u32 = 16384;

/// The images of one material, of one size, and their mips.
#[derive(Debug, Clone, PartialEq)]
pub struct TextureSet {
    /// Name of the set: the directory's, or the one in the manifest.
    pub name: String,
    /// Texels per row at mip 0, 1 to [`MAX_SIZE`].
    pub width: u32,
    /// Rows at mip 0, 1 to [`MAX_SIZE`].
    pub height: u32,
    /// The maps in channel order: map *k* owns `first_channel .. first_channel + channel_count`.
    pub maps: Vec<Map>,
    /// One array per mip, `[channel, row, column]`, mip 0 first. Values are stored code / largest
    /// code, in 0..=1; see [`mip_chain`] for the sizes and for how mips are made.
    pub texels: Vec<Array3<f32>>,
    /// Files of the directory that are no part of the set, in the order of their names.
    pub skipped: Vec<Skipped>,
}

/// One image of a texture set.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Map {
    /// `color`, `normal`, `roughness`, `height`, `occlusion`, `metallic`, `opacity`, `emissive`,
    /// `specular`, or the file's own stem when its name follows no known convention.
    pub name: String,
    /// File the map came from, relative to the directory or the manifest. Maps split out of one
    /// packed file share it.
    pub file: String,
    /// Index of the map's first channel in [`TextureSet::texels`].
    pub first_channel: usize,
    /// Number of channels, 1 to 4.
    pub channel_count: usize,
    /// Bits of one stored code: 8, 16, or 32 for floating point.
    pub bit_depth: u8,
    /// What the codes stand for.
    pub encoding: Encoding,
}

/// A file that was found beside the maps and left out.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Skipped {
    /// File name.
    pub file: String,
    /// Why it is no part of the set.
    pub reason: String,
}

impl TextureSet {
    /// Channels of all maps together, 1 to [`MAX_CHANNELS`].
    #[must_use]
    pub fn channel_count(&self) -> usize {
        self.maps.iter().map(|map| map.channel_count).sum()
    }

    /// The map of this name, if the set has one.
    #[must_use]
    pub fn map(&self, name: &str) -> Option<&Map> {
        self.maps.iter().find(|map| map.name == name)
    }
}

impl Map {
    /// Indices of the map's channels in [`TextureSet::texels`].
    #[must_use]
    pub fn channels(&self) -> std::ops::Range<usize> {
        self.first_channel..self.first_channel + self.channel_count
    }
}
