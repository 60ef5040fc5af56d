//! Cycles: what a texel block costs on each unit, layout and access, and which cause took the time.

use super::ReportError;
use super::number::{decimal, integer, percent};
use super::stacks::{Stack, causes, chart, legend, stack};
use crate::study::TimingRow;
use maud::{Markup, html};

/// The section, or why it is empty.
///
/// # Errors
/// When a ledger does not add up.
pub(super) fn section(rows: &[TimingRow]) -> Result<Markup, ReportError> {
    let causes = causes(rows);
    let mut parts = Vec::new();
    // The rows of an access follow each other.
    for rows in rows.chunk_by(|a, b| a.access == b.access) {
        let stacks = rows
            .iter()
            .map(|row| stack(row, &causes))
            .collect::<Result<Vec<_>, ReportError>>()?;
        parts.push(access(rows, &stacks, &causes));
    }
    Ok(html! {
        section #timing {
            h2 { "Cycles" }
            @if parts.is_empty() {
                p.missing { "No unit was simulated." }
            } @else {
                p {
                    "Every preset with several layouts, stepped cycle by cycle, the caches cold at the \
                     start. Every cycle of the unit is charged to exactly one cause. The closed form is a \
                     lower bound: the maximum over resources of work / rate, plus fill."
                }
                @for part in &parts { (part) }
                p.note {
                    "Cycles and bytes are per 4×4 block of pixels; of a scan, of texels. Median and 99 %: \
                     cycles between one job and the next for 16 of its pixels, the median job and the one \
                     that 99 of 100 are not slower than. Over bound: cycles / closed form. Critical path: \
                     the longest path with no queue ever full and each line waited for once. Infinite \
                     cache and no cache: the same unit with a latent cache that keeps every line, and \
                     without one. Hit rate: hits of the latent cache over tag lookups. MAC use: MACs done \
                     over MACs possible. Mtexel/s: millions of pixels per second at the unit’s clock."
                }
            }
        }
    })
}

/// What a reader calls an access.
fn heading(access: &str) -> &str {
    match access {
        "blocks" => "One mip in texel blocks",
        "plane" => "A floor, looked along, trilinear",
        other => other,
    }
}

fn access(rows: &[TimingRow], stacks: &[Stack<'_>], causes: &[&str]) -> Markup {
    let first = rows.first();
    html! {
        h3 { (heading(first.map_or("", |row| &row.access))) }
        @if let Some(row) = first {
            p.note { (row.scene) "; " (integer(row.pixels)) " pixels, " (integer(row.texels)) " decodes on the first unit." }
        }
        figure.chart {
            (legend(causes))
            div.scroll { (chart(stacks)) }
            figcaption {
                "Left: cycles per 4×4 block by cause, with the total at the end of each bar; shorter is \
                 faster. Right: the same cycles, each unit's total as 100 %."
            }
        }
        details {
            summary { "Cycles and their bounds" }
            (cycles(rows))
        }
        details {
            summary { "Bytes and throughput" }
            (bytes(rows))
        }
        details {
            summary { "Ledger" }
            (ledger(stacks, causes))
            p.note {
                "Cycles per 4×4 block, and the share of all cycles below; a row adds up to its total, \
                 but for the rounding shown."
            }
        }
    }
}

fn unit_cells(row: &TimingRow) -> Markup {
    html! { th scope="row" { (row.unit) small { (row.layout) } } }
}

/// A column's name, and what it counts below it.
fn column(name: &str, unit: &str) -> Markup {
    html! { th.number scope="col" { (name) small { (unit) } } }
}

fn cycles(rows: &[TimingRow]) -> Markup {
    let columns = [
        ("cycles", "mean"),
        ("median", "of jobs"),
        ("99 %", "of jobs"),
        ("closed form", "at least"),
        ("over bound", "ratio"),
        ("critical path", "at least"),
        ("infinite cache", "cycles"),
        ("no cache", "cycles"),
    ];
    html! {
        div.scroll {
            table {
                thead {
                    tr {
                        th scope="col" { "Unit" small { "layout" } }
                        @for (name, unit) in columns { (column(name, unit)) }
                        th scope="col" { "bottleneck" }
                    }
                }
                tbody {
                    @for row in rows {
                        tr {
                            (unit_cells(row))
                            td.number { (decimal(row.cycles_per_block, 2)) }
                            td.number { (decimal(row.block_cycles_p50, 1)) }
                            td.number { (decimal(row.block_cycles_p99, 1)) }
                            td.number { (decimal(row.closed_form_per_block, 2)) }
                            td.number { (decimal(row.cycles_per_block / row.closed_form_per_block, 2)) " ×" }
                            td.number { (decimal(row.critical_path_per_block, 2)) }
                            td.number { (decimal(row.infinite_cache_per_block, 2)) }
                            td.number { (decimal(row.without_cache_per_block, 2)) }
                            td { (row.bottleneck) }
                        }
                    }
                }
            }
        }
    }
}

fn bytes(rows: &[TimingRow]) -> Markup {
    let columns = [
        ("latent cache", "B read"),
        ("second level", "B read"),
        ("memory", "B of latents"),
        ("weights", "B from outside"),
        ("together", "B from outside"),
        ("infinite cache", "B together"),
        ("no cache", "B together"),
        ("hit rate", "latent cache"),
        ("MAC use", "of possible"),
        ("Mtexel/s", "at clock"),
    ];
    html! {
        div.scroll {
            table {
                thead {
                    tr {
                        th scope="col" { "Unit" small { "layout" } }
                        @for (name, unit) in columns { (column(name, unit)) }
                    }
                }
                tbody {
                    @for row in rows {
                        tr {
                            (unit_cells(row))
                            td.number { (decimal(row.levels.latent_cache, 1)) }
                            td.number { (decimal(row.levels.second_level, 1)) }
                            td.number { (decimal(row.levels.memory, 2)) }
                            td.number { (decimal(row.levels.weights, 2)) }
                            td.number { (decimal(row.bytes_per_block, 2)) }
                            td.number { (decimal(row.bytes_per_block_infinite_cache, 2)) }
                            td.number { (decimal(row.bytes_per_block_without_cache, 2)) }
                            td.number { (percent(row.hit_rate)) }
                            td.number { (percent(row.mac_utilisation)) }
                            td.number { (decimal(row.mtexels_per_second, 1)) }
                        }
                    }
                }
            }
        }
    }
}

fn ledger(stacks: &[Stack<'_>], causes: &[&str]) -> Markup {
    html! {
        div.scroll {
            table {
                thead {
                    tr {
                        th scope="col" { "Unit" small { "layout" } }
                        @for cause in causes { th.number scope="col" { (cause) } }
                        th.number.total scope="col" { "total" }
                    }
                }
                tbody {
                    @for stack in stacks {
                        tr {
                            (unit_cells(stack.row))
                            @for cycles in &stack.segments {
                                td.number.zero[*cycles == 0.0] {
                                    (decimal(*cycles, 2))
                                    small { (percent(cycles / stack.row.cycles_per_block)) }
                                }
                            }
                            td.number.total { (decimal(stack.row.cycles_per_block, 2)) }
                        }
                    }
                }
            }
        }
    }
}
