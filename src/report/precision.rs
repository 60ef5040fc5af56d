//! Precision: what fewer latent and weight bits cost in quality, and save in storage.

use super::lines::{Lines, Series};
use super::number::{decimal, psnr};
use crate::study::{Study, SweepPoint};
use maud::{Markup, html};

/// The section, or why it is empty.
pub(super) fn section(study: &Study) -> Markup {
    let points = &study.sweep;
    html! {
        section #precision {
            h2 { "Precision" }
            @if points.is_empty() {
                p.missing {
                    @if study.quality.is_none() { "No source was given: nothing to sweep against." }
                    @else { "No sweep was run." }
                }
            } @else {
                p {
                    "The same asset with latents and weights rounded to fewer bits, not trained again: \
                     training at the target width loses less. PSNR in dB over all maps and mips against \
                     the source; BPPC (bits per pixel and channel) counts grids and parameters."
                }
                div.pair {
                    figure.chart {
                        (chart(points))
                        figcaption { "PSNR over latent bits, one line per weight width." }
                    }
                    (table(points))
                }
            }
        }
    }
}

fn widths(points: &[SweepPoint], width: impl Fn(&SweepPoint) -> u8) -> Vec<u8> {
    let mut widths: Vec<u8> = points.iter().map(width).collect();
    widths.sort_unstable();
    widths.dedup();
    widths
}

/// The lowest and highest finite PSNR.
fn range(points: &[SweepPoint]) -> Option<(f64, f64)> {
    let finite = || {
        points
            .iter()
            .map(|point| point.psnr)
            .filter(|psnr| psnr.is_finite())
    };
    finite().next()?;
    Some((
        finite().fold(f64::INFINITY, f64::min),
        finite().fold(f64::NEG_INFINITY, f64::max),
    ))
}

/// No other point is at least as good in both PSNR and BPPC, and better in one.
fn is_on_front(point: &SweepPoint, points: &[SweepPoint]) -> bool {
    !points.iter().any(|other| {
        other.psnr >= point.psnr
            && other.bppc <= point.bppc
            && (other.psnr > point.psnr || other.bppc < point.bppc)
    })
}

fn table(points: &[SweepPoint]) -> Markup {
    let (latents, weights) = (
        widths(points, |p| p.latent_bits),
        widths(points, |p| p.weight_bits),
    );
    let (low, high) = range(points).unwrap_or((0.0, 0.0));
    let heat = |psnr: f64| {
        let share = if high > low {
            ((psnr - low) / (high - low)).clamp(0.0, 1.0)
        } else {
            1.0
        };
        format!(
            "--heat:{}",
            if share.is_nan() {
                "0.00".to_owned()
            } else {
                format!("{share:.2}")
            }
        )
    };
    let at = |latent: u8, weight: u8| {
        points
            .iter()
            .find(|point| point.latent_bits == latent && point.weight_bits == weight)
    };
    html! {
        div {
            table.heat {
                thead {
                    tr {
                        th scope="col" { "latent bits" }
                        @for weight in &weights { th.number scope="col" { (weight) "-bit weights" } }
                    }
                }
                tbody {
                    @for latent in latents.iter().rev() {
                        tr {
                            th scope="row" { (latent) }
                            @for weight in &weights {
                                @match at(*latent, *weight) {
                                    Some(point) => {
                                        td.number style=(heat(point.psnr)) {
                                            @if is_on_front(point, points) { span.front { "◆ " } }
                                            (psnr(point.psnr)) " dB"
                                            small { (decimal(point.bppc, 3)) " BPPC" }
                                        }
                                    }
                                    None => { td.number { "—" } }
                                }
                            }
                        }
                    }
                }
            }
            p.note {
                "◆ Pareto front: no other point has a higher PSNR for as few bits. A deeper shade is a \
                 higher PSNR."
            }
        }
    }
}

fn chart(points: &[SweepPoint]) -> Markup {
    let latents = widths(points, |p| p.latent_bits);
    let mut weights = widths(points, |p| p.weight_bits);
    weights.reverse();
    let series = weights.iter().map(|&weight| {
        let mut line: Vec<_> = points.iter().filter(|p| p.weight_bits == weight).collect();
        line.sort_by_key(|point| point.latent_bits);
        Series {
            label: format!("{weight}-bit weights"),
            points: line
                .iter()
                .map(|p| (f64::from(p.latent_bits), p.psnr))
                .collect(),
        }
    });
    let chart = Lines {
        title: "PSNR over latent bits, one line per weight width",
        along: "latent bits, both grids",
        up: "PSNR, dB",
        ticks: latents.iter().map(|&bits| f64::from(bits)).collect(),
        series: series.collect(),
    };
    match chart.draw() {
        Some(drawing) => drawing,
        None => html! { p.missing { "No point has a finite PSNR to draw." } },
    }
}
