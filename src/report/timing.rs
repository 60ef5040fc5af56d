//! Cycles: what a texel block costs on each unit and layout, and which cause took the time.

use super::ReportError;
use super::number::{decimal, percent};
use super::stacks::{Stack, causes, chart, legend, stack};
use crate::study::TimingRow;
use maud::{Markup, html};

/// The section, or why it is empty.
///
/// # Errors
/// When a ledger does not add up.
pub(super) fn section(rows: &[TimingRow]) -> Result<Markup, ReportError> {
    let causes = causes(rows);
    let stacks = rows
        .iter()
        .map(|row| stack(row, &causes))
        .collect::<Result<Vec<_>, ReportError>>()?;
    Ok(html! {
        section #timing {
            h2 { "Cycles" }
            @if stacks.is_empty() {
                p.missing { "No unit was simulated." }
            } @else {
                p {
                    "Every texel of every mip, in the order of 4×4 texel blocks, stepped cycle by \
                     cycle. Every cycle of the unit is charged to exactly one cause. The closed form \
                     is a lower bound: the maximum over resources of work / rate, plus fill."
                }
                figure.chart {
                    (legend(&causes))
                    div.scroll { (chart(&stacks)) }
                    figcaption {
                        "Left: cycles per 4×4 texel block by cause, with the total at the end of each \
                         bar; shorter is faster. Right: the same cycles, each unit's total as 100 %."
                    }
                }
                h3 { "Cost and throughput" }
                (costs(rows))
                p.note {
                    "Cycles and bytes from memory are per 4×4 texel block. Over bound: cycles / closed \
                     form. Hit rate: hits of the latent cache over tag lookups. MAC use: MACs done \
                     over MACs possible. Mtexel/s: millions of texels per second at the unit's clock."
                }
                h3 { "Ledger" }
                (ledger(&stacks, &causes))
                p.note {
                    "Cycles per 4×4 texel block, and the share of all cycles below; a row adds up to \
                     its total, but for the rounding shown."
                }
            }
        }
    })
}

fn unit_cells(row: &TimingRow) -> Markup {
    html! { th scope="row" { (row.unit) small { (row.layout) } } }
}

fn costs(rows: &[TimingRow]) -> Markup {
    html! {
        div.scroll {
            table {
                thead {
                    tr {
                        th scope="col" { "Unit" small { "layout" } }
                        th.number scope="col" { "cycles" small { "per block" } }
                        th.number scope="col" { "closed form" small { "per block" } }
                        th.number scope="col" { "over bound" small { "ratio" } }
                        th.number scope="col" { "memory" small { "B per block" } }
                        th.number scope="col" { "hit rate" small { "latent cache" } }
                        th.number scope="col" { "MAC use" small { "of possible" } }
                        th.number scope="col" { "Mtexel/s" small { "at clock" } }
                        th scope="col" { "bottleneck" }
                    }
                }
                tbody {
                    @for row in rows {
                        tr {
                            (unit_cells(row))
                            td.number { (decimal(row.cycles_per_block, 2)) }
                            td.number { (decimal(row.closed_form_per_block, 2)) }
                            td.number { (decimal(row.cycles_per_block / row.closed_form_per_block, 2)) " ×" }
                            td.number { (decimal(row.bytes_per_block, 2)) }
                            td.number { (percent(row.hit_rate)) }
                            td.number { (percent(row.mac_utilisation)) }
                            td.number { (decimal(row.mtexels_per_second, 1)) }
                            td { (row.bottleneck) }
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
