//! What can be wrong with a texture set on disk.

use std::path::PathBuf;

use super::{MAX_CHANNELS, MAX_SIZE};

/// Why a texture set was refused: where, what was found, and what is allowed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TextureSetError {
    /// The file system said no.
    #[error("{}: cannot be read: {source}", path.display())]
    Io {
        /// File or directory.
        path: PathBuf,
        /// The system's answer.
        source: std::io::Error,
    },
    /// The path is neither a directory nor a manifest.
    #[error(
        "{}: found a file, allowed is a directory of images or a .toml manifest",
        path.display()
    )]
    NotASet {
        /// The path given.
        path: PathBuf,
    },
    /// No file of the directory is an image that can be read.
    #[error(
        "{}: found no image, allowed are files named .png .jpg .jpeg .tga .tif .tiff .exr",
        path.display()
    )]
    NoImages {
        /// The directory.
        path: PathBuf,
    },
    /// The manifest is not TOML, or not of the manifest's form.
    #[error("{}: found {found}, allowed is {allowed}", path.display())]
    Manifest {
        /// The manifest.
        path: PathBuf,
        /// What is wrong, with the line where TOML knows it.
        found: String,
        /// What may stand there.
        allowed: &'static str,
    },
    /// An image file is corrupt, truncated, or of a kind that is not supported.
    #[error("{}: cannot be decoded: {found}", path.display())]
    Decode {
        /// The image file.
        path: PathBuf,
        /// The decoder's words.
        found: String,
    },
    /// An image is empty or too large; told from its header, before any texel is read.
    #[error(
        "{}: found {width} x {height} texels, allowed are 1 to {MAX_SIZE} in each direction",
        path.display()
    )]
    Size {
        /// The image file.
        path: PathBuf,
        /// Texels per row found.
        width: u64,
        /// Rows found.
        height: u64,
    },
    /// Two images of the set differ in size.
    #[error(
        "{} is {} x {} texels and {} is {} x {}, allowed is one size for all maps of a set \
         (move images that are no maps elsewhere, or list the maps in a manifest)",
        first.display(), first_size.0, first_size.1,
        second.display(), second_size.0, second_size.1
    )]
    MixedSizes {
        /// One file.
        first: PathBuf,
        /// Its width and height.
        first_size: (u32, u32),
        /// Another file.
        second: PathBuf,
        /// Its width and height.
        second_size: (u32, u32),
    },
    /// Two files hold the same map.
    #[error(
        "map `{map}` found in both {} and {}, allowed is one file for a map \
         (remove one, or list the maps in a manifest)",
        first.display(), second.display()
    )]
    DuplicateMap {
        /// The map's name.
        map: String,
        /// One file.
        first: PathBuf,
        /// Another file.
        second: PathBuf,
    },
    /// A map is said to lie in an alpha channel that the file does not have.
    #[error(
        "{}: found no alpha channel, allowed is an image with alpha because map `{map}` is read \
         from it",
        path.display()
    )]
    NoAlpha {
        /// The image file.
        path: PathBuf,
        /// The map that should lie there.
        map: String,
    },
    /// A floating-point texel is outside 0..=1 or not a number.
    #[error(
        "{}: found {found} at component {component}, row {row}, column {column}, allowed is 0 to 1",
        path.display()
    )]
    Range {
        /// The image file.
        path: PathBuf,
        /// Component within the file, from 0.
        component: usize,
        /// Row from the top, from 0.
        row: usize,
        /// Column from the left, from 0.
        column: usize,
        /// The value.
        found: f32,
    },
    /// The maps have more channels than a set may have.
    #[error(
        "{}: found {} channels ({}), allowed are 1 to {MAX_CHANNELS}",
        path.display(), total(maps), listed(maps)
    )]
    TooManyChannels {
        /// The directory or manifest.
        path: PathBuf,
        /// Every map and its number of channels.
        maps: Vec<(String, usize)>,
    },
}

fn total(maps: &[(String, usize)]) -> usize {
    maps.iter().map(|(_, channels)| channels).sum()
}

fn listed(maps: &[(String, usize)]) -> String {
    let parts: Vec<_> = maps
        .iter()
        .map(|(name, channels)| format!("{name} {channels}"))
        .collect();
    parts.join(", ")
}
