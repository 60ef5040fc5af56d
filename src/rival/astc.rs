//! ASTC: every mip of every pack through `astcenc` and back.
//!
//! | pack | encoded as | swizzle | decoded as |
//! |---|---|---|---|
//! | sRGB codes of 8 bits | `-cs` from PNG | as they are | `-ds` to PNG |
//! | other codes of 8 bits | `-cl` from PNG | as they are; two channels L + A, one L | `-dl` to PNG |
//! | X and Y of normals | `-cl -normal` | `rrrg` | `-dl -dsw ra01` |
//! | codes of more than 8 bits | `-cl` from EXR | as above | `-dl` to EXR |
//!
//! `-cs` changes no code: it has the encoder interpolate as the hardware does for sRGB formats, to 8
//! bits. `astcenc` reads the upper 8 bits of a 16-bit PNG only, so deeper maps are given to it as EXR,
//! which it holds in binary16 (11 bits below 1), as a GPU without the decode mode extension returns
//! them; an sRGB map that is deep is coded `-cl`, because `-cs` would cut it to 8 bits.
//! Errors of all stored channels weigh the same, as in the metric: `-perceptual` and `-mask` are not
//! used, and `-ssw` says which channels are read.

use super::astc_files::Files;
use super::astcenc::Astcenc;
use super::packing::{Pack, PackKind, Packing, Scalars};
use super::{Coded, RivalError};
use crate::texture_set::TextureSet;
use serde::{Deserialize, Serialize};
use std::ffi::OsString;
use std::fmt;
use std::str::FromStr;
use std::time::Instant;

/// Bits of a block, whatever its size.
pub const BLOCK_BITS: u64 = 128;

/// A block's size in texels: one of the fourteen of ASTC.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Block {
    width: u32,
    height: u32,
}

impl Block {
    /// All, smallest first.
    pub const ALL: [Block; 14] = {
        const fn block(width: u32, height: u32) -> Block {
            Block { width, height }
        }
        [
            block(4, 4),
            block(5, 4),
            block(5, 5),
            block(6, 5),
            block(6, 6),
            block(8, 5),
            block(8, 6),
            block(10, 5),
            block(10, 6),
            block(8, 8),
            block(10, 8),
            block(10, 10),
            block(12, 10),
            block(12, 12),
        ]
    };

    /// Bits of an image of this size: whole blocks.
    #[must_use]
    pub fn image_bits(self, width: u32, height: u32) -> u64 {
        let blocks = |texels: u32, side: u32| u64::from(texels.div_ceil(side));
        blocks(width, self.width) * blocks(height, self.height) * BLOCK_BITS
    }
}

impl fmt::Display for Block {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}x{}", self.width, self.height)
    }
}

impl FromStr for Block {
    type Err = RivalError;

    fn from_str(text: &str) -> Result<Block, RivalError> {
        let found = Block::ALL.into_iter().find(|b| b.to_string() == text);
        found.ok_or_else(|| RivalError::Block {
            found: text.to_owned(),
            allowed: Block::ALL.map(|block| block.to_string()).join(", "),
        })
    }
}

impl TryFrom<String> for Block {
    type Error = RivalError;

    fn try_from(text: String) -> Result<Block, RivalError> {
        text.parse()
    }
}

impl From<Block> for String {
    fn from(block: Block) -> String {
        block.to_string()
    }
}

/// How hard the encoder tries, 0 to 100, in its own measure.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct AstcQuality(u8);

/// The names that `astcenc` has for some of them.
const QUALITIES: [(&str, u8); 6] = [
    ("fastest", 0),
    ("fast", 10),
    ("medium", 60),
    ("thorough", 98),
    ("verythorough", 99),
    ("exhaustive", 100),
];

impl AstcQuality {
    /// What the paper and NTC's take: `-exhaustive`.
    pub const EXHAUSTIVE: AstcQuality = AstcQuality(100);

    /// As `astcenc` takes it: `-exhaustive`, or a number.
    fn argument(self) -> String {
        match QUALITIES.iter().find(|(_, quality)| *quality == self.0) {
            Some((name, _)) => format!("-{name}"),
            None => self.0.to_string(),
        }
    }
}

impl fmt::Display for AstcQuality {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.argument().trim_start_matches('-'))
    }
}

impl FromStr for AstcQuality {
    type Err = RivalError;

