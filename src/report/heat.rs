//! Heat: layouts × cache lines as cells with their values.

use super::number::{percent, significant};
use super::svg::px;
use crate::timing::lab::line_size::{LineCell, LineGrid};
use maud::{Markup, html};

/// Left of the cells, and a cell's width and height, in pixels.
const LEFT: f64 = 118.0;
const CELL: (f64, f64) = (62.0, 23.0);
/// Between the cells of two storages.
const GAP: f64 = 14.0;
const TOP: f64 = 44.0;

/// A cell with so many times the least, or more, is darkest.
pub(super) const DARKEST: f64 = 64.0;

/// Different texts, in the order in which they come.
fn distinct<'a>(texts: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    let mut found = Vec::new();
    for text in texts {
        if !found.contains(&text) {
            found.push(text);
        }
    }
    found
}

/// What a storage's suffix means.
fn storage_name(suffix: &str) -> String {
    match suffix {
        "" => "cells whole, grid after grid".to_owned(),
        other => other.to_owned(),
    }
}

/// One grid: a row an order, a group of columns a storage, a column a line.
pub(super) fn grid(grid: &LineGrid, lines: &[u32]) -> Markup {
    let orders = distinct(grid.cells.iter().map(|cell| cell.order.as_str()));
    let storages = distinct(grid.cells.iter().map(|cell| cell.storage.as_str()));
    let logs = grid.cells.iter().map(|cell| cell.bytes_per_pixel.ln());
    let logs: Vec<f64> = logs.filter(|log| log.is_finite()).collect();
    let low = logs.iter().copied().fold(f64::INFINITY, f64::min);
    let high = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let high = high.min(low + DARKEST.ln());
    let least = grid.cells.iter().map(|cell| cell.bytes_per_pixel);
    let least = least.fold(f64::INFINITY, f64::min);
    let heat = |cell: &LineCell| {
        let share = (cell.bytes_per_pixel.ln() - low) / (high - low);
        if share.is_finite() {
            share.min(1.0)
        } else {
            0.0
        }
    };
    let group = lines.len() as f64 * CELL.0 + GAP;
    let x_of = |storage: usize, line: usize| LEFT + storage as f64 * group + line as f64 * CELL.0;
    let y_of = |order: usize| TOP + order as f64 * CELL.1;
    let (width, height) = (
        LEFT + storages.len() as f64 * group,
        y_of(orders.len()) + 4.0,
    );
    html! {
        svg.wide viewBox={ "0 0 " (px(width)) " " (px(height)) } role="img"
            aria-label="Bytes from memory per pixel for each layout and cache line" {
            @for (storage, suffix) in storages.iter().enumerate() {
                @let middle = x_of(storage, 0) + (group - GAP) / 2.0;
                text.name x=(px(middle)) y="14" text-anchor="middle" { (storage_name(suffix)) }
                @for (index, line) in lines.iter().enumerate() {
                    text.tick x=(px(x_of(storage, index) + CELL.0 / 2.0)) y="36" text-anchor="middle" { (line) " B" }
                }
            }
            @for (row, order) in orders.iter().enumerate() {
                text.tick x=(px(LEFT - 10.0)) y=(px(y_of(row) + 16.0)) text-anchor="end" { (order) }
            }
            @for cell in &grid.cells {
                @let row = orders.iter().position(|order| *order == cell.order);
                @let storage = storages.iter().position(|storage| *storage == cell.storage);
                @let line = lines.iter().position(|line| *line == cell.line_bytes);
                @if let (Some(row), Some(storage), Some(line)) = (row, storage, line) {
                    @let (x, y) = (x_of(storage, line), y_of(row));
                    @let opacity = format!("{:.2}", 0.04 + 0.5 * heat(cell));
                    g {
                        title {
                            (cell.order) (cell.storage) ", " (cell.line_bytes) " B: "
                            (significant(cell.bytes_per_pixel)) " B per pixel, hit rate " (percent(cell.hit_rate))
                        }
                        rect.warm fill-opacity=(opacity) x=(px(x)) y=(px(y))
                            width=(px(CELL.0 - 2.0)) height=(px(CELL.1 - 2.0)) {}
                        text.least[cell.bytes_per_pixel == least] x=(px(x + CELL.0 / 2.0 - 1.0))
                            y=(px(y + 15.5)) text-anchor="middle" { (significant(cell.bytes_per_pixel)) }
                    }
                }
            }
        }
    }
}
