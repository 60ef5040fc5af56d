//! Experiments: what the unit in time was asked, each as a picture.

use super::curves::{Curve, Curves, Up};
use super::number::{bytes, decimal, integer};
use super::roofs::Level;
use super::{ReportError, energy, heat, misses, roofs};
use crate::timing::lab::divergence::DivergenceCurve;
use crate::timing::lab::fifo::{ENOUGH, FifoCurve};
use crate::timing::lab::working_set::KNEE;
use crate::timing::lab::{Divergence, FifoStudy, Lab, WorkingSet};
use maud::{Markup, html};

/// The colours of curves, far apart for every kind of colour vision.
const COLOURS: [usize; 5] = [0, 3, 4, 1, 7];

/// The section.
///
/// # Errors
/// When a picture cannot be written as PNG.
pub(super) fn section(lab: &Lab) -> Result<Markup, ReportError> {
    let misses = misses::pictures(&lab.miss_map)?;
    Ok(html! {
        section #experiments {
            h2 { "Experiments" }
            p {
                "Each varies one thing of the unit or of what it is asked, on a stated scene. The floor \
                 is seen by a camera that looks along it, 10° down; samples are trilinear."
            }
            h3 { "How deep the corner FIFO has to be" }
            (fifo(&lab.fifo))
            h3 { "Layout and cache line" }
            @for grid in &lab.line_size.grids {
                figure.chart {
                    p.note { (grid.scene) }
                    div.scroll { (heat::grid(grid, &lab.line_size.lines)) }
                }
            }
            p.note {
                "Bytes of latents from memory for each pixel, by layout and bytes of a cache line; paler \
                 is less, darkest " (decimal(heat::DARKEST, 0)) " times the least and more, the least in \
                 bold. The latent cache stays at "
                (bytes(lab.line_size.cache_bytes)) ". Pointing at a cell shows its hit rate. "
                (lab.line_size.unit) "."
            }
            h3 { "How large the cache has to be" }
            (working_set(&lab.working_set))
            h3 { "Materials that take turns" }
            (divergence(&lab.divergence))
            h3 { "Roofline" }
            figure.chart {
                (roofs::legend(&lab.roofline))
                div.pair {
                    @for level in [Level::Memory, Level::Cache] {
                        @if let Some(chart) = roofs::chart(&lab.roofline, level) { div.chart { (chart) } }
                    }
                }
                figcaption {
                    "A point on the flat of its roof keeps every multiplier busy; a point on the slope \
                     takes all that memory (left) or the latent cache (right) can deliver; the space \
                     between is lost elsewhere. " (lab.roofline.layout) "; "
                    @for (name, scene) in &lab.roofline.scenes { (name) ": " (scene) "; " }
                    @for (index, roof) in lab.roofline.roofs.iter().take(3).enumerate() {
                        @if index > 0 { ", " } (roof.identity)
                    }
                    "."
                }
            }
            h3 { "Where energy goes" }
            figure.chart {
                (energy::legend(&lab.energy))
                div.scroll { (energy::chart(&lab.energy)) }
                figcaption {
                    "Operations counted, each at its price in the table " (lab.energy.table)
                    ". This ranks designs; it is no estimate of a chip’s power. Decodes for each pixel: "
                    @for (index, bar) in lab.energy.bars.iter().take(3).enumerate() {
                        @if index > 0 { "; " } (bar.way) " " (decimal(bar.decodes_per_pixel, 2))
                    }
                    " (on the first unit). " (lab.energy.scene) "; " (lab.energy.layout) "."
                }
            }
            h3 { "Where lines are missed" }
            (misses)
        }
    })
}

/// Powers of two as marks.
fn marks(values: impl Iterator<Item = f64>, label: impl Fn(f64) -> String) -> Vec<(f64, String)> {
    values.map(|value| (value, label(value))).collect()
}

/// Each chart that can be drawn, under its heading.
fn side_by_side(charts: Vec<(String, Option<Markup>)>, caption: &Markup) -> Markup {
    html! {
        figure.chart {
            div.pair {
                @for (heading, chart) in charts {
                    @if let Some(chart) = chart {
                        div.chart { p.note { b { (heading) } } (chart) }
                    }
                }
            }
            figcaption { (caption) }
        }
    }
}

fn fifo(study: &FifoStudy) -> Markup {
    let same = |a: &FifoCurve, b: &FifoCurve| a.subject == b.subject;
    let chart = |curves: &[FifoCurve]| {
        let curve = |(index, curve): (usize, &FifoCurve)| Curve {
            label: match curve.enough_texels {
                Some(depth) => format!("{} cycles: {depth}", curve.latency_cycles),
                None => format!("{} cycles: never", curve.latency_cycles),
            },
            colour: COLOURS[index % COLOURS.len()],
            is_dashed: false,
            points: study
                .depths
                .iter()
                .zip(&curve.relative)
                .map(|(&depth, &share)| (f64::from(depth), share))
                .collect(),
        };
        let subject = curves.first().map_or("", |curve| &curve.subject);
        let chart = Curves {
            title: format!("Relative performance of {subject} over the depth of the corner FIFO"),
            along: "depth of the corner FIFO, texels",
            up: "performance, 1 = no latency",
            scale: Up::FromZero,
            ticks: marks(study.depths.iter().copied().map(f64::from), |v| {
                decimal(v, 0)
            }),
            reference: Some((ENOUGH, "97 %")),
            curves: curves.iter().enumerate().map(curve).collect(),
        };
        (subject.to_owned(), chart.draw())
    };
    side_by_side(
        study.curves.chunk_by(same).map(chart).collect(),
        &html! {
            "Cycles without memory latency / cycles, by depth, for each latency; behind the colon the \
             smallest depth that reaches 97 %, the share that Igehy, Eldridge and Proudfoot (1998) report \
             for a FIFO that is deep enough. The synthesizer takes so long over a texel that few texels \
             hide a latency; BC7 shows what a decoder of one quad a cycle needs. " (study.scene) "; "
            (study.layout) "; " (study.unit) "."
        },
    )
}

