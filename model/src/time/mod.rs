//! Time: how many cycles a unit takes for materials and demands, and what it spends them on.
//!
//! | module | answers |
//! |---|---|
//! | [`unit`](mod@unit), [`choice`] | which hardware |
//! | [`work`] | what a texel asks of it |
//! | `assemble`, `decoded`, `lines`, `weights` | which quads, groups and jobs the demands become, and what they touch |
//! | `cost` | how long each stage takes for one thing of its size |
//! | `front`, `lookup`, `cache`, `memory` | when a group's corners are there |
//! | `jobs`, `compute`, `back` | how a job gets its weights, goes through the MAC array, and out |
//! | `stepped` | the stages together, cycle by cycle |
//! | [`ledger`] | what each cycle was spent on |
//! | [`closed_form`](mod@closed_form), `critical`, `job_cycles` | the fewest cycles that any such unit needs |
//! | [`report`], [`energy`] | all of it as numbers |
//! | [`watch`] | what happens while it happens |
//!
//! What is simplified, and which way it errs:
//!
//! - A group of texels is the smallest thing in the front end, and at most one passes a stage in a
//!   cycle.
//! - Memory and the second level are pipes: one latency, one bandwidth, no banks, rows or refresh.
//!   [`Watch::miss`] gives the misses to a simulator that has them. Parameters come on a port of
//!   their own; the first material's come in before the first request.
//! - Corners are read when the group's turn comes, without occupying the cache's data banks twice.
//!   Conflicts are those of the tags.
//! - A line that was replaced while it was under way, and is wanted again, joins the miss under way.
//! - Integers of more than 8 bits and halves take whole passes of the array more. Numbers change
//!   their kind where the array reads them, at no cost.
//! - Accumulators hold a whole layer of every batch in flight, so the array never waits for a free
//!   one within a layer. Activations are written as fast as they are requantised.
//! - A job starts when its last texel is embedded and the job before it has left; its pixels are
//!   filtered and handed over together. A pixel's texels may lie in earlier jobs: their codes wait in
//!   the filter at no cost.
//! - The tags of the decoded-texel cache are looked up beside the address generators at no cost.

pub mod choice;
pub mod closed_form;
pub mod energy;
pub mod ledger;
pub mod presets;
pub mod report;
pub mod unit;
pub mod watch;
pub mod work;

mod assemble;
mod back;
mod cache;
mod compute;
mod cost;
mod critical;
mod decoded;
mod distinct;
#[cfg(test)]
mod fixture;
mod front;
mod job_cycles;
mod jobs;
mod lines;
mod lookup;
mod memory;
mod meter;
mod rate;
mod stepped;
#[cfg(test)]
mod tests;
mod weights;

pub use closed_form::{Bound, ClosedForm, Resource};
pub use ledger::{Cause, Ledger};
pub use report::{Measured, Timing};
pub use unit::{Configuration, Unit, UnitError};
pub use watch::Watch;
pub use work::{Work, work_of};

use crate::demand::Demands;
use crate::material::Material;
use assemble::Assembler;
use closed_form::Sums;
use cost::Cost;
use stepped::Stepped;

/// The run of a unit for demands on materials; `watch` sees it, and `()` costs nothing.
///
/// The caches start cold and all weights start outside. Memory does not grow with the demands.
///
/// # Errors
/// When a demand cannot be read.
///
/// # Panics
/// When a demand's material is not among `materials`: whoever makes demands knows how many there are.
pub fn simulate<D: Demands>(
    unit: &Unit,
    materials: &[Material],
    demands: &mut D,
    watch: &mut impl Watch,
) -> Result<Timing, D::Error> {
    run(unit, materials, demands, watch, 0, u64::MAX)
}

/// [`simulate`], measured behind the first pixels: [`Timing::measured`] begins when the first
/// `warm_up` pixels have left. The rest is about the whole run.
///
/// # Errors
/// When a demand cannot be read.
pub fn simulate_behind<D: Demands>(
    unit: &Unit,
    materials: &[Material],
    demands: &mut D,
    warm_up: u64,
) -> Result<Timing, D::Error> {
    run(unit, materials, demands, &mut (), warm_up, u64::MAX)
}

/// [`simulate`], with time moving at most `stride` cycles at once.
fn run<D: Demands>(
    unit: &Unit,
    materials: &[Material],
    demands: &mut D,
    watch: &mut impl Watch,
    warm_up: u64,
    stride: u64,
) -> Result<Timing, D::Error> {
    let costs = Cost::all(unit, materials);
    let mut stepped = Stepped::new(unit, &costs, demands, watch)?;
    stepped.meter.measured_from = warm_up;
    stepped.run(stride)?;
    Ok(Timing::new(unit, &costs, &stepped))
}

/// The fewest cycles that the run of a unit for these demands can take.
///
/// [`simulate`] never takes fewer, and takes exactly as many behind an ideal memory
/// ([`Unit::with_ideal_memory`]) with endless queues ([`Unit::with_unbounded_queues`]).
///
/// # Errors
/// When a demand cannot be read.
pub fn closed_form<D: Demands>(
    unit: &Unit,
    materials: &[Material],
    demands: &mut D,
) -> Result<ClosedForm, D::Error> {
    let costs = Cost::all(unit, materials);
    let mut assembler = Assembler::new(unit, &costs, demands)?;
    let first = assembler.first_material();
    let start = first.map_or(0, |material| costs[usize::from(material)].first_fill());
    let mut sums = Sums::new(unit, &costs, start);
    while let Some(group) = assembler.next()? {
        sums.group(&group);
        assembler.recycle(group);
    }
    Ok(sums.bound())
}
