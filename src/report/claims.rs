//! Claims: what is promised of the model, beside what was observed.

use super::number::{integer, percent, significant};
use crate::study::{EngineStudy, Findings};
use maud::{Markup, html};

/// The three claims at the texels that were tried.
pub(super) fn section(found: &Findings, engine: &EngineStudy) -> Markup {
    html! {
        section #claims {
            h2 { "Claims" }
            p {
                "At " (integer(found.texels as u64)) " texels of all mips. First: every value on the way \
                 equals a second evaluation of the specification in wide integers; "
                (integer(found.not_naive as u64)) " texels differ. Second: each stage, given its own \
                 input, lies within what its roundings allow; the table has the lane that came nearest. \
                 Third: end to end, within what interval propagation proves, with the root mean square \
                 that variances predict."
                @if found.overflowing > 0 {
                    " The last two leave out " (integer(found.overflowing as u64)) " texels whose sums went \
                     beyond their width."
                }
            }
            p {
                "The engine (" (engine.path) ") that decoded the images differs from the reference at "
                (integer(engine.differing as u64)) " of " (integer(engine.texels as u64)) " texels."
            }
            div.pair { (stages(found)) (channels(found)) }
        }
    }
}

fn stages(found: &Findings) -> Markup {
    html! {
        table {
            thead {
                tr {
                    th scope="col" { "stage" }
                    th.number scope="col" { "|value − real|" }
                    th.number scope="col" { "bound" }
                    th.number scope="col" { "used" }
                }
            }
            tbody {
                @for (stage, distance) in &found.stages {
                    tr {
                        th scope="row" { (stage) }
                        td.number { (significant(distance.found)) }
                        td.number { "≤ " (significant(distance.bound)) }
                        td.number { (percent(distance.share())) }
                    }
                }
            }
        }
    }
}

fn channels(found: &Findings) -> Markup {
    html! {
        table {
            thead {
                tr {
                    th scope="col" { "channel" }
                    th.number scope="col" { "largest" }
                    th.number scope="col" { "worst case" }
                    th.number scope="col" { "rms" }
                    th.number scope="col" { "predicted" }
                }
            }
            tbody {
                @for (index, channel) in found.channels.iter().enumerate() {
                    tr {
                        th scope="row" { (index) }
                        td.number { (significant(channel.observed_max)) }
                        td.number { "≤ " (significant(channel.worst)) }
                        td.number { (significant(channel.observed_rms)) }
                        td.number { (significant(channel.predicted_rms)) }
                    }
                }
            }
        }
    }
}
