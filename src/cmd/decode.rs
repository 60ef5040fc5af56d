//! `ntmu decode`: an asset to image files.

use super::profile::ProfileChoice;
use crate::Verdict;
use crate::{console, files};
use ndarray::{Axis, Slice};
use ntmu::decoded::reals;
use ntmu::isa::Asset;
use ntmu::isa::asset::Map;
use ntmu::model::engine::Engine;
use ntmu::texture_set::{Depth, MapWriter};
use serde_json::json;
use std::ops::Range;
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
        let mips = self.mip.map_or(0..mip_count, |mip| mip..mip + 1);
        let depth = self.format.map(Format::depth);
        let texels = mips.clone().map(|mip| texels_of(&asset, mip)).sum();
        let bar = console::progress(texels, "decoding");
        let engine = Engine::new(&asset);
        let mut written = Vec::new();
        for mip in mips {
            // A folder holds images of one size, so that it can be read back as a texture set.
            let folder = match self.mip {
                None => self.output.join(format!("mip{mip}")),
                Some(_) => self.output.clone(),
            };
            written.extend(write_mip(&engine, mip, depth, &folder)?);
            bar.inc(texels_of(&asset, mip));
        }
        bar.finish_and_clear();
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

fn texels_of(asset: &Asset, mip: u8) -> u64 {
    let (width, height) = asset.shape.mip_size(mip);
    u64::from(width) * u64::from(height)
}

/// Decodes a mip band by band and writes each map as it comes, so that no more than a band is held.
fn write_mip(
    engine: &Engine<'_>,
    mip: u8,
    depth: Option<Depth>,
    folder: &Path,
) -> anyhow::Result<Vec<PathBuf>> {
    let asset = engine.asset();
    files::make_folder(folder)?;
    let (width, height) = asset.shape.mip_size(mip);
    let mut written = Vec::new();
    let mut writers = Vec::new();
    for map in &asset.metadata.maps {
        let depth = depth.unwrap_or(stored_depth(map));
        let channels = usize::from(map.channel_count);
        let path = folder.join(format!("{}.{}", map.name, depth.extension()));
        let shape = (channels, height as usize, width as usize);
        writers.push((MapWriter::create(&path, shape, depth)?, channels_of(map)));
        written.push(path);
    }
    let mut outcome = Ok(());
    engine.bands(mip, |_, codes| {
        for (writer, channels) in &mut writers {
            if outcome.is_ok() {
                let codes = codes.slice_axis(Axis(0), Slice::from(channels.clone()));
                let formats = &asset.shape.outputs[channels.clone()];
                outcome = writer.rows(&reals(codes, formats).view());
            }
        }
    });
    outcome?;
    for (writer, _) in writers {
        writer.finish()?;
    }
    Ok(written)
}

fn channels_of(map: &Map) -> Range<usize> {
    let first = usize::from(map.first_channel);
    first..first + usize::from(map.channel_count)
}
