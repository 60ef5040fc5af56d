//! `ntmu compare`: an asset against its source.

use super::profile::ProfileChoice;
use crate::Verdict;
use crate::{console, files};
use anyhow::Context as _;
use ndarray::Array3;
use ntmu::decoded::Decoded;
use ntmu::isa::Asset;
use ntmu::quality::{self, Figures, Quality};
use ntmu::texture_set::TextureSet;
use serde_json::json;
use std::path::PathBuf;

#[derive(clap::Args)]
pub(crate) struct Compare {
    /// The source: a folder of images, or a TOML manifest.
    reference: PathBuf,
    /// What is compared with it: an .ntx file, or a folder or manifest of images.
    test: PathBuf,
    /// Fail (exit code 1) when the overall PSNR is below this many dB.
    #[arg(long, value_name = "DB")]
    min_psnr: Option<f64>,
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
            let maps = set
                .maps
                .iter()
                .map(|m| (m.name.clone(), m.channels()))
                .collect();
            (set.texels, test.texels, maps, None)
        };
        let quality = Quality::measure(&reference, &test, &maps)
            .with_context(|| format!("{} and {}", self.reference.display(), self.test.display()))?;
        if json {
            let (bppc, profile) = rate.unzip();
            console::print_json(&json!({ "quality": quality, "bppc": bppc, "profile": profile }))?;
        } else {
            console::print(&table(&quality));
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

/// PSNR and SSIM per map and mip, as people read them.
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
    table.to_string()
}
