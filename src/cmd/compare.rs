//! `ntmu compare`: an asset against its source.

use super::profile::ProfileChoice;
use crate::Verdict;
use crate::{console, files};
use anyhow::Context as _;
use ndarray::{Array2, Array3};
use ntmu::decoded::Decoded;
use ntmu::isa::Asset;
use ntmu::metrics::{LEAST_SIDE, Mask};
use ntmu::quality::{self, Figures, MapQuality, Quality};
use ntmu::texture_set::TextureSet;
use serde_json::json;
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
pub(crate) struct Compare {
    /// The source: a folder of images, or a TOML manifest.
    reference: PathBuf,
    /// What is compared with it: an .ntx file, or a folder or manifest of images.
    test: PathBuf,
    /// Fail (exit code 1) when the overall PSNR is below this many dB.
    #[arg(long, value_name = "DB")]
    min_psnr: Option<f64>,
    /// Print a row for each map and mip as Markdown: PSNR, SSIM, angles of normals, SSIMULACRA2 of
    /// colours.
    #[arg(long)]
    markdown: bool,
    /// Measure only where this grey image of mip 0's size is at least one half.
    #[arg(long, value_name = "FILE")]
    mask: Option<PathBuf>,
    #[command(flatten)]
    profile: ProfileChoice,
}

/// The source of an asset, with the channels that the asset has, in its order.
pub(crate) fn source_of(asset: &Asset, set: &TextureSet) -> anyhow::Result<Vec<Array3<f32>>> {
    let shape = &asset.shape;
    anyhow::ensure!(
        (set.width, set.height) == (shape.width, shape.height),
        "{}: found {} × {} texels; the asset has {} × {}",
        set.name,
        set.width,
        set.height,
        shape.width,
        shape.height
    );
    let maps = |maps: Vec<(String, usize)>| {
        maps.iter()
            .map(|(n, c)| format!("{n} {c}"))
            .collect::<Vec<_>>()
            .join(", ")
    };
    let found: Vec<_> = set
        .maps
        .iter()
        .map(|m| (m.name.clone(), m.channel_count))
        .collect();
    let allowed: Vec<_> = asset
        .metadata
        .maps
        .iter()
        .map(|m| (m.name.clone(), usize::from(m.channel_count)))
        .collect();
    anyhow::ensure!(
        found == allowed,
        "{}: found maps {}; the asset has {}",
        set.name,
        maps(found),
        maps(allowed)
    );
    anyhow::ensure!(
        set.texels.len() >= usize::from(shape.mip_count),
        "{}: found {} mips; the asset has {}",
        set.name,
        set.texels.len(),
        shape.mip_count
    );
    Ok(set.texels[..usize::from(shape.mip_count)].to_vec())
}

impl Compare {
    pub(crate) fn run(self, json: bool) -> anyhow::Result<Verdict> {
        anyhow::ensure!(
            !(json && self.markdown),
            "found --json and --markdown; allowed: one of them"
        );
        let set = TextureSet::read(&self.reference)?;
        let is_asset = self
            .test
            .extension()
            .is_some_and(|e| e.eq_ignore_ascii_case("ntx"));
        let (reference, test, maps, rate) = if is_asset {
            let asset = self.profile.apply(files::read_asset(&self.test)?)?;
            let reference = source_of(&asset, &set)?;
            let bar = console::progress(asset.shape.texel_count(), "decoding");
            let test = Decoded::of(&asset, |done| bar.set_position(done)).reals(&asset.shape);
            bar.finish_and_clear();
            (
                reference,
                test,
                quality::maps_of(&asset),
                Some((quality::bppc(&asset), asset.profile.identity())),
            )
        } else {
            let test = TextureSet::read(&self.test)?;
            let maps = quality::maps_of_set(&set);
            (set.texels, test.texels, maps, None)
        };
        let mask = match &self.mask {
            None => None,
            Some(path) => Some(read_mask(path, &reference[0])?),
        };
        let quality = Quality::measure_within(&reference, &test, &maps, mask.as_ref())
            .with_context(|| format!("{} and {}", self.reference.display(), self.test.display()))?;
        if json {
            let (bppc, profile) = rate.unzip();
            console::print_json(&json!({ "quality": quality, "bppc": bppc, "profile": profile }))?;
        } else {
            console::print(&if self.markdown {
                quality.markdown()
            } else {
                table(&quality)
            });
            if let Some((rate, profile)) = rate {
                console::print(&format!(
                    "{rate:.4} bits per pixel and channel, parameters counted; profile {profile}"
                ));
            }
        }
        let passes = self
            .min_psnr
            .is_none_or(|least| quality.overall.psnr >= least);
        Ok(if passes {
            Verdict::Fine
        } else {
            Verdict::Failed
        })
    }
}

