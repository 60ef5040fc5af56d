//! Exactness: how far the model's codes lie from the real-number truth.

use super::number::{decimal, integer, signed, significant};
use super::svg::{Axis, px};
use crate::study::OracleStudy;
use maud::{Markup, html};
use std::collections::BTreeMap;

/// Most bars of the histogram; more differences than that share bars.
const MOST_BARS: u128 = 31;

/// One bar: the differences from `first` to `last`, in LSB, and how many codes have them.
struct Bar {
    first: i128,
    last: i128,
    codes: u64,
}

/// What was observed beside what was derived, and the histogram.
pub(super) fn section(oracle: &OracleStudy) -> Markup {
    let bars = bars(&oracle.histogram);
    html! {
        section #exactness {
            h2 { "Exactness" }
            p {
                "Model − oracle, over " (integer(oracle.codes)) " codes. The oracle decodes the same \
                 asset in real numbers (f64) and shares no arithmetic with the model. One LSB is one \
                 step of an output code. The bound is proven by propagating intervals through the \
                 actual weights: sound, and loose after many layers. The typical error is predicted \
                 from the variance of every rounding."
            }
            div.pair {
                div {
                    (derived(oracle))
                    (table(&bars, oracle.codes))
                }
                figure.chart {
                    (chart(&bars))
                    figcaption {
                        "Codes per difference (model code − oracle rounded to a code), on a \
                         logarithmic scale."
                        @if bars.iter().any(|bar| bar.first != bar.last) {
                            " Each bar gathers " (bars[0].last - bars[0].first + 1) " differences."
                        }
                    }
                }
            }
        }
    }
}

fn derived(oracle: &OracleStudy) -> Markup {
    html! {
        table {
            thead {
                tr {
                    th scope="col" { "|model − oracle|, LSB" }
                    th.number scope="col" { "observed" }
                    th.number scope="col" { "derived" }
                }
            }
            tbody {
                tr {
                    th scope="row" { "root of mean square" small { "derived: predicted typical" } }
                    td.number { (significant(oracle.rms)) }
                    td.number { (significant(oracle.typical)) }
                }
                tr {
                    th scope="row" { "largest" small { "derived: proven bound" } }
                    td.number { (significant(oracle.max)) }
                    td.number { "≤ " (significant(oracle.bound)) }
                }
            }
        }
    }
}

/// The histogram without gaps from its first difference to its last.
fn bars(histogram: &[(i64, u64)]) -> Vec<Bar> {
    let mut counts: BTreeMap<i128, u64> = BTreeMap::new();
    for (difference, codes) in histogram {
        *counts.entry(i128::from(*difference)).or_default() += codes;
    }
    let (Some((&low, _)), Some((&high, _))) = (counts.first_key_value(), counts.last_key_value())
    else {
        return Vec::new();
    };
    // Symmetric about zero, so that a bias shows, and with zero in the middle of a bar.
    let reach = low.unsigned_abs().max(high.unsigned_abs()).max(2);
    let width = (2 * reach + 1).div_ceil(MOST_BARS) | 1;
    let sides = reach.saturating_sub(width / 2).div_ceil(width) as i128;
    let width = width as i128;
    (-sides..=sides)
        .map(|index| {
            let (first, last) = (index * width - width / 2, index * width + width / 2);
            Bar {
                first,
                last,
                codes: counts.range(first..=last).map(|(_, codes)| codes).sum(),
            }
        })
        .collect()
}

fn name(bar: &Bar) -> String {
    if bar.first == bar.last {
        signed(bar.first)
    } else {
        format!("{} to {}", signed(bar.first), signed(bar.last))
    }
}

/// Few codes of many are not shown as none.
fn share(codes: u64, all: u64) -> String {
    let percent = 100.0 * codes as f64 / all as f64;
    if percent < 0.000_05 {
        "< 0.0001 %".to_owned()
    } else {
        format!("{} %", decimal(percent, 4))
    }
}

fn table(bars: &[Bar], all: u64) -> Markup {
    html! {
        table {
            thead {
                tr {
                    th.number scope="col" { "difference, LSB" }
                    th.number scope="col" { "codes" }
                    th.number scope="col" { "share" }
                }
            }
            tbody {
                @for bar in bars.iter().filter(|bar| bar.codes > 0) {
                    tr {
                        th.number scope="row" { (name(bar)) }
                        td.number { (integer(bar.codes)) }
                        td.number { (share(bar.codes, all)) }
                    }
                }
            }
        }
    }
}

fn chart(bars: &[Bar]) -> Markup {
    let most = bars.iter().map(|bar| bar.codes).max().unwrap_or(0).max(10);
    let decades = (most as f64).log10().ceil();
    // Half a decade below one code, so that a single code has a bar.
    let up = Axis {
        values: (-0.5, decades),
        pixels: (220.0, 24.0),
    };
    let pitch = 480.0 / bars.len().max(1) as f64;
    let wide = (pitch - 2.0).min(56.0);
    let label_every = bars.len().div_ceil(9) | 1;
    let middle = bars.len() / 2;
    html! {
        svg viewBox="0 0 560 262" role="img" aria-label="Histogram of model minus oracle in LSB" {
            @for decade in 0..=decades as u32 {
                @let y = px(up.at(decade.into()));
                line.gridline x1="64" x2="552" y1=(y) y2=(y) {}
                text.tick x="58" y=(y) dy="4" text-anchor="end" { (decimal(10_f64.powf(decade.into()), 0)) }
            }
            @for (index, bar) in bars.iter().enumerate() {
                @let centre = 68.0 + (index as f64 + 0.5) * pitch;
                @if bar.codes > 0 {
                    @let top = up.at((bar.codes as f64).log10());
                    rect.fill0 x=(px(centre - wide / 2.0)) width=(px(wide)) y=(px(top))
                        height=(px(220.0 - top)) {
                        title { (name(bar)) " LSB: " (integer(bar.codes)) " codes" }
                    }
                    @if bars.len() <= 9 {
                        text.value x=(px(centre)) y=(px(top - 5.0)) text-anchor="middle" { (integer(bar.codes)) }
                    }
                }
                @if index.abs_diff(middle).is_multiple_of(label_every) {
                    text.tick x=(px(centre)) y="236" text-anchor="middle" { (signed((bar.first + bar.last) / 2)) }
                }
            }
            line.baseline x1="64" x2="552" y1="220" y2="220" {}
            text.axis x="308" y="256" text-anchor="middle" { "model − oracle, LSB" }
            text.axis x="4" y="12" { "codes" }
        }
    }
}
