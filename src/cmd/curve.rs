//! `ntmu curve`: rate-distortion curves against each other.

use crate::Verdict;
use crate::{console, files};
use anyhow::Context as _;
use clap::{Args, Subcommand, ValueEnum};
use ntmu::curve::{
    self, Axes, Cell, Curve, CurveError, Delta, Labels, Method, Points, plot_png, plot_svg,
};
use serde_json::json;
use std::path::{Path, PathBuf};

/// The largest file that is read as a curve.
const MAX_CURVE_BYTES: u64 = 64 << 20;

/// Curves are JSON files in CompressAI's form: `name`, `description`, and `results` with a list of
/// numbers for the rate and for each metric.
#[derive(Args)]
pub(crate) struct CurveVerb {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Subcommand)]
enum Verb {
    /// The Bjøntegaard delta of curves over an anchor: rate in percent, metric in its unit.
    Bd(Bd),
    /// The Bjøntegaard deltas of every pair of curves.
    Matrix(MatrixVerb),
    /// Draw curves over a logarithmic rate, with a legend.
    Plot(Plot),
    /// Every point of every curve as a Markdown table.
    Table(Table),
}

#[derive(Args)]
struct Bd {
    /// The curve that the others are compared with.
    #[arg(value_name = "ANCHOR.json")]
    anchor: PathBuf,
    /// The curves that are compared.
    #[arg(value_name = "TEST.json", required = true)]
    tests: Vec<PathBuf>,
    #[command(flatten)]
    how: How,
}

#[derive(Args)]
struct MatrixVerb {
    /// The curves.
    #[arg(value_name = "CURVES.json", required = true)]
    curves: Vec<PathBuf>,
    #[command(flatten)]
    how: How,
}

#[derive(Args)]
struct Plot {
    /// The curves, in the order of the legend.
    #[arg(value_name = "CURVES.json", required = true)]
    curves: Vec<PathBuf>,
    /// The picture, an .svg or .png file.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// What stands above the chart.
    #[arg(long, default_value = "Quality over rate")]
    title: String,
    #[command(flatten)]
    axes: AxesChoice,
}

#[derive(Args)]
struct Table {
    /// The curves.
    #[arg(value_name = "CURVES.json", required = true)]
    curves: Vec<PathBuf>,
}

#[derive(Args)]
struct How {
    /// How curves are drawn through their points.
    #[arg(long, value_enum, default_value = "pchip")]
    method: MethodChoice,
    #[command(flatten)]
    axes: AxesChoice,
}

#[derive(Args)]
struct AxesChoice {
    /// The metric: a key of the curves' results, of which more is better.
    #[arg(long, value_name = "KEY", default_value = "psnr")]
    metric: String,
    /// The rate: a key of the curves' results.
    #[arg(long, value_name = "KEY", default_value = "bpp")]
    rate: String,
}

#[derive(Clone, Copy, ValueEnum)]
enum MethodChoice {
    Pchip,
    Akima,
}

impl MethodChoice {
    fn method(self) -> Method {
        match self {
            MethodChoice::Pchip => Method::Pchip,
            MethodChoice::Akima => Method::Akima,
        }
    }
}

impl AxesChoice {
    fn axes(&self) -> Axes {
        Axes {
            rate: self.rate.clone(),
            metric: self.metric.clone(),
        }
    }

    fn labels(&self, title: &str) -> Labels {
        Labels {
            title: title.to_owned(),
            rate: match self.rate.as_str() {
                "bpp" => "bits per pixel".to_owned(),
                "bppc" => "bits per pixel and channel".to_owned(),
                other => other.to_owned(),
            },
            metric: match self.metric.as_str() {
                "psnr" => "PSNR, dB".to_owned(),
                "ssim" => "SSIM".to_owned(),
                other => other.to_owned(),
            },
        }
    }
}

fn read(path: &Path) -> anyhow::Result<Curve> {
    let found = || path.display().to_string();
    let size = std::fs::metadata(path).with_context(found)?.len();
    anyhow::ensure!(
        size <= MAX_CURVE_BYTES,
        "{}: found {size} bytes; allowed: at most {MAX_CURVE_BYTES}",
        path.display()
    );
    let text = std::fs::read_to_string(path).with_context(found)?;
    Curve::from_json(&text).with_context(found)
}

fn points(path: &Path, axes: &AxesChoice) -> anyhow::Result<Points> {
    let curve = read(path)?;
    curve
        .points(&axes.axes())
        .with_context(|| path.display().to_string())
}

fn all_points(paths: &[PathBuf], axes: &AxesChoice) -> anyhow::Result<Vec<Points>> {
    paths.iter().map(|path| points(path, axes)).collect()
}

impl CurveVerb {
    pub(crate) fn run(self, json: bool) -> anyhow::Result<Verdict> {
        match self.verb {
            Verb::Bd(verb) => verb.run(json),
            Verb::Matrix(verb) => verb.run(json),
            Verb::Plot(verb) => verb.run(json),
            Verb::Table(verb) => verb.run(json),
        }
    }
}

