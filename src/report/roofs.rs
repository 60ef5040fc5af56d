//! Roofs: multiplications per cycle over multiplications per byte, on logarithmic axes.

use super::curves::{line_class, logarithmic_ticks};
use super::lines::marker;
use super::number::{decimal, significant};
use super::svg::{Axis, px};
use crate::timing::lab::Roofline;
use crate::timing::lab::roofline::{Point, Roof};
use maud::{Markup, html};

/// Which bytes.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Level {
    /// From memory.
    Memory,
    /// From the latent cache.
    Cache,
}

impl Level {
    const fn bandwidth(self, roof: &Roof) -> f64 {
        match self {
            Level::Memory => roof.memory_bytes_per_cycle,
            Level::Cache => roof.cache_bytes_per_cycle,
        }
    }

    const fn intensity(self, point: &Point) -> f64 {
        match self {
            Level::Memory => point.macs_per_memory_byte,
            Level::Cache => point.macs_per_cache_byte,
        }
    }

    const fn along(self) -> &'static str {
        match self {
            Level::Memory => "MACs per byte of latents from memory",
            Level::Cache => "MACs per byte from the latent cache",
        }
    }
}

/// The colours of units.
const UNITS: [usize; 5] = [0, 3, 4, 1, 6];

/// Different texts, in the order in which they come.
fn distinct<'a>(texts: impl Iterator<Item = &'a String>) -> Vec<&'a String> {
    let mut found = Vec::new();
    for text in texts {
        if !found.contains(&text) {
            found.push(text);
        }
    }
    found
}

fn colour(roofline: &Roofline, unit: &str) -> usize {
    let units = distinct(roofline.roofs.iter().map(|roof| &roof.unit));
    let index = units.iter().position(|name| *name == unit);
    UNITS[index.unwrap_or(0) % UNITS.len()]
}

/// Whether these are the asset's own numbers: those of the first roof.
fn is_own(roofline: &Roofline, numbers: &str) -> bool {
    roofline
        .roofs
        .first()
        .is_some_and(|roof| roof.numbers == numbers)
}

/// What colours, shapes and dashes mean.
pub(super) fn legend(roofline: &Roofline) -> Markup {
    let swatch = |mark: Markup| {
        html! { svg.swatch viewBox="0 0 14 14" width="14" height="14" aria-hidden="true" { (mark) } }
    };
    html! {
        ul.legend {
            @for unit in distinct(roofline.roofs.iter().map(|roof| &roof.unit)) {
                @let class = line_class(colour(roofline, unit), false);
                li { (swatch(html! { line class=(class) x1="0" x2="14" y1="7" y2="7" {} })) (unit) }
            }
            @for (index, (scene, _)) in roofline.scenes.iter().enumerate() {
                li { (swatch(marker(index, 7, 7.0, 7.0))) (scene) }
            }
            @for (index, numbers) in distinct(roofline.roofs.iter().map(|roof| &roof.numbers)).iter().enumerate() {
                @let is_dashed = index > 0;
                li {
                    (swatch(html! {
                        line class=(line_class(7, is_dashed)) x1="0" x2="14" y1="7" y2="7" {}
                    }))
                    (numbers) @if is_dashed { " (paler points)" }
                }
            }
        }
    }
}

/// Left, right, top and bottom of the drawing, in pixels.
const BOX: (f64, f64, f64, f64) = (60.0, 560.0, 26.0, 320.0);

