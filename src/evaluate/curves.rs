//! Curves: the points of a codec on a set, as [`crate::curve`] takes them. The one place that knows
//! that module's types.

use super::EvaluateError;
use crate::curve::{self, Axes, Cell, Curve, CurveError, Labels, Matrix, Method, Points};
use serde::Serialize;
use serde_json::Value;
use std::collections::BTreeMap;

/// A point of a curve.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CurvePoint {
    /// Its name: `astc-8x8`.
    pub label: String,
    /// Bits per pixel and channel.
    pub bppc: f64,
    /// Bits per pixel, all channels.
    pub bpp: f64,
    /// In dB.
    pub psnr: f64,
    /// 0 to 1.
    pub ssim: f64,
    /// Seconds of encoding.
    pub encode_seconds: f64,
    /// Seconds of decoding.
    pub decode_seconds: f64,
}

/// The measures that are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Measure {
    /// PSNR over all mips and channels.
    Psnr,
    /// SSIM over the same.
    Ssim,
}

impl Measure {
    pub(super) const ALL: [Measure; 2] = [Measure::Psnr, Measure::Ssim];

    /// As in file names and in the curves' JSON.
    pub(super) fn name(self) -> &'static str {
        match self {
            Measure::Psnr => "psnr",
            Measure::Ssim => "ssim",
        }
    }
}

/// A curve in CompressAI's form.
pub(super) fn curve(
    name: &str,
    description: String,
    points: &[CurvePoint],
    meta: Value,
) -> Result<Curve, EvaluateError> {
    type Part = fn(&CurvePoint) -> f64;
    let parts: [(&str, Part); 6] = [
        ("bppc", |point| point.bppc),
        ("bpp", |point| point.bpp),
        ("psnr", |point| point.psnr),
        ("ssim", |point| point.ssim),
        ("encoding_time", |point| point.encode_seconds),
        ("decoding_time", |point| point.decode_seconds),
    ];
    let results: BTreeMap<String, Vec<f64>> = parts
        .into_iter()
        .map(|(key, part)| (key.to_owned(), points.iter().map(part).collect()))
        .collect();
    let curve = Curve::new(name, description, results).map_err(|error| fault(name, &error))?;
    Ok(curve.with_meta(meta))
}

/// Rate and a measure of curves.
fn points(curves: &[Curve], measure: Measure) -> Result<Vec<Points>, EvaluateError> {
    let axes = Axes {
        rate: "bppc".to_owned(),
        metric: measure.name().to_owned(),
    };
    let points = curves.iter().map(|curve| {
        let points = curve.points(&axes);
        points.map_err(|error| fault(curve.name(), &error))
    });
    points.collect()
}

/// The chart of curves, as SVG.
pub(super) fn plot(
    title: &str,
    curves: &[Curve],
    measure: Measure,
) -> Result<String, EvaluateError> {
    let labels = Labels {
        title: title.to_owned(),
        rate: "bits per pixel and channel".to_owned(),
        metric: match measure {
            Measure::Psnr => "PSNR, dB".to_owned(),
            Measure::Ssim => "SSIM".to_owned(),
        },
    };
    curve::plot_svg(&points(curves, measure)?, &labels).map_err(|error| fault(title, &error))
}

/// BD-rate and BD-PSNR of every curve against every other, by PCHIP as in JVET-T2010.
pub(super) fn matrix(curves: &[Curve]) -> Result<Matrix, EvaluateError> {
    let points = points(curves, Measure::Psnr)?;
    Ok(curve::matrix(&points, Method::Pchip))
}

/// The number in a cell.
pub(super) fn number(cell: &Cell) -> Option<f64> {
    match cell {
        Cell::Delta(delta) => Some(delta.value),
        Cell::None { .. } => None,
    }
}

fn fault(name: &str, error: &CurveError) -> EvaluateError {
    EvaluateError::Curve {
        name: name.to_owned(),
        found: error.to_string(),
    }
}