    fn from_str(text: &str) -> Result<AstcQuality, RivalError> {
        let named = QUALITIES.iter().find(|(name, _)| *name == text);
        let quality = named.map(|(_, quality)| *quality);
        let quality = quality.or_else(|| text.parse().ok().filter(|&quality| quality <= 100));
        quality
            .map(AstcQuality)
            .ok_or_else(|| RivalError::AstcQuality {
                found: text.to_owned(),
            })
    }
}

impl TryFrom<String> for AstcQuality {
    type Error = RivalError;

    fn try_from(text: String) -> Result<AstcQuality, RivalError> {
        text.parse()
    }
}

impl From<AstcQuality> for String {
    fn from(quality: AstcQuality) -> String {
        quality.to_string()
    }
}

/// Codes a set and decodes it again. `after_image` hears of the images done and of all there are.
///
/// # Errors
/// [`RivalError`] when the program fails or a file between cannot be written or read.
pub fn code(
    set: &TextureSet,
    block: Block,
    quality: AstcQuality,
    astcenc: &Astcenc,
    after_image: &mut dyn FnMut(usize, usize),
) -> Result<Coded, RivalError> {
    let packing = Packing::of(set, Scalars::Together);
    let folder = tempfile::tempdir().map_err(|error| RivalError::File {
        path: std::env::temp_dir(),
        found: error.to_string(),
    })?;
    let total = packing.packs.len() * set.texels.len();
    let mut coded = Coded {
        mips: Vec::with_capacity(set.texels.len()),
        bits: Vec::with_capacity(set.texels.len()),
        packs: packing.words(),
        encoder: astcenc.version().to_owned(),
        encode_seconds: 0.0,
        decode_seconds: 0.0,
    };
    let mut done = 0;
    for mip in &set.texels {
        let mut images = Vec::with_capacity(packing.packs.len());
        let mut bits = 0;
        for pack in &packing.packs {
            let files = Files::new(folder.path(), pack);
            let (_, height, width) = mip.dim();
            files.write(pack.image(mip.view()).view())?;
            let started = Instant::now();
            astcenc.run(&encoding(&files, pack, block, quality))?;
            coded.encode_seconds += started.elapsed().as_secs_f64();
            bits += files.bits(block.image_bits(width as u32, height as u32))?;
            let started = Instant::now();
            astcenc.run(&decoding(&files, pack))?;
            coded.decode_seconds += started.elapsed().as_secs_f64();
            images.push(files.read((height, width))?);
            done += 1;
            after_image(done, total);
        }
        let (_, height, width) = mip.dim();
        coded.mips.push(packing.assemble(&images, (height, width)));
        coded.bits.push(bits);
    }
    Ok(coded)
}

fn is_srgb(pack: &Pack) -> bool {
    pack.is_srgb && !pack.is_deep
}

fn encoding(files: &Files, pack: &Pack, block: Block, quality: AstcQuality) -> Vec<OsString> {
    let mut arguments: Vec<OsString> = vec![
        if is_srgb(pack) { "-cs" } else { "-cl" }.into(),
        files.source.clone().into(),
        files.blocks.clone().into(),
        block.to_string().into(),
        quality.argument().into(),
    ];
    let more: &[&str] = match (pack.kind, pack.channels.len()) {
        // Its own swizzle is rrrg, with green and blue not read.
        (PackKind::Normal, _) => &["-normal"],
        (PackKind::Codes, 1) => &["-esw", "rrr1", "-ssw", "r"],
        (PackKind::Codes, 2) => &["-esw", "rrrg", "-ssw", "ra"],
        (PackKind::Codes, 3) => &["-esw", "rgb1", "-ssw", "rgb"],
        (PackKind::Codes, _) => &[],
    };
    arguments.extend(more.iter().map(OsString::from));
    arguments
}

fn decoding(files: &Files, pack: &Pack) -> Vec<OsString> {
    let mut arguments: Vec<OsString> = vec![
        if is_srgb(pack) { "-ds" } else { "-dl" }.into(),
        files.blocks.clone().into(),
        files.decoded.clone().into(),
    ];
    let more: &[&str] = match (pack.kind, pack.channels.len()) {
        (PackKind::Normal, _) | (PackKind::Codes, 2) => &["-dsw", "ra01"],
        (PackKind::Codes, _) => &[],
    };
    arguments.extend(more.iter().map(OsString::from));
    arguments
}
