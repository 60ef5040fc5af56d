//! Stacks: the cycles of a texel block, cause upon cause, as bars.

use super::ReportError;
use super::number::{decimal, percent};
use super::svg::{Axis, COLOURS, fill, px, round_step, shortened};
use crate::study::TimingRow;
use maud::{Markup, html};

/// Pixels from one bar to the next.
const PITCH: f64 = 37.0;

/// A row with its cycles per texel block by cause, in the order of all causes.
pub(super) struct Stack<'a> {
    /// The row.
    pub(super) row: &'a TimingRow,
    /// Cycles per texel block; the sum is the row's `cycles_per_block`.
    pub(super) segments: Vec<f64>,
}

/// Every cause that took cycles in any ledger, in the order of first appearance.
pub(super) fn causes(rows: &[TimingRow]) -> Vec<&str> {
    let mut causes: Vec<&str> = Vec::new();
    for charge in rows.iter().flat_map(|row| &row.ledger) {
        if charge.cycles > 0 && !causes.contains(&charge.cause.as_str()) {
            causes.push(&charge.cause);
        }
    }
    causes
}

/// Divides a row's cycles per texel block among the causes, as its ledger does.
///
/// # Errors
/// When the ledger does not charge every cycle exactly once.
pub(super) fn stack<'a>(row: &'a TimingRow, causes: &[&str]) -> Result<Stack<'a>, ReportError> {
    let charged: u128 = row
        .ledger
        .iter()
        .map(|charge| u128::from(charge.cycles))
        .sum();
    if charged != u128::from(row.cycles) {
        return Err(ReportError::Ledger {
            unit: row.unit.clone(),
            layout: row.layout.clone(),
            found: charged,
            allowed: row.cycles,
        });
    }
    let segments = causes
        .iter()
        .map(|cause| {
            let charges = row.ledger.iter().filter(|charge| charge.cause == **cause);
            let cycles: u64 = charges.map(|charge| charge.cycles).sum();
            cycles as f64 / row.cycles.max(1) as f64 * row.cycles_per_block
        })
        .collect();
    Ok(Stack { row, segments })
}

/// Causes beyond the colours are hatched.
fn is_hatched(cause: usize) -> bool {
    cause >= COLOURS
}

/// What each colour means.
pub(super) fn legend(causes: &[&str]) -> Markup {
    html! {
        ul.legend {
            (swatches(causes))
            li {
                svg.swatch viewBox="0 0 14 14" width="14" height="14" aria-hidden="true" {
                    line.bound x1="7" x2="7" y1="0" y2="14" {}
                }
                "closed-form lower bound"
            }
        }
    }
}

/// Entries of a legend: what each colour means.
pub(super) fn swatches(names: &[&str]) -> Markup {
    html! {
        @for (index, name) in names.iter().enumerate() {
            li {
                svg.swatch viewBox="0 0 14 14" width="14" height="14" aria-hidden="true" {
                    (segment(index, 0.0, 0.0, 14.0, 14.0, &html! {}))
                }
                (name)
            }
        }
    }
}

/// A rectangle in the colour of a category, with what it says when pointed at.
pub(super) fn segment(
    cause: usize,
    x: f64,
    y: f64,
    width: f64,
    height: f64,
    title: &Markup,
) -> Markup {
    let (x, y, width, height) = (px(x), px(y), px(width), px(height));
    html! {
        g {
            (title)
            rect class=(fill(cause)) x=(x) y=(y) width=(width) height=(height) {}
            @if is_hatched(cause) {
                rect fill="url(#hatch)" x=(x) y=(y) width=(width) height=(height) {}
            }
        }
    }
}

/// What hatches refer to; once on a page, before the first of them.
pub(super) fn hatch() -> Markup {
    html! {
        svg.unseen width="0" height="0" aria-hidden="true" {
            defs {
                pattern #hatch width="6" height="6" patternUnits="userSpaceOnUse" patternTransform="rotate(45)" {
                    line.hatch x1="0" x2="0" y1="0" y2="6" {}
                }
            }
        }
    }
}

