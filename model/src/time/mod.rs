//! Time: how many cycles a unit takes for a program and a trace, and what it spends them on.
//!
//! | module | answers |
//! |---|---|
//! | [`unit`](mod@unit), [`presets`] | which hardware |
//! | [`work`] | what a texel asks of it |
//! | `cost` | how long each stage takes for one thing of its size |
//! | `lookup`, `cache`, `memory` | when a texel's corners are there |
//! | `compute` | how a job goes through the MAC array and the requantisers |
//! | `stepped` | the stages together, cycle by cycle |
//! | [`ledger`] | what each cycle was spent on |
//! | [`closed_form`](mod@closed_form) | the fewest cycles that any such unit needs |
//! | [`report`] | all of it as numbers |
//! | [`energy`](mod@energy) | what was done, at published prices |
//! | [`ramulator`] | the misses as another simulator's trace |
//!
//! What is simplified, and which way it errs:
//!
//! - A group of coalesced texels is the smallest thing in the front end, and at most one passes a
//!   stage in a cycle.
//! - Memory is a pipe: one latency, one bandwidth, no banks, rows or refresh, in order. [`ramulator`]
//!   writes the misses for a simulator that has them. Parameters come on a port of their own, and
//!   all that stay come in before the first request.
//! - Corners are read when the texel's turn comes, without occupying the cache's data banks twice.
//!   Conflicts are those of the tags.
//! - A line that was replaced while it was under way, and is wanted again, joins the miss under way.
//! - Integers of more than 8 bits and halves take whole passes of the array more. Numbers change
//!   their kind where the array reads them, at no cost.
//! - Accumulators hold a whole layer of every batch in flight, so the array never waits for a free
//!   one within a layer. Activations are written as fast as they are requantised.
//! - A job starts when its last texel is embedded and the job before it has left; its channels are
//!   handed over together.

pub mod closed_form;
pub mod energy;
pub mod ledger;
pub mod presets;
pub mod ramulator;
pub mod report;
pub mod unit;
pub mod work;

pub mod choice;
pub mod watch;

mod cache;
mod compute;
mod cost;
#[cfg(test)]
mod fixture;
mod lookup;
mod memory;
mod rate;
mod stepped;
#[cfg(test)]
mod tests;

pub use closed_form::{Bound, ClosedForm, Resource};
pub use ledger::{Cause, Ledger};
pub use ramulator::ramulator_trace;
pub use report::Timing;
pub use unit::{Configuration, Unit, UnitError};
pub use work::{Work, work_of};

use crate::trace::Trace;
use cost::Cost;
use ntmu_isa::{Asset, Program};

/// The run of `program` on `unit` for the texels of `trace`.
///
/// `program` was compiled for, or linked to, `asset`, and `trace` was recorded from a run of
/// `program`. The cache starts cold and the weights start outside.
#[must_use]
pub fn simulate(unit: &Unit, asset: &Asset, program: &Program, trace: &Trace) -> Timing {
    simulate_with_stride(unit, asset, program, trace, u64::MAX)
}

/// [`simulate`], with time moving at most `stride` cycles at once.
fn simulate_with_stride(
    unit: &Unit,
    asset: &Asset,
    program: &Program,
    trace: &Trace,
    stride: u64,
) -> Timing {
    let work = work_of(asset, program);
    let cost = Cost::new(unit, &work, trace.texel_count() as u64);
    let run = stepped::run(&cost, trace, stride, false);
    let batches = cost.texels.div_ceil(u64::from(unit.batch_texels));
    let resident = if cost.texels == 0 {
        0
    } else {
        cost.resident_bytes
    };
    let counts = report::Counts {
        ledger: run.ledger,
        closed_form: closed_form::bound(&cost, trace),
        texels: cost.texels,
        macs_per_texel: work.macs(),
        latent_bytes: run.latent_bytes,
        weight_bytes: resident + batches * cost.streamed_bytes,
        hits: run.outcomes.hits,
        merges: run.outcomes.merges,
        misses: run.outcomes.misses,
        left: run.left,
    };
    Timing::new(unit, counts)
}

/// The fewest cycles that the run of `program` on `unit` for the texels of `trace` can take.
///
/// [`simulate`] never takes fewer, and takes exactly as many behind an ideal memory
/// ([`Unit::with_ideal_memory`]).
#[must_use]
pub fn closed_form(unit: &Unit, asset: &Asset, program: &Program, trace: &Trace) -> ClosedForm {
    let work = work_of(asset, program);
    closed_form::bound(&Cost::new(unit, &work, trace.texel_count() as u64), trace)
}
