//! `ntmu study`: everything the project can say about one asset.

mod print;

use super::profile::ProfileChoice;
use crate::Verdict;
use crate::{console, files};
use anyhow::Context as _;
use ndarray::{Array3, Axis, Slice};
use ntmu::built_in;
use ntmu::decoded::Decoded;
use ntmu::isa::Asset;
use ntmu::quality::{self, Quality};
use ntmu::report::{self, MapPicture};
use ntmu::study::{self, AssetStudy, Study as Results};
use ntmu::texture_set::TextureSet;
use ntmu::timing::lab::Sizes;
use std::path::PathBuf;

#[derive(clap::Args)]
pub(crate) struct Study {
    /// The asset, an .ntx file; the built-in one when left out.
    asset: Option<PathBuf>,
    /// The source to compare with: a folder of images, or a TOML manifest. The built-in asset has
    /// its own.
    #[arg(long, value_name = "DIR", requires = "asset")]
    against: Option<PathBuf>,
    /// The folder for report.html, study.json and vectors.json.
    #[arg(short, long, value_name = "DIR", default_value = "study")]
    output: PathBuf,
    /// Time the unit on small scenes: sooner done, and more about the start of a run than about its
    /// middle.
    #[arg(long)]
    quick: bool,
    #[command(flatten)]
    profile: ProfileChoice,
}

impl Study {
    pub(crate) fn run(self, json: bool) -> anyhow::Result<Verdict> {
        let (asset, reference) = self.read()?;
        // A folder that cannot be made is found out before the work, not after it.
        files::make_folder(&self.output)?;
        let sizes = if self.quick {
            Sizes::QUICK
        } else {
            Sizes::STUDY
        };
        let (results, decoded) = study(&asset, reference.as_deref(), &sizes)?;

        let reals = decoded.reals(&asset.shape);
        let pictures = pictures(&asset, reference.as_deref(), &reals);
        let html = report::html(&results, &pictures)?;
        let mut data = serde_json::to_string_pretty(&results)?;
        data.push('\n');
        files::write(&self.output.join("report.html"), html.as_bytes())?;
        files::write(&self.output.join("study.json"), data.as_bytes())?;
        let vectors = study::vectors(&asset)?;
        files::write(&self.output.join("vectors.json"), vectors.as_bytes())?;

        if json {
            console::print(&data);
        } else {
            print::results(&results);
        }
        let place = self.output.display();
        console::note(&format!(
            "wrote {place}/report.html, {place}/study.json, {place}/vectors.json"
        ));
        Ok(if results.holds() {
            Verdict::Fine
        } else {
            Verdict::Failed
        })
    }

    fn read(&self) -> anyhow::Result<(Asset, Option<Vec<Array3<f32>>>)> {
        let Some(path) = &self.asset else {
            let asset = built_in::asset().context("the built-in asset")?;
            let asset = self.profile.apply(asset)?;
            let reference = super::compare::source_of(&asset, &built_in::source())?;
            return Ok((asset, Some(reference)));
        };
        let asset = self.profile.apply(files::read_asset(path)?)?;
        let reference = match &self.against {
            None => None,
            Some(folder) => Some(super::compare::source_of(
                &asset,
                &TextureSet::read(folder)?,
            )?),
        };
        Ok((asset, reference))
    }
}

/// Runs every part of the study, with progress on stderr.
fn study(
    asset: &Asset,
    reference: Option<&[Array3<f32>]>,
    sizes: &Sizes,
) -> anyhow::Result<(Results, Decoded)> {
    let texels = asset.shape.texel_count();
    let bar = console::progress(texels, "model");
    let decoded = Decoded::of(asset, |done| bar.set_position(done));
    bar.finish_and_clear();

    let quality = match reference {
        None => None,
        Some(reference) => {
            let reals = decoded.reals(&asset.shape);
            Some(Quality::measure(
                reference,
                &reals,
                &quality::maps_of(asset),
            )?)
        }
    };
    let bar = console::progress(texels, "oracle");
    let oracle = study::compare_with_oracle(asset, &decoded, |done| bar.set_position(done));
    bar.finish_and_clear();

    let bar = console::progress(1, "claims");
    let engine = study::compare_with_reference(asset);
    let claims = study::try_claims(asset);
    bar.finish_and_clear();

    let bar = console::progress(u64::from(asset.shape.mip_count), "twin");
    let twin = study::compare_with_twin(asset, &decoded, |done| bar.set_position(done));
    bar.finish_and_clear();

    let bar = console::progress(study::timing_points(asset), "units");
    let timing = study::simulate(asset, sizes, |done| bar.set_position(done))?;
    bar.finish_and_clear();
    let bar = console::progress(study::experiment_points(asset), "lab");
    let lab = study::experiment(asset, sizes, |done| bar.set_position(done))?;
    bar.finish_and_clear();

    let bar = console::progress(study::sweep_points(asset), "sweep");
    let sweep = match reference {
        None => Vec::new(),
        Some(reference) => study::sweep(asset, reference, |done| bar.set_position(done))?,
    };
    bar.finish_and_clear();
    let bar = console::progress(study::in_between_points(asset), "between mips");
    let in_between = match reference {
        None => Vec::new(),
        Some(reference) => study::in_between(asset, reference, |done| bar.set_position(done))?,
    };
    bar.finish_and_clear();

    let bar = console::progress(study::variant_count(asset)?, "variants");
    let variants = study::variants(asset, reference, |done| bar.set_position(done))?;
    bar.finish_and_clear();
    let asset = AssetStudy::of(asset);
    Ok((
        Results {
            asset,
            quality,
            oracle,
            engine,
            claims,
            twin,
            timing,
            lab: Some(lab),
            sweep,
            in_between,
            variants,
        },
        decoded,
    ))
}

/// Mip 0 of every map, source beside decoded.
fn pictures<'a>(
    asset: &'a Asset,
    reference: Option<&'a [Array3<f32>]>,
    reals: &'a [Array3<f32>],
) -> Vec<MapPicture<'a>> {
    asset
        .metadata
        .maps
        .iter()
        .map(|map| {
            let first = usize::from(map.first_channel);
            let channels = Slice::from(first..first + usize::from(map.channel_count));
            MapPicture {
                map: &map.name,
                source: reference.map(|mips| mips[0].slice_axis(Axis(0), channels)),
                decoded: reals[0].slice_axis(Axis(0), channels),
            }
        })
        .collect()
}
