//! `ntmu analyse`: what the grids of an asset hold.

use crate::Verdict;
use crate::{console, files};
use anyhow::Context as _;
use ntmu::analysis::fourier::{EXPECTED, FourierSummary};
use ntmu::analysis::{self, Alignment, GridFourier, Similarity, SimilarityError};
use ntmu::isa::Asset;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Writes analysis.json, a picture of CKA for each grid of a pyramid, and pictures of channels and
/// of their Fourier transforms.
#[derive(clap::Args)]
pub(crate) struct Analyse {
    /// The asset, an .ntx file.
    asset: PathBuf,
    /// The folder for the results.
    #[arg(short, long, value_name = "FOLDER")]
    output: PathBuf,
    /// Only these channels, from 0, of each grid that has them; every channel without it.
    #[arg(long, value_name = "CHANNEL")]
    channel: Vec<usize>,
    /// The level of the grids whose frequencies are shown.
    #[arg(long, default_value_t = 0)]
    level: u8,
    /// How two levels are brought to common places for CKA.
    #[arg(long, value_enum, default_value = "pool")]
    align: AlignmentChoice,
}

#[derive(Clone, Copy, clap::ValueEnum)]
enum AlignmentChoice {
    /// At the coarser level: the mean of the finer cells on the same texels.
    Pool,
    /// At the finer level: the coarser one interpolated.
    Bilinear,
}

impl AlignmentChoice {
    fn alignment(self) -> Alignment {
        match self {
            AlignmentChoice::Pool => Alignment::Pool,
            AlignmentChoice::Bilinear => Alignment::Bilinear,
        }
    }
}

impl Analyse {
    pub(crate) fn run(self, json: bool) -> anyhow::Result<Verdict> {
        let asset = files::read_asset(&self.asset)?;
        let levels = Levels::of(&asset, self.align.alignment())?;
        let spectra = self.spectra(&asset)?;
        files::make_folder(&self.output)?;
        for similarity in &levels.alike {
            let stem = format!("cka_grid{}", similarity.grid);
            self.write(&format!("{stem}.svg"), similarity.svg().as_bytes())?;
            self.write(&format!("{stem}.png"), &similarity.png()?)?;
        }
        for grid in &spectra {
            self.write_pictures(grid)?;
        }
        let summaries: Vec<FourierSummary> = spectra.iter().map(GridFourier::summary).collect();
        let document = document(&asset, &levels, &summaries);
        let text = serde_json::to_string_pretty(&document)?;
        self.write("analysis.json", text.as_bytes())?;
        if json {
            console::print_json(&document)?;
        } else {
            print(&levels, &summaries, &self.output);
        }
        Ok(Verdict::Fine)
    }

    /// Both grids' transforms. A channel must be in one of them at least.
    fn spectra(&self, asset: &Asset) -> anyhow::Result<Vec<GridFourier>> {
        let counts = asset.shape.grids.map(|grid| usize::from(grid.channels));
        let most = counts[0].max(counts[1]);
        if let Some(found) = self.channel.iter().find(|channel| **channel >= most) {
            anyhow::bail!(
                "--channel: found {found}; allowed: 0 to {} in grid 0 and 0 to {} in grid 1",
                counts[0] - 1,
                counts[1] - 1
            );
        }
        let mut spectra = Vec::new();
        for (grid, count) in counts.into_iter().enumerate() {
            let wanted = self
                .channel
                .iter()
                .copied()
                .filter(|channel| *channel < count);
            let wanted: Option<Vec<usize>> = (!self.channel.is_empty()).then(|| wanted.collect());
            if wanted.as_ref().is_some_and(Vec::is_empty) {
                continue;
            }
            spectra.push(analysis::fourier(
                asset,
                grid,
                self.level,
                wanted.as_deref(),
            )?);
        }
        Ok(spectra)
    }

