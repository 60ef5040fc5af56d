//! Ramulator: the misses of a run as a trace for a DRAM simulator.
//!
//! The format is the load/store trace of Ramulator 2 (`src/frontend/impl/memory_trace/
//! loadstore_trace.cpp`): one access a line, `LD` and a hexadecimal byte address.

use super::cost::Cost;
use super::unit::Unit;
use super::{stepped, work_of};
use crate::trace::Trace;
use ntmu_isa::{Asset, Program};

/// One line of text, without its end, for each line of latents that the run asks of memory, in
/// order.
pub fn ramulator_trace(
    unit: &Unit,
    asset: &Asset,
    program: &Program,
    trace: &Trace,
) -> impl Iterator<Item = String> + use<> {
    let work = work_of(asset, program);
    let cost = Cost::new(unit, &work, trace.texel_count() as u64);
    let run = stepped::run(&cost, trace, u64::MAX, true);
    let line_bytes = u64::from(unit.line_bytes);
    run.missed
        .into_iter()
        .map(move |line| format!("LD {:#x}", line * line_bytes))
}
