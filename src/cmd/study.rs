//! `ntmu study`: everything the project can say about one asset.

use crate::Verdict;
use crate::{console, files};
use anyhow::Context as _;
use ndarray::{Array3, Axis, Slice};
use ntmu::built_in;
use ntmu::decoded::Decoded;
use ntmu::isa::Asset;
use ntmu::quality::{self, Quality};
use ntmu::report::{self, MapPicture};
use ntmu::study::{self, AssetStudy, Study as Results, TwinStudy};
use ntmu::texture_set::TextureSet;
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
}

impl Study {
    pub(crate) fn run(self, json: bool) -> anyhow::Result<Verdict> {
        let (asset, reference) = self.read()?;
        // A folder that cannot be made is found out before the work, not after it.
        files::make_folder(&self.output)?;
        let (results, decoded) = study(&asset, reference.as_deref())?;

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
            print(&results);
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
            let reference = super::compare::source_of(&asset, &built_in::source())?;
            return Ok((asset, Some(reference)));
        };
        let asset = files::read_asset(path)?;
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
fn study(asset: &Asset, reference: Option<&[Array3<f32>]>) -> anyhow::Result<(Results, Decoded)> {
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

    let bar = console::progress(u64::from(asset.shape.mip_count), "twin");
    let twin = study::compare_with_twin(asset, &decoded, |done| bar.set_position(done));
    bar.finish_and_clear();

    let bar = console::progress(study::timing_points(), "units");
    let timing = study::simulate(asset, |done| bar.set_position(done));
    bar.finish_and_clear();

    let bar = console::progress(study::sweep_points(asset), "sweep");
    let sweep = match reference {
        None => Vec::new(),
        Some(reference) => study::sweep(asset, reference, |done| bar.set_position(done))?,
    };
    bar.finish_and_clear();
    let asset = AssetStudy::of(asset);
    Ok((
        Results {
            asset,
            quality,
            oracle,
            twin,
            timing,
            sweep,
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

fn print(results: &Results) {
    let asset = &results.asset;
    console::print(&format!(
        "{}: {} × {} texels, {} mips, {} channels; {} multiplications per texel; {:.4} bits per \
         pixel and channel",
        asset.name,
        asset.size.0,
        asset.size.1,
        asset.mips,
        asset.channels,
        asset.macs_per_texel,
        asset.bppc
    ));
    if let Some(quality) = &results.quality {
        console::print(&super::compare::table(quality));
    }
    print_oracle(results);
    match &results.twin {
        TwinStudy::Ran {
            adapter,
            codes,
            differing: 0,
            ..
        } => {
            console::print(&format!("model = twin on all {codes} codes ({adapter})"));
        }
        TwinStudy::Ran {
            adapter,
            codes,
            differing,
            first,
        } => console::print(&format!(
            "MODEL AND TWIN DIFFER on {differing} of {codes} codes ({adapter}); the first, as \
             (mip, channel, row, column, model, twin): {first:?}"
        )),
        TwinStudy::Failed { reason } => console::print(&format!("THE TWIN FAILED: {reason}")),
        TwinStudy::Skipped { reason } => console::print(&format!("twin skipped: {reason}")),
    }
    print_timing(results);
    if !results.sweep.is_empty() {
        let mut table = console::table(&["latent bits", "weight bits", "PSNR, dB", "BPPC"]);
        for point in &results.sweep {
            table.add_row([
                point.latent_bits.to_string(),
                point.weight_bits.to_string(),
                format!("{:.2}", point.psnr),
                format!("{:.4}", point.bppc),
            ]);
        }
        console::print("precision sweep, the same training rounded to fewer bits:");
        console::print(&table.to_string());
    }
}

/// Differences up to this one have a row of their own; study.json has them all.
const SHOWN_DIFFERENCE: u64 = 8;

fn print_oracle(results: &Results) {
    let oracle = &results.oracle;
    let mut table = console::table(&["model − oracle, LSB", "codes"]);
    let (shown, beyond): (Vec<_>, Vec<_>) = oracle
        .histogram
        .iter()
        .partition(|(difference, _)| difference.unsigned_abs() <= SHOWN_DIFFERENCE);
    for (difference, count) in shown {
        table.add_row([format!("{difference:+}"), count.to_string()]);
    }
    if !beyond.is_empty() {
        let count: u64 = beyond.iter().map(|(_, count)| count).sum();
        table.add_row([format!("beyond ±{SHOWN_DIFFERENCE}"), count.to_string()]);
    }
    console::print(&table.to_string());
    console::print(&format!(
        "largest |model − oracle| {:.3} LSB (proven bound {:.1}); root mean square {:.3} (predicted {:.3})",
        oracle.max, oracle.bound, oracle.rms, oracle.typical
    ));
}

fn print_timing(results: &Results) {
    let mut table = console::table(&[
        "unit",
        "layout",
        "cycles/block",
        "at least",
        "bytes/block",
        "hits",
        "MACs busy",
        "Mtexel/s",
        "bottleneck",
    ]);
    for row in &results.timing {
        table.add_row([
            row.unit.clone(),
            row.layout.clone(),
            format!("{:.1}", row.cycles_per_block),
            format!("{:.1}", row.closed_form_per_block),
            format!("{:.1}", row.bytes_per_block),
            format!("{:.1} %", 100.0 * row.hit_rate),
            format!("{:.1} %", 100.0 * row.mac_utilisation),
            format!("{:.1}", row.mtexels_per_second),
            row.bottleneck.clone(),
        ]);
    }
    console::print(&table.to_string());
    for row in &results.timing {
        let charges: Vec<String> = row
            .ledger
            .iter()
            .filter(|charge| 1000 * charge.cycles >= row.cycles)
            .map(|c| {
                format!(
                    "{} {:.1} %",
                    c.cause,
                    100.0 * c.cycles as f64 / row.cycles as f64
                )
            })
            .collect();
        console::print(&format!(
            "{} {}: {}",
            row.unit,
            row.layout,
            charges.join(", ")
        ));
    }
}