/// The chart, unless no point is finite.
pub(super) fn chart(roofline: &Roofline, level: Level) -> Option<Markup> {
    let (left, right, top, bottom) = BOX;
    let reals = |value: &f64| value.is_finite() && *value > 0.0;
    let ridges = roofline
        .roofs
        .iter()
        .map(|r| r.macs_per_cycle / level.bandwidth(r));
    let xs = roofline
        .points
        .iter()
        .map(|p| level.intensity(p))
        .chain(ridges);
    let xs: Vec<f64> = xs.filter(reals).map(f64::log10).collect();
    let peaks = roofline.roofs.iter().map(|roof| roof.macs_per_cycle);
    let ys = roofline
        .points
        .iter()
        .map(|p| p.macs_per_cycle)
        .chain(peaks);
    let ys: Vec<f64> = ys.filter(reals).map(f64::log10).collect();
    let ends = |values: &[f64]| {
        let low = values.iter().copied().reduce(f64::min)?;
        let high = values.iter().copied().reduce(f64::max)?;
        Some((low - 0.3, high + 0.2))
    };
    let along = Axis {
        values: ends(&xs)?,
        pixels: (left, right),
    };
    let up = Axis {
        values: ends(&ys)?,
        pixels: (bottom, top),
    };
    Some(html! {
        svg viewBox="0 0 640 372" role="img" aria-label="Roofline" {
            @for (value, label) in logarithmic_ticks(up.values.0, up.values.1) {
                @let y = px(up.at(value));
                line.gridline x1=(px(left)) x2=(px(right)) y1=(y) y2=(y) {}
                text.tick x=(px(left - 6.0)) y=(y) dy="4" text-anchor="end" { (label) }
            }
            @for (value, label) in logarithmic_ticks(along.values.0, along.values.1) {
                @let x = px(along.at(value));
                line.gridline x1=(x) x2=(x) y1=(px(top)) y2=(px(bottom)) {}
                text.tick x=(x) y=(px(bottom + 17.0)) text-anchor="middle" { (label) }
            }
            line.baseline x1=(px(left)) x2=(px(right)) y1=(px(bottom)) y2=(px(bottom)) {}
            text.axis x=(px((left + right) / 2.0)) y="362" text-anchor="middle" { (level.along()) }
            text.axis x="4" y="12" { "MACs per cycle" }
            @for roof in &roofline.roofs { (roof_line(roofline, roof, level, along, up)) }
            @for point in &roofline.points { (point_mark(roofline, point, level, along, up)) }
        }
    })
}

/// From the left edge or the bottom up the slope, then flat.
fn roof_line(roofline: &Roofline, roof: &Roof, level: Level, along: Axis, up: Axis) -> Markup {
    let bandwidth = level.bandwidth(roof).log10();
    let peak = roof.macs_per_cycle.log10();
    let start = along.values.0.max(up.values.0 - bandwidth);
    let ridge = (peak - bandwidth).max(start);
    let at = |x: f64, y: f64| format!("{},{}", px(along.at(x)), px(up.at(y)));
    let corners = [
        at(start, (start + bandwidth).min(peak)),
        at(ridge, peak),
        at(along.values.1, peak),
    ];
    let own = is_own(roofline, &roof.numbers);
    let class = line_class(colour(roofline, &roof.unit), !own);
    html! {
        polyline class=(class) points=(corners.join(" ")) {
            title {
                (roof.unit) ", " (roof.numbers) ": " (significant(roof.macs_per_cycle)) " MACs per cycle, "
                (significant(level.bandwidth(roof))) " bytes per cycle"
            }
        }
        @if own {
            text.value x=(px(along.at(along.values.1) + 6.0)) y=(px(up.at(peak) + 4.0)) {
                (decimal(roof.macs_per_cycle, 0))
            }
        }
    }
}

fn point_mark(roofline: &Roofline, point: &Point, level: Level, along: Axis, up: Axis) -> Markup {
    let (x, y) = (level.intensity(point).log10(), point.macs_per_cycle.log10());
    let scene = roofline
        .scenes
        .iter()
        .position(|(name, _)| *name == point.scene);
    let own = is_own(roofline, &point.numbers);
    html! {
        @if let (Some(scene), true) = (scene, x.is_finite() && y.is_finite()) {
            g.pale[!own] {
                title {
                    (point.unit) ", " (point.numbers) ", " (point.scene) ": "
                    (significant(point.macs_per_cycle)) " MACs per cycle, "
                    (significant(level.intensity(point))) " per byte"
                }
                (marker(scene, colour(roofline, &point.unit), along.at(x), up.at(y)))
            }
        }
    }
}
