//! Summary: what the finished points say together.

use super::curves::{self, CurvePoint, Measure};
use super::machine::Machine;
use super::result::{PointResult, write, write_json};
use super::{EvaluateError, Evaluation, table};
use crate::curve::{Curve, Matrix};
use serde::Serialize;
use serde_json::json;
use std::collections::BTreeSet;

/// What the finished points say together.
#[derive(Clone, Debug, Serialize)]
pub struct Summary {
    /// The plan's name.
    pub plan: String,
    /// The seed of neural codecs.
    pub seed: u64,
    /// When this was put together, in UTC.
    pub made: String,
    /// The machines that made points.
    pub machines: Vec<Machine>,
    /// The encoders, with versions.
    pub encoders: Vec<String>,
    /// Labels of points that are not finished.
    pub missing: Vec<String>,
    /// Per set.
    pub sets: Vec<SetSummary>,
    /// Over the sets; none unless every set has every point.
    pub mean: Option<Mean>,
}

/// One set's results.
#[derive(Clone, Debug, Serialize)]
pub struct SetSummary {
    /// Its name.
    pub set: String,
    /// The finished points with their curve's name, in the plan's order.
    pub rows: Vec<Row>,
    /// BD-rate and BD-PSNR of every curve of more than one point against every other such curve,
    /// where there are two.
    pub bd: Option<Matrix>,
    #[serde(skip)]
    curves: Vec<Curve>,
}

/// A point in the table.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// The curve.
    pub curve: String,
    /// Where every curve of the plan has one point: how this one differs from the first, none while
    /// that is not finished.
    pub change: Option<Change>,
    /// All else, without the figures of every mip.
    #[serde(flatten)]
    pub result: PointResult,
}

/// How a point differs from another.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Change {
    /// In percent of the other's rate.
    pub rate: f64,
    /// In dB.
    pub psnr: f64,
}

/// The sets together, each with the same weight.
#[derive(Clone, Debug, Serialize)]
pub struct Mean {
    /// Per curve, per rate: the arithmetic mean of rates, decibels and SSIM.
    pub curves: Vec<MeanCurve>,
    /// The mean of the sets' BD-rates in percent, \[anchor\]\[test\], with how many sets have one.
    pub bd_rate: Vec<Vec<MeanDelta>>,
    /// The same of BD-PSNR, in dB.
    pub bd_psnr: Vec<Vec<MeanDelta>>,
    #[serde(skip)]
    plotted: Vec<Curve>,
}

/// A curve over all sets.
#[derive(Clone, Debug, Serialize)]
pub struct MeanCurve {
    /// Its name.
    pub curve: String,
    /// The mean of the sets' changes.
    pub change: Option<Change>,
    /// Its points.
    pub points: Vec<CurvePoint>,
}

/// The mean of the sets' deltas.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct MeanDelta {
    /// None where no set has one.
    pub value: Option<f64>,
    /// How many sets have one.
    pub sets: usize,
}

/// Puts the finished points together.
///
/// # Errors
/// When a result is damaged.
pub fn summarise(evaluation: &Evaluation) -> Result<Summary, EvaluateError> {
    let mut summary = Summary {
        plan: evaluation.plan.name.clone(),
        seed: evaluation.plan.seed,
        made: super::machine::now(),
        machines: Vec::new(),
        encoders: Vec::new(),
        missing: Vec::new(),
        sets: Vec::new(),
        mean: None,
    };
    let mut encoders = BTreeSet::new();
    for (index, set) in evaluation.sets.iter().enumerate() {
        let mut rows = Vec::new();
        for point in evaluation.points.iter().filter(|point| point.set == index) {
            let Some(mut result) = evaluation.result(point)? else {
                summary.missing.push(point.label.clone());
                continue;
            };
            if !summary.machines.contains(&result.machine) {
                summary.machines.push(result.machine.clone());
            }
            encoders.insert(result.encoder.clone());
            result.quality = serde_json::Value::Null;
            result.details = serde_json::Value::Null;
            let curve = evaluation.plan.curves[point.curve].name.clone();
            rows.push(Row {
                curve,
                change: None,
                result,
            });
        }
        set_changes(evaluation, &mut rows);
        let curves = set_curves(evaluation, &set.name, &rows)?;
        let planned = evaluation.plan.curves.iter();
        let several: Vec<Curve> = planned
            .filter(|planned| planned.codecs.len() > 1)
            .filter_map(|planned| curves.iter().find(|curve| curve.name() == planned.name))
            .cloned()
            .collect();
        summary.sets.push(SetSummary {
            set: set.name.clone(),
            bd: (several.len() > 1)
                .then(|| curves::matrix(&several))
                .transpose()?,
            rows,
            curves,
        });
    }
    summary.encoders = encoders.into_iter().collect();
    if summary.missing.is_empty() && summary.sets.len() > 1 {
        summary.mean = Some(mean(evaluation, &summary.sets)?);
    }
    Ok(summary)
}