/// The mask in a grey image, which has the size of mip 0.
fn read_mask(path: &Path, mip0: &Array3<f32>) -> anyhow::Result<Mask> {
    let image = image::open(path).with_context(|| path.display().to_string())?;
    let image = image.to_luma32f();
    let (_, rows, columns) = mip0.dim();
    let found = (image.width() as usize, image.height() as usize);
    anyhow::ensure!(
        found == (columns, rows),
        "{}: found {} × {} texels; the set has {columns} × {rows}",
        path.display(),
        found.0,
        found.1
    );
    let coverage = Array2::from_shape_fn((rows, columns), |(row, column)| {
        image.get_pixel(column as u32, row as u32).0[0]
    });
    Ok(Mask::of_coverage(coverage))
}

/// PSNR and SSIM per map and mip, as people read them, and what angles and colours come to.
pub(crate) fn table(quality: &Quality) -> String {
    let mip_count = quality.mips.len();
    let names: Vec<String> = (0..mip_count).map(|mip| format!("mip {mip}")).collect();
    let mut header = vec!["PSNR, dB"];
    header.extend(names.iter().map(String::as_str));
    header.push("all mips");
    header.push("SSIM");
    let mut table = console::table(&header);
    let mut row = |name: &str, mips: &[Figures], overall: Figures| {
        let mut cells = vec![name.to_owned()];
        cells.extend(mips.iter().map(|f| format!("{:.2}", f.psnr)));
        cells.push(format!("{:.2}", overall.psnr));
        cells.push(format!("{:.4}", overall.ssim));
        table.add_row(cells);
    };
    for map in &quality.maps {
        row(&map.map, &map.mips, map.overall);
    }
    row("all maps", &quality.mips, quality.overall);
    let mut text = table.to_string();
    for line in quality.maps.iter().filter_map(beside) {
        text += "\n";
        text += &line;
    }
    text
}

/// What a map has beside PSNR and SSIM, over the whole chain.
fn beside(map: &MapQuality) -> Option<String> {
    if let Some(angles) = &map.angles {
        let all = angles.overall;
        let degrees = |value: Option<f64>| value.map_or("none".to_owned(), |v| format!("{v:.3}°"));
        return Some(format!(
            "{}: angle {} in the mean, {} for 95 of 100, {} at worst; {} of {} normals have none",
            map.map,
            degrees(all.mean),
            degrees(all.p95),
            degrees(all.worst),
            all.undefined,
            all.undefined + all.vectors
        ));
    }
    let perceptual = map.perceptual.as_ref()?;
    let left_out = perceptual.mips.iter().filter(|mip| mip.is_none()).count();
    Some(match perceptual.overall {
        Some(score) => format!(
            "{}: SSIMULACRA2 {score:.2}, without {left_out} mips that are below {LEAST_SIDE} texels",
            map.map
        ),
        None => format!(
            "{}: no SSIMULACRA2, which needs {LEAST_SIDE} × {LEAST_SIDE} texels",
            map.map
        ),
    })
}
