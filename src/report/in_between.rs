//! Between mips: how good each way to decode between two mips is, and what it takes.

use super::lines::{Lines, Series};
use super::number::{decimal, psnr};
use crate::study::{InBetween, Study};
use maud::{Markup, html};

/// The section; nothing where nothing was measured.
pub(super) fn section(study: &Study) -> Markup {
    let points = &study.in_between;
    html! {
        @if !points.is_empty() {
            section #in_between {
                h2 { "Between mips" }
                p {
                    "PSNR in dB, all channels, at levels of detail on and between the mips, against the source \
                     filtered to that level: the mean of mip 0 over the square that a sample stands for. \
                     \"Source, trilinear\" is what a texture unit gives on the uncompressed chain: no way \
                     can be expected to do better."
                }
                @if let Some(drawing) = chart(points) { figure.chart { (drawing) } }
                (table(points))
            }
        }
    }
}

fn ways(points: &[InBetween]) -> Vec<&'static str> {
    let mut ways = Vec::new();
    for point in points {
        if !ways.contains(&point.way) {
            ways.push(point.way);
        }
    }
    ways
}

fn chart(points: &[InBetween]) -> Option<Markup> {
    let mut lods: Vec<f64> = points.iter().map(|point| point.lod).collect();
    lods.dedup();
    let series = ways(points).into_iter().map(|way| Series {
        label: way.to_owned(),
        points: points
            .iter()
            .filter(|point| point.way == way)
            .map(|point| (point.lod, point.psnr))
            .collect(),
    });
    let chart = Lines {
        title: "PSNR over the level of detail, one line per way to decode",
        along: "level of detail",
        up: "PSNR, dB",
        ticks: lods.into_iter().filter(|lod| lod.fract() == 0.0).collect(),
        series: series.collect(),
    };
    chart.draw()
}

fn table(points: &[InBetween]) -> Markup {
    html! {
        table {
            thead {
                tr {
                    th scope="col" { "way" }
                    th.number scope="col" { "decodes per sample" }
                    th.number scope="col" { "on mips, dB" }
                    th.number scope="col" { "between, dB" }
                }
            }
            tbody {
                @for way in ways(points) {
                    @let own = || points.iter().filter(|point| point.way == way);
                    tr {
                        th scope="row" { (way) }
                        td.number { (decimal(own().map(|p| p.decodes).fold(0.0, f64::max), 0)) }
                        td.number { (psnr(mean(own().filter(|p| p.lod.fract() == 0.0)))) }
                        td.number { (psnr(mean(own().filter(|p| p.lod.fract() != 0.0)))) }
                    }
                }
            }
        }
    }
}

/// The mean of the squared errors of some points, as PSNR.
fn mean<'a>(points: impl Iterator<Item = &'a InBetween>) -> f64 {
    let errors: Vec<f64> = points.map(|p| 10_f64.powf(-p.psnr / 10.0)).collect();
    -10.0 * (errors.iter().sum::<f64>() / errors.len() as f64).log10()
}