/// Compares every row with the first point of the plan, where no curve has a second.
fn set_changes(evaluation: &Evaluation, rows: &mut [Row]) {
    let planned = &evaluation.plan.curves;
    if planned.len() < 2 || planned.iter().any(|curve| curve.codecs.len() > 1) {
        return;
    }
    let of = |row: &Row| Some((row.result.bppc, row.result.psnr?));
    let first = rows.first().filter(|row| row.curve == planned[0].name);
    let Some((rate, psnr)) = first.and_then(of) else {
        return;
    };
    for row in rows {
        row.change = of(row).map(|found| Change {
            rate: 100.0 * (found.0 / rate - 1.0),
            psnr: found.1 - psnr,
        });
    }
}

/// The points of a curve; those that equal their source have no PSNR and cannot be drawn.
fn points_of(rows: &[Row], curve: &str) -> Vec<CurvePoint> {
    let rows = rows.iter().filter(|row| row.curve == curve);
    rows.filter_map(|Row { result, .. }| {
        Some(CurvePoint {
            label: result.label.clone(),
            bppc: result.bppc,
            bpp: result.bppc * result.set.channels as f64,
            psnr: result.psnr?,
            ssim: result.ssim,
            encode_seconds: result.encode_seconds,
            decode_seconds: result.decode_seconds,
        })
    })
    .collect()
}

fn set_curves(
    evaluation: &Evaluation,
    set: &str,
    rows: &[Row],
) -> Result<Vec<Curve>, EvaluateError> {
    let mut made = Vec::new();
    for planned in &evaluation.plan.curves {
        let points = points_of(rows, &planned.name);
        if points.is_empty() {
            continue;
        }
        let mine = rows.iter().filter(|row| row.curve == planned.name);
        let machines: Vec<_> = mine
            .map(|row| {
                json!({
                    "point": row.result.label, "machine": row.result.machine,
                    "finished": row.result.finished, "encoder": row.result.encoder,
                })
            })
            .collect();
        let meta = json!({
            "set": set, "seed": evaluation.plan.seed, "ntmu": env!("CARGO_PKG_VERSION"),
            "points": machines,
        });
        let description = format!(
            "{} on {set}; bppc counts all that is stored, of all mips, over the texels of mip 0 and \
             the channels; psnr and ssim are over all mips and channels",
            planned.name
        );
        made.push(curves::curve(&planned.name, description, &points, meta)?);
    }
    Ok(made)
}