/// A size in bytes for a mark.
fn size(value: f64) -> String {
    if value < 1024.0 {
        "½".to_owned()
    } else {
        decimal(value / 1024.0, 0)
    }
}

fn working_set(study: &WorkingSet) -> Markup {
    let panel = |panel: &crate::timing::lab::working_set::Panel| {
        let curves = panel.curves.iter().enumerate().map(|(index, curve)| Curve {
            label: format!("{}: {}", curve.subject, bytes(curve.knee_bytes))
                .replace(".0 KiB", " KiB"),
            colour: COLOURS[index / 2],
            is_dashed: index % 2 == 0,
            points: study
                .cache_bytes
                .iter()
                .zip(&curve.bytes_per_pixel)
                .map(|(&bytes, &value)| (bytes as f64, value))
                .collect(),
        });
        let order = panel
            .scene
            .split("order=")
            .nth(1)
            .and_then(|rest| rest.split(',').next());
        let chart = Curves {
            title: format!(
                "Bytes from memory per pixel over the size of the cache, {}",
                panel.scene
            ),
            along: "latent cache, KiB",
            up: "bytes from memory per pixel",
            scale: Up::Logarithmic,
            ticks: marks(study.cache_bytes.iter().map(|&bytes| bytes as f64), size),
            reference: None,
            curves: curves.collect(),
        };
        (
            format!("Pixels in the order {}", order.unwrap_or("given")),
            chart.draw(),
        )
    };
    side_by_side(
        study.panels.iter().map(panel).collect(),
        &html! {
            "Lines of " (study.line_bytes) " bytes, fully associative up to 256 ways. The RGBA8 texture \
             is one map of four channels, the latents stand for the whole set. Behind the colon: the \
             smallest cache with at most " (decimal(KNEE, 2)) " times the bytes of the largest. "
            "Hakura and Gupta (1997) find 16 KiB or less for blocked textures and tiled rasterisation. "
            @for panel in &study.panels { (panel.scene) "; " }
            (study.unit) "."
        },
    )
}

fn divergence(study: &Divergence) -> Markup {
    let same =
        |a: &DivergenceCurve, b: &DivergenceCurve| a.weight_sram_bytes == b.weight_sram_bytes;
    let chart = |curves: &[DivergenceCurve]| {
        let most = curves.iter().map(|curve| curve.bins).max();
        let mut interleaves: Vec<&str> = Vec::new();
        let mut drawn = Vec::new();
        for curve in curves {
            let index = interleaves
                .iter()
                .position(|name| *name == curve.interleave);
            let index = index.unwrap_or_else(|| {
                interleaves.push(&curve.interleave);
                interleaves.len() - 1
            });
            let points = study.materials.iter().zip(&curve.points);
            drawn.push(Curve {
                label: format!("{}, {} bins", curve.interleave, curve.bins)
                    .replace(" 1 bins", " 1 bin"),
                colour: COLOURS[index % COLOURS.len()],
                is_dashed: Some(curve.bins) != most,
                points: points
                    .map(|(&count, point)| (count as f64, point.cycles_per_block))
                    .collect(),
            });
        }
        let sram = curves.first().map_or(0, |curve| curve.weight_sram_bytes);
        let chart = Curves {
            title: format!(
                "Cycles per block over the number of materials, weight SRAM of {sram} bytes"
            ),
            along: "materials",
            up: "cycles per 4×4 block",
            scale: Up::FromZero,
            ticks: marks(study.materials.iter().map(|&count| count as f64), |v| {
                decimal(v, 0)
            }),
            reference: None,
            curves: drawn,
        };
        (format!("Weight SRAM of {}", bytes(sram)), chart.draw())
    };
    let worst = study.curves.iter().filter_map(|curve| {
        let last = curve.points.last()?;
        Some((curve, last))
    });
    let worst = worst.max_by(|a, b| a.1.cycles_per_block.total_cmp(&b.1.cycles_per_block));
    side_by_side(
        study.curves.chunk_by(same).map(chart).collect(),
        &html! {
            "Copies of the asset as materials, " (integer(study.parameter_bytes))
            " B of parameters each, in turn over the screen quad by quad, or in tiles of 4×4 or 16×16 \
             pixels. Dashed: one job gathered at a time, which closes when the material changes. "
            @if let Some((curve, point)) = worst {
                "The worst, " (curve.interleave) " with " (curve.bins) " bin" @if curve.bins > 1 { "s" }
                " and " (bytes(curve.weight_sram_bytes)) ": " (integer(point.weight_fills))
                " weight fills, " (decimal(point.weight_bytes_per_block, 0)) " B of parameters per block, "
                (decimal(point.texels_per_job, 1)) " texels a job. "
            }
            (study.scene) "; " (study.layout) "; " (study.unit) "."
        },
    )
}