/// The chart: two panels side by side: cycles on one scale for all units, and each unit's own 100 %.
pub(super) fn chart(stacks: &[Stack<'_>]) -> Markup {
    let longest = stacks
        .iter()
        .map(|stack| {
            stack
                .row
                .cycles_per_block
                .max(stack.row.closed_form_per_block)
        })
        .filter(|cycles| cycles.is_finite())
        .fold(1.0, f64::max);
    let step = round_step(longest / 5.0);
    let cycles = Axis {
        values: (0.0, (longest / step).ceil() * step),
        pixels: (190.0, 530.0),
    };
    let shares = Axis {
        values: (0.0, 100.0),
        pixels: (620.0, 940.0),
    };
    let bottom = 14.0 + PITCH * stacks.len() as f64;
    let view = format!("0 0 960 {}", px(bottom + 44.0));
    html! {
        svg.wide viewBox=(view) role="img" aria-label="Cycles per texel block by cause, for each unit and layout" {
            @for (axis, unit, name) in [
                (cycles, "", "cycles per 4×4 texel block"),
                (shares, " %", "share of each unit’s own cycles"),
            ] {
                @for (value, label) in axis.ticks(5) {
                    @let x = px(axis.at(value));
                    line.gridline x1=(x) x2=(x) y1="6" y2=(px(bottom)) {}
                    text.tick x=(x) y=(px(bottom + 17.0)) text-anchor="middle" { (label) (unit) }
                }
                @let middle = (axis.pixels.0 + axis.pixels.1) / 2.0;
                text.axis x=(px(middle)) y=(px(bottom + 37.0)) text-anchor="middle" { (name) }
            }
            @for (index, stack) in stacks.iter().enumerate() {
                @let top = 16.0 + PITCH * index as f64;
                (names(stack.row, top))
                (bar(stack, cycles, 1.0, top))
                (bar(stack, shares, 100.0 / stack.row.cycles_per_block, top))
                (bound(stack.row, cycles, top))
            }
        }
    }
}

fn names(row: &TimingRow, top: f64) -> Markup {
    html! {
        text.name x="178" y=(px(top + 10.0)) text-anchor="end" {
            (shortened(&row.unit, 22)) title { (row.unit) }
        }
        text.tick x="178" y=(px(top + 24.0)) text-anchor="end" {
            (shortened(&row.layout, 28)) title { (row.layout) }
        }
    }
}

/// The segments, each cycle of a texel block counted `scale` times.
fn bar(stack: &Stack<'_>, along: Axis, scale: f64, top: f64) -> Markup {
    let mut edge = 0.0;
    html! {
        @for (cause, cycles) in stack.segments.iter().enumerate() {
            @let start = edge;
            @let () = { edge += cycles * scale };
            @if *cycles > 0.0 {
                @let (left, right) = (along.at(start), along.at(edge));
                @let title = html! { title { (cause_title(stack, cause)) } };
                // A gap of one pixel tells neighbours apart without colour.
                (segment(cause, left, top, (right - left - 1.0).max(0.5), 26.0, &title))
            }
        }
    }
}

/// The total behind the bar, and the mark of the closed form over it.
fn bound(row: &TimingRow, along: Axis, top: f64) -> Markup {
    let mark = along.at(row.closed_form_per_block);
    let end = along.at(row.cycles_per_block).max(mark);
    let (x, from, to) = (px(mark), px(top - 4.0), px(top + 30.0));
    html! {
        text.value x=(px(end + 7.0)) y=(px(top + 18.0)) { (decimal(row.cycles_per_block, 2)) }
        line.halo x1=(x) x2=(x) y1=(from) y2=(to) {}
        line.bound x1=(x) x2=(x) y1=(from) y2=(to) {
            title { "closed form: " (decimal(row.closed_form_per_block, 2)) }
        }
    }
}

fn cause_title(stack: &Stack<'_>, cause: usize) -> String {
    let cycles = stack.segments[cause];
    let share = cycles / stack.row.cycles_per_block;
    format!(
        "{} cycles per block, {}",
        decimal(cycles, 2),
        percent(share)
    )
}