    fn write_pictures(&self, grid: &GridFourier) -> anyhow::Result<()> {
        let stem = format!("grid{}", grid.grid);
        let mean = analysis::spectrum_png(&grid.mean)?;
        self.write(&format!("{stem}_fourier.png"), &mean)?;
        for channel in &grid.channels {
            let stem = format!("{stem}_channel{:02}", channel.channel);
            let latents = analysis::latents_png(channel.latents.view())?;
            self.write(&format!("{stem}.png"), &latents)?;
            let spectrum = analysis::spectrum_png(&channel.spectrum)?;
            self.write(&format!("{stem}_fourier.png"), &spectrum)?;
        }
        Ok(())
    }

    fn write(&self, name: &str, bytes: &[u8]) -> anyhow::Result<()> {
        files::write(&self.output.join(name), bytes).context("analyse")
    }
}

/// Both grids' levels against each other, or why there is nothing to compare.
struct Levels {
    alike: Vec<Similarity>,
    /// Why `alike` is empty.
    reason: Option<String>,
}

impl Levels {
    fn of(asset: &Asset, alignment: Alignment) -> anyhow::Result<Levels> {
        let alike = (0..2).map(|grid| analysis::similarity(asset, grid, alignment));
        match alike.collect::<Result<Vec<_>, _>>() {
            Ok(alike) => Ok(Levels {
                alike,
                reason: None,
            }),
            Err(error @ SimilarityError::OneLevel { .. }) => Ok(Levels {
                alike: Vec::new(),
                reason: Some(error.to_string()),
            }),
            Err(error) => Err(error.into()),
        }
    }
}

/// The shares of grid 0 and grid 1 below half of Nyquist's frequency, where both were transformed.
fn shares(summaries: &[FourierSummary]) -> Option<[f64; 2]> {
    match summaries {
        [zero, one] => Some([zero.mean.low_share?, one.mean.low_share?]),
        _ => None,
    }
}

fn document(asset: &Asset, levels: &Levels, summaries: &[FourierSummary]) -> Value {
    let shares = shares(summaries);
    json!({
        "asset": asset.metadata.name,
        "cka": levels.alike,
        "cka_missing": levels.reason,
        "fourier": summaries,
        "expected": {
            "claim": EXPECTED,
            "low_share": shares,
            "holds": shares.map(|[zero, one]| one > zero),
        },
    })
}

fn print(levels: &Levels, summaries: &[FourierSummary], output: &Path) {
    for similarity in &levels.alike {
        console::print(&similarity.markdown());
        console::print("");
    }
    if !levels.alike.is_empty() {
        console::print("In brackets: what independent noise of that size would have.");
        console::print("");
    }
    if let Some(reason) = &levels.reason {
        console::print(&format!("No CKA: {reason}"));
        console::print("");
    }
    let mut table = console::table(&["Grid", "channel", "variance", "below half of Nyquist"]);
    let share = |share: Option<f64>| {
        share.map_or("none".to_owned(), |share| format!("{:.1}%", 100.0 * share))
    };
    for grid in summaries {
        let name = format!("grid {}, level {}", grid.grid, grid.level);
        let mut row = |channel: String, variance: String, low: Option<f64>| {
            table.add_row([name.clone(), channel, variance, share(low)]);
        };
        let digits = |variance: f64| format!("{variance:.5}");
        for channel in &grid.channels {
            let (summary, channel) = (&channel.summary, channel.channel.to_string());
            row(channel, digits(summary.variance), summary.low_share);
        }
        row(
            "mean".to_owned(),
            digits(grid.mean.variance),
            grid.mean.low_share,
        );
        row(
            "white noise".to_owned(),
            String::new(),
            grid.mean.white_noise_low_share,
        );
    }
    console::print(&table.to_string());
    match shares(summaries) {
        Some([zero, one]) => console::print(&format!(
            "Expected: {EXPECTED}. Here: {:.1}% against {:.1}%, which {}.",
            100.0 * one,
            100.0 * zero,
            if one > zero {
                "agrees"
            } else {
                "does not agree"
            }
        )),
        None => console::print(&format!("Expected: {EXPECTED}. Not compared here.")),
    }
    console::print(&output.display().to_string());
}