/// A delta; none where the curves have nothing in common, which is a finding and no fault of theirs.
fn found(delta: Result<Delta, CurveError>) -> Result<Cell, CurveError> {
    match delta {
        Ok(delta) => Ok(Cell::Delta(delta)),
        Err(error) if matches!(error, CurveError::NoOverlap { .. }) => Ok(Cell::None {
            reason: error.to_string(),
        }),
        Err(error) => Err(error),
    }
}

impl Bd {
    fn run(self, json: bool) -> anyhow::Result<Verdict> {
        let method = self.how.method.method();
        let anchor = points(&self.anchor, &self.how.axes)?;
        let tests = all_points(&self.tests, &self.how.axes)?;
        let mut rows = Vec::new();
        for test in &tests {
            rows.push((
                test.name(),
                found(curve::bd_rate(&anchor, test, method))?,
                found(curve::bd_psnr(&anchor, test, method))?,
            ));
        }
        let has_all = rows
            .iter()
            .all(|(_, rate, psnr)| rate.value().is_some() && psnr.value().is_some());
        if json {
            let tests = rows.iter().map(
                |(name, rate, psnr)| json!({ "name": name, "bd_rate": rate, "bd_psnr": psnr }),
            );
            console::print_json(&json!({
                "anchor": anchor.name(), "method": method.name(), "rate": self.how.axes.rate,
                "metric": self.how.axes.metric, "tests": tests.collect::<Vec<_>>(),
            }))?;
        } else {
            let against = format!("against {}, {}", anchor.name(), method.name());
            let metric = match self.how.axes.metric.as_str() {
                "psnr" => "BD-PSNR, dB".to_owned(),
                other => format!("BD of {other}"),
            };
            let mut table = console::table(&[&against, "BD-rate", "overlap", &metric, "overlap"]);
            for (name, rate, psnr) in &rows {
                let [rate_value, rate_share] = cells(rate, "%");
                let [psnr_value, psnr_share] = cells(psnr, "");
                table.add_row([name, &*rate_value, &rate_share, &psnr_value, &psnr_share]);
            }
            console::print(&table.to_string());
            for (_, rate, psnr) in &rows {
                for cell in [rate, psnr] {
                    if let Cell::None { reason } = cell {
                        console::note(reason);
                    }
                }
            }
        }
        Ok(if has_all {
            Verdict::Fine
        } else {
            Verdict::Failed
        })
    }
}

fn cells(cell: &Cell, unit: &str) -> [String; 2] {
    match cell {
        Cell::Delta(delta) => [
            format!("{:+.3}{unit}", delta.value),
            format!("{:.0}%", 100.0 * delta.overlap_share),
        ],
        Cell::None { .. } => ["none".to_owned(), "0%".to_owned()],
    }
}

impl MatrixVerb {
    fn run(self, json: bool) -> anyhow::Result<Verdict> {
        let curves = all_points(&self.curves, &self.how.axes)?;
        let matrix = curve::matrix(&curves, self.how.method.method());
        if json {
            console::print_json(&matrix)?;
        } else {
            console::print(&matrix.markdown());
        }
        Ok(Verdict::Fine)
    }
}

impl Plot {
    fn run(self, json: bool) -> anyhow::Result<Verdict> {
        let extension = self.output.extension().and_then(|e| e.to_str());
        let extension = extension.map(str::to_ascii_lowercase);
        let curves = all_points(&self.curves, &self.axes)?;
        let labels = self.axes.labels(&self.title);
        let bytes = match extension.as_deref() {
            Some("svg") => plot_svg(&curves, &labels)?.into_bytes(),
            Some("png") => plot_png(&curves, &labels)?,
            other => anyhow::bail!(
                "{}: found ending {}; allowed: .svg and .png",
                self.output.display(),
                other.map_or("none".to_owned(), |e| format!(".{e}"))
            ),
        };
        files::write(&self.output, &bytes)?;
        let output = self.output.display().to_string();
        if json {
            let names: Vec<&str> = curves.iter().map(Points::name).collect();
            console::print_json(&json!({ "output": output, "curves": names }))?;
        } else {
            console::print(&output);
        }
        Ok(Verdict::Fine)
    }
}

impl Table {
    fn run(self, json: bool) -> anyhow::Result<Verdict> {
        let curves = self.curves.iter().map(|path| read(path));
        let curves = curves.collect::<anyhow::Result<Vec<Curve>>>()?;
        if json {
            let curves = curves
                .iter()
                .map(|c| json!({ "name": c.name(), "results": c.results() }));
            console::print_json(&curves.collect::<Vec<_>>())?;
        } else {
            console::print(&curve::markdown(&curves));
        }
        Ok(Verdict::Fine)
    }
}