fn mean(evaluation: &Evaluation, sets: &[SetSummary]) -> Result<Mean, EvaluateError> {
    let mut means = Vec::new();
    let mut plotted = Vec::new();
    for planned in &evaluation.plan.curves {
        let per_set: Vec<Vec<CurvePoint>> = sets
            .iter()
            .map(|set| points_of(&set.rows, &planned.name))
            .collect();
        let whole = planned.codecs.len();
        if per_set.iter().any(|points| points.len() != whole) {
            continue;
        }
        let points: Vec<CurvePoint> = (0..whole)
            .map(|rate| {
                let of = |part: fn(&CurvePoint) -> f64| {
                    per_set
                        .iter()
                        .map(|points| part(&points[rate]))
                        .sum::<f64>()
                        / per_set.len() as f64
                };
                CurvePoint {
                    label: per_set[0][rate].label.clone(),
                    bppc: of(|p| p.bppc),
                    bpp: of(|p| p.bpp),
                    psnr: of(|p| p.psnr),
                    ssim: of(|p| p.ssim),
                    encode_seconds: of(|p| p.encode_seconds),
                    decode_seconds: of(|p| p.decode_seconds),
                }
            })
            .collect();
        let description = format!("{}, the mean of {} sets", planned.name, sets.len());
        plotted.push(curves::curve(
            &planned.name,
            description,
            &points,
            json!({}),
        )?);
        means.push(MeanCurve {
            curve: planned.name.clone(),
            change: mean_change(sets, &planned.name),
            points,
        });
    }
    let names: Vec<&str> = means.iter().map(|mean| mean.curve.as_str()).collect();
    let of_set =
        |matrix: &Matrix, part: fn(&Matrix) -> &Vec<Vec<crate::curve::Cell>>, a: &str, t: &str| {
            let at = |name: &str| matrix.names.iter().position(|found| found == name);
            curves::number(&part(matrix)[at(a)?][at(t)?])
        };
    let deltas = |part: fn(&Matrix) -> &Vec<Vec<crate::curve::Cell>>| -> Vec<Vec<MeanDelta>> {
        let row = |anchor: &&str| {
            let cell = |test: &&str| {
                let found: Vec<f64> = sets
                    .iter()
                    .filter_map(|set| of_set(set.bd.as_ref()?, part, anchor, test))
                    .collect();
                let count = found.len();
                let sum: f64 = found.iter().sum();
                MeanDelta {
                    value: (count > 0).then(|| sum / count as f64),
                    sets: count,
                }
            };
            names.iter().map(cell).collect()
        };
        names.iter().map(row).collect()
    };
    Ok(Mean {
        bd_rate: deltas(|matrix| &matrix.rates),
        bd_psnr: deltas(|matrix| &matrix.psnrs),
        curves: means,
        plotted,
    })
}

/// The mean of a curve's changes, where every set has one.
fn mean_change(sets: &[SetSummary], curve: &str) -> Option<Change> {
    let changes = sets.iter().map(|set| {
        let row = set.rows.iter().find(|row| row.curve == curve);
        row.and_then(|row| row.change)
    });
    let changes = changes.collect::<Option<Vec<Change>>>()?;
    let mean =
        |part: fn(&Change) -> f64| changes.iter().map(part).sum::<f64>() / changes.len() as f64;
    Some(Change {
        rate: mean(|change| change.rate),
        psnr: mean(|change| change.psnr),
    })
}

impl Summary {
    /// The summary as Markdown: machines, tables, matrices, with the plots that [`Summary::write`]
    /// puts beside it.
    #[must_use]
    pub fn markdown(&self) -> String {
        table::markdown(self)
    }

    /// Writes `results.md`, `results.json`, a curve for each set and codec under `curves`, and plots
    /// under `plots`.
    ///
    /// # Errors
    /// When the folder cannot be written, or a curve cannot be drawn.
    pub fn write(&self, evaluation: &Evaluation) -> Result<(), EvaluateError> {
        let folder = evaluation.folder();
        for name in ["curves", "plots"] {
            let folder = folder.join(name);
            std::fs::create_dir_all(&folder).map_err(EvaluateError::io(&folder))?;
        }
        let mean = self
            .mean
            .as_ref()
            .map(|mean| ("mean", mean.plotted.as_slice()));
        let sets = self
            .sets
            .iter()
            .map(|set| (set.set.as_str(), set.curves.as_slice()));
        for (name, curves) in sets.chain(mean).filter(|(_, curves)| !curves.is_empty()) {
            for curve in curves {
                let file = format!("{name}.{}.json", super::plain(curve.name()));
                write(
                    &folder.join("curves").join(file),
                    curve.to_json().as_bytes(),
                )?;
            }
            for measure in Measure::ALL {
                let file = format!("{name}.{}.svg", measure.name());
                let svg = curves::plot(name, curves, measure)?;
                write(&folder.join("plots").join(file), svg.as_bytes())?;
            }
        }
        write_json(&folder.join("results.json"), self)?;
        write(&folder.join("results.md"), self.markdown().as_bytes())
    }
}
