//! Energy: where the energy of a table goes, as bars.

use super::number::decimal;
use super::stacks::{segment, swatches};
use super::svg::{Axis, px, round_step};
use crate::timing::lab::EnergyStudy;
use crate::timing::lab::energy::EnergyBar;
use maud::{Markup, html};

/// Pixels from one bar to the next.
const PITCH: f64 = 38.0;

/// Picojoules in what the axis counts.
const NANO: f64 = 1000.0;

/// What each colour means.
pub(super) fn legend(study: &EnergyStudy) -> Markup {
    let parts: Vec<&str> = study.parts.iter().map(String::as_str).collect();
    html! { ul.legend { (swatches(&parts)) } }
}

fn total(bar: &EnergyBar) -> f64 {
    bar.picojoules_per_block.iter().sum::<f64>() / NANO
}

/// The chart.
pub(super) fn chart(study: &EnergyStudy) -> Markup {
    let longest = study.bars.iter().map(total).filter(|sum| sum.is_finite());
    let longest = longest.fold(f64::MIN_POSITIVE, f64::max);
    let step = round_step(longest / 6.0);
    let along = Axis {
        values: (0.0, (longest / step).ceil() * step),
        pixels: (230.0, 860.0),
    };
    let bottom = 12.0 + PITCH * study.bars.len() as f64;
    html! {
        svg.wide viewBox={ "0 0 960 " (px(bottom + 44.0)) } role="img" aria-label="Energy per texel block by part" {
            @for (value, label) in along.ticks(6) {
                @let x = px(along.at(value));
                line.gridline x1=(x) x2=(x) y1="6" y2=(px(bottom)) {}
                text.tick x=(x) y=(px(bottom + 17.0)) text-anchor="middle" { (label) }
            }
            text.axis x="545" y=(px(bottom + 37.0)) text-anchor="middle" { "nJ of the table per 4×4 block of pixels" }
            @for (index, bar) in study.bars.iter().enumerate() {
                @let top = 14.0 + PITCH * index as f64;
                text.name x="218" y=(px(top + 10.0)) text-anchor="end" { (bar.unit) }
                text.tick x="218" y=(px(top + 24.0)) text-anchor="end" { (bar.way) }
                (segments(study, bar, along, top))
                text.value x=(px(along.at(total(bar)) + 7.0)) y=(px(top + 18.0)) { (decimal(total(bar), 1)) }
            }
        }
    }
}

fn segments(study: &EnergyStudy, bar: &EnergyBar, along: Axis, top: f64) -> Markup {
    let mut edge = 0.0;
    let mut drawn = Vec::new();
    for (part, picojoules) in bar.picojoules_per_block.iter().enumerate() {
        let start = edge;
        edge += picojoules / NANO;
        if *picojoules > 0.0 {
            let (left, right) = (along.at(start), along.at(edge));
            let name = study.parts.get(part).map_or("", String::as_str);
            let title = html! { title { (name) ": " (decimal(picojoules / NANO, 2)) " nJ" } };
            let width = (right - left - 1.0).max(0.5);
            drawn.push(segment(part, left, top, width, 26.0, &title));
        }
    }
    html! { @for segment in drawn { (segment) } }
}
