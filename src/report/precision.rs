//! Precision: what fewer latent and weight bits cost in quality, and save in storage.

use super::number::{decimal, psnr};
use super::svg::{Axis, COLOURS, px, round_step};
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

/// The colours that lines use, in order: far apart for every kind of colour vision.
const LINES: [usize; 4] = [0, 3, 4, 1];

fn chart(points: &[SweepPoint]) -> Markup {
    let (latents, weights) = (
        widths(points, |p| p.latent_bits),
        widths(points, |p| p.weight_bits),
    );
    let (Some((low, high)), Some(first), Some(last)) =
        (range(points), latents.first(), latents.last())
    else {
        return html! { p.missing { "No point has a finite PSNR to draw." } };
    };
    let step = round_step(((high - low) / 5.0).max(0.05));
    let bottom = ((low - step * 0.25) / step).floor() * step;
    let top = ((high + step * 0.25) / step).ceil() * step;
    let up = Axis {
        values: (bottom, top),
        pixels: (250.0, 26.0),
    };
    let margin = if first == last { 1.0 } else { 0.15 };
    let bits = (f64::from(*first) - margin, f64::from(*last) + margin);
    let along = Axis {
        values: bits,
        pixels: (52.0, 450.0),
    };
    let line = |weight: u8| -> Vec<(f64, f64)> {
        let mut line: Vec<_> = points
            .iter()
            .filter(|point| point.weight_bits == weight)
            .collect();
        line.sort_by_key(|point| point.latent_bits);
        line.iter()
            .filter(|point| point.psnr.is_finite())
            .map(|point| (along.at(point.latent_bits.into()), up.at(point.psnr)))
            .collect()
    };
    let lines: Vec<_> = weights
        .iter()
        .rev()
        .map(|weight| (*weight, line(*weight)))
        .collect();
    let labels = spread(
        lines
            .iter()
            .filter_map(|(_, line)| line.last().map(|end| end.1))
            .collect(),
    );
    let labelled = lines
        .iter()
        .filter(|(_, line)| !line.is_empty())
        .zip(labels);
    html! {
        svg viewBox="0 0 560 300" role="img" aria-label="PSNR over latent bits, one line per weight width" {
            @for (value, label) in up.ticks(5) {
                @let y = px(up.at(value));
                line.gridline x1="52" x2="450" y1=(y) y2=(y) {}
                text.tick x="46" y=(y) dy="4" text-anchor="end" { (label) }
            }
            @for latent in &latents {
                text.tick x=(px(along.at((*latent).into()))) y="267" text-anchor="middle" { (latent) }
            }
            line.baseline x1="52" x2="450" y1="250" y2="250" {}
            text.axis x="251" y="292" text-anchor="middle" { "latent bits, both grids" }
            text.axis x="4" y="12" { "PSNR, dB" }
            @for (index, ((weight, line), label)) in labelled.enumerate() {
                @let colour = LINES[index % LINES.len()] % COLOURS;
                polyline class={ "line stroke" (colour) } points=(path(line)) {}
                @for (x, y) in line { (marker(index, colour, *x, *y)) }
                @if let Some((x, y)) = line.last() {
                    line.leader x1=(px(x + 6.0)) x2="462" y1=(px(*y)) y2=(px(label - 4.0)) {}
                }
                text.value x="466" y=(px(label)) { (weight) "-bit weights" }
            }
        }
    }
}

fn path(line: &[(f64, f64)]) -> String {
    line.iter()
        .map(|(x, y)| format!("{},{}", px(*x), px(*y)))
        .collect::<Vec<_>>()
        .join(" ")
}

/// A shape per line, so that lines differ without colour.
fn marker(index: usize, colour: usize, x: f64, y: f64) -> Markup {
    let class = format!("fill{colour}");
    let shape = |corners: &[(f64, f64)]| {
        path(
            &corners
                .iter()
                .map(|(dx, dy)| (x + dx, y + dy))
                .collect::<Vec<_>>(),
        )
    };
    html! {
        @match index % 4 {
            0 => { circle class=(class) cx=(px(x)) cy=(px(y)) r="4.5" {} }
            1 => { polygon class=(class) points=(shape(&[(-4.2, -4.2), (4.2, -4.2), (4.2, 4.2), (-4.2, 4.2)])) {} }
            2 => { polygon class=(class) points=(shape(&[(0.0, -5.5), (5.2, 4.2), (-5.2, 4.2)])) {} }
            _ => { polygon class=(class) points=(shape(&[(0.0, -5.8), (5.8, 0.0), (0.0, 5.8), (-5.8, 0.0)])) {} }
        }
    }
}

/// Baselines of labels for lines that end at these heights: at least one text line apart.
fn spread(ends: Vec<f64>) -> Vec<f64> {
    let mut order: Vec<usize> = (0..ends.len()).collect();
    order.sort_by(|a, b| ends[*a].total_cmp(&ends[*b]));
    let mut labels = vec![0.0; ends.len()];
    let mut above = f64::NEG_INFINITY;
    for index in order {
        labels[index] = (ends[index] + 4.0).max(above + 16.0);
        above = labels[index];
    }
    labels
}
