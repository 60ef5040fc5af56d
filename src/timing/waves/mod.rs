//! Waves: a run as files that other people's viewers and simulators open.
//!
//! | writer | file | opened by |
//! |---|---|---|
//! | [`Vcd`] | value change dump, IEEE 1364 | GTKWave, Surfer |
//! | [`Perfetto`] | trace events, JSON | ui.perfetto.dev, chrome://tracing |
//! | [`Konata`] | Kanata 0004 | Konata |
//! | [`Ramulator`] | memory accesses | Ramulator 2 |
//!
//! Each is a [`Watch`](ntmu_model::time::Watch). A watch cannot fail: the first error of the writer
//! is remembered, nothing is written after it, and `finish` returns it. A file that was not finished
//! is not whole.

mod cut;
mod konata;
mod perfetto;
mod ramulator;
mod recording;
mod sink;
mod vcd;

pub use cut::{Summary, Window};
pub use konata::Konata;
pub use perfetto::Perfetto;
pub use ramulator::{Ramulator, RamulatorFormat};
pub use vcd::{Vcd, VcdTime};

use ntmu_model::time::watch::{Interval, Stage};

/// The layer and the batch of a part, where the stage has such parts.
fn layer_and_batch(interval: &Interval) -> Option<(u32, u32)> {
    match interval.stage {
        Stage::Dense | Stage::Requantize => Some((interval.part >> 8, interval.part & 0xFF)),
        Stage::Request
        | Stage::Address
        | Stage::Lookup
        | Stage::Corners
        | Stage::Embed
        | Stage::WeightFill
        | Stage::JobWait
        | Stage::Filter
        | Stage::OutputWait
        | Stage::Output => None,
    }
}

/// What an interval is about: `group 12`, `job 3`, `job 3 layer 2 batch 1`.
fn label(interval: &Interval) -> String {
    let number = interval.number;
    match layer_and_batch(interval) {
        Some((layer, batch)) => format!("job {number} layer {layer} batch {batch}"),
        None if interval.stage.is_front() => format!("group {number}"),
        None => format!("job {number}"),
    }
}
