//! `ntmu decode`: an asset to image files.

use super::profile::ProfileChoice;
use crate::Verdict;
use crate::{console, files};
use ndarray::{Axis, Slice};
use ntmu::decoded::Decoded;
use ntmu::isa::Asset;
use ntmu::isa::asset::Map;
use ntmu::texture_set::{Depth, write_map};
use serde_json::json;
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
pub(crate) struct Decode {
    /// The asset, an .ntx file.
    asset: PathBuf,
    /// The folder for the images: DIR/mip0, DIR/mip1, …; DIR itself with --mip.
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Only this mip; every mip without it.
    #[arg(long)]
    mip: Option<u8>,
    /// How to store the texels; by default as in the source: png8, png16, or exr for floats.
    #[arg(long, value_enum)]
    format: Option<Format>,
    #[command(flatten)]
    profile: ProfileChoice,
}

#[derive(Clone, Copy, clap::ValueEnum)]
enum Format {
    Png8,
    Png16,
    Exr,
}

impl Format {
    fn depth(self) -> Depth {
        match self {
            Format::Png8 => Depth::Eight,
            Format::Png16 => Depth::Sixteen,
            Format::Exr => Depth::Float,
        }
    }
}

/// The depth in which a map was stored in its source.
fn stored_depth(map: &Map) -> Depth {
    match map.bit_depth {
        8 => Depth::Eight,
        16 => Depth::Sixteen,
        _ => Depth::Float,
    }
}

impl Decode {
    pub(crate) fn run(self, json: bool) -> anyhow::Result<Verdict> {
        let asset = self.profile.apply(files::read_asset(&self.asset)?)?;
        let mip_count = asset.shape.mip_count;
        if let Some(mip) = self.mip {
            anyhow::ensure!(
                mip < mip_count,
                "mip {mip}: the asset has mips 0..={}",
                mip_count - 1
            );
        }
        let bar = console::progress(asset.shape.texel_count(), "decoding");
        let decoded = match self.mip {
            None => Decoded::of(&asset, |done| bar.set_position(done)),
            Some(mip) => Decoded::of_mip(&asset, mip),
        };
        bar.finish_and_clear();
        let depth = self.format.map(Format::depth);
        let written = write_all(&asset, &decoded, self.mip, depth, &self.output)?;
        if json {
            console::print_json(
                &json!({ "profile": asset.profile.identity(), "written": written }),
            )?;
        } else {
            console::print(
                &written
                    .iter()
                    .map(|p| p.display().to_string())
                    .collect::<Vec<_>>()
                    .join("\n"),
            );
        }
        Ok(Verdict::Fine)
    }
}

fn write_all(
    asset: &Asset,
    decoded: &Decoded,
    only_mip: Option<u8>,
    depth: Option<Depth>,
    folder: &Path,
) -> anyhow::Result<Vec<PathBuf>> {
    let (first_mip, is_chain) = (only_mip.unwrap_or(0), only_mip.is_none());
    let mut written = Vec::new();
    for (mip, texels) in (first_mip..).zip(decoded.reals(&asset.shape)) {
        // A folder holds images of one size, so that it can be read back as a texture set.
        let folder = if is_chain {
            folder.join(format!("mip{mip}"))
        } else {
            folder.to_owned()
        };
        files::make_folder(&folder)?;
        for map in &asset.metadata.maps {
            let depth = depth.unwrap_or(stored_depth(map));
            let channels =
                usize::from(map.first_channel)..usize::from(map.first_channel + map.channel_count);
            let extension = depth.extension();
            let path = folder.join(format!("{}.{extension}", map.name));
            write_map(
                &path,
                &texels.slice_axis(Axis(0), Slice::from(channels)),
                depth,
            )?;
            written.push(path);
        }
    }
    Ok(written)
}
