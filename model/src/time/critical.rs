//! Critical: the longest path through a run whose queues have no end and whose lines come at once,
//! but for the latency of the first time.
//!
//! Each stage starts on a thing when the thing is there and the stage is free: start = max over what
//! is waited for, end = start + cost. No queue fills up and no line is wanted twice from memory, so
//! nothing else is waited for; a real unit waits for those too and never ends earlier. What remains finite is what a
//! unit is built of rather than sized by: each stage holds one thing, the unit holds the inputs of
//! `material_bins` + 1 jobs, and parameters come in one material after the other.

use super::assemble::{Group, Job};
use super::cost::Cost;
use super::job_cycles::{JobCycles, JobTable};
use super::memory;
use super::unit::Unit;
use std::collections::VecDeque;

/// A job some of whose groups are embedded.
#[derive(Clone, Copy, Debug)]
struct Open {
    number: u64,
    embedded: u64,
}

/// When each stage is free, after the groups so far.
#[derive(Debug)]
pub(super) struct CriticalPath<'a> {
    unit: &'a Unit,
    costs: &'a [Cost<'a>],
    table: JobTable,
    requested: u64,
    looked_up_from: u64,
    looked_up: u64,
    embedded: u64,
    open: Vec<Open>,
    opened: u64,
    /// When the last jobs, in the order of the array, left it; the first is job `left_first`.
    left_array: VecDeque<u64>,
    left_first: u64,
    filled: u64,
    filtered: u64,
    left: u64,
    firsts: Option<Firsts>,
}

/// When the first thing reaches a stage.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Firsts {
    pub(super) address: u64,
    pub(super) lookup: u64,
    pub(super) embed: u64,
    pub(super) array: u64,
    pub(super) filter: u64,
    pub(super) output: u64,
}

impl<'a> CriticalPath<'a> {
    /// The path from `start` on, when the first request can come in.
    pub(super) fn new(unit: &'a Unit, costs: &'a [Cost<'a>], start: u64) -> CriticalPath<'a> {
        CriticalPath {
            unit,
            costs,
            table: JobTable::default(),
            requested: start,
            looked_up_from: start,
            looked_up: start,
            embedded: start,
            open: Vec::new(),
            opened: 0,
            left_array: VecDeque::new(),
            left_first: 0,
            filled: 0,
            filtered: 0,
            left: start,
            firsts: None,
        }
    }

    /// Follows a group, and each job that is complete with it; `job` sees its cycles. Whether a line
    /// of the group `is_new` is known from the groups before it.
    pub(super) fn group(
        &mut self,
        group: &Group,
        is_new: bool,
        mut job: impl FnMut(&Job, &JobCycles),
    ) {
        let cost = &self.costs[usize::from(group.material)];
        self.requested += cost.request(group);
        // The address generators hold a group until the tags take it.
        let addressed_from = self.requested.max(self.looked_up_from);
        let addressed = addressed_from + cost.address(group);
        self.looked_up_from = addressed.max(self.looked_up);
        let tags: u64 = group.fetches.iter().map(|fetch| fetch.tag_cycles).sum();
        self.looked_up = self.looked_up_from + tags.max(1);
        let missed = if is_new {
            self.looked_up_from + memory::unloaded_cycles(self.unit)
        } else {
            0
        };
        let hit_latency = u64::from(self.unit.hit_latency_cycles);
        let corners = self.looked_up.max(missed) + hit_latency;
        let embedded_from = corners.max(self.embedded).max(self.has_inputs(group.job));
        self.embedded = embedded_from + cost.embed(group);
        if let Some(open) = self.open.iter_mut().find(|open| open.number == group.job) {
            open.embedded = self.embedded;
        }
        let firsts = self.firsts.get_or_insert(Firsts::default());
        if group.number == 0 {
            firsts.address = addressed_from;
            firsts.lookup = self.looked_up_from;
            firsts.embed = embedded_from;
        }
        for complete in &group.completes {
            self.job(complete, &mut job);
        }
    }

    /// When there is a place for the inputs of a job; the job is open from here on.
    fn has_inputs(&mut self, number: u64) -> u64 {
        if self.open.iter().any(|open| open.number == number) {
            return 0;
        }
        self.open.push(Open {
            number,
            embedded: 0,
        });
        self.opened += 1;
        // So many jobs have left the array before this one, the n-th, has a place.
        let before = (self.opened - 1).checked_sub(u64::from(self.unit.material_bins));
        before
            .filter(|&n| n > 0)
            .map_or(0, |n| self.left_array_at(n))
    }

    /// When the n-th job, counted from 1, left the array.
    fn left_array_at(&self, n: u64) -> u64 {
        let index = (n - 1).checked_sub(self.left_first);
        // Older ones left before those that are kept.
        index
            .and_then(|index| self.left_array.get(index as usize))
            .copied()
            .unwrap_or(0)
    }

    fn job(&mut self, complete: &Job, seen: &mut impl FnMut(&Job, &JobCycles)) {
        let index = usize::from(complete.material);
        let cost = &self.costs[index];
        let open = self
            .open
            .iter()
            .position(|open| open.number == complete.number);
        let embedded = open.map_or(0, |open| self.open.remove(open).embedded);
        let filled = match complete.fill_bytes {
            None => 0,
            Some(bytes) => {
                let free = match complete.fill_after {
                    0 => 0,
                    after => self.left_array_at(after),
                };
                let start = self.filled.max(self.looked_up).max(free);
                let latency = u64::from(self.unit.weight_latency_cycles);
                self.filled = start + latency + cost.fill(bytes);
                self.filled
            }
        };
        let cycles = self.table.of(cost, index, complete.decodes);
        let array_free = self.left_array.back().copied().unwrap_or(0);
        // With several bins the group that completes a job may be another's.
        let start = embedded.max(self.looked_up).max(filled).max(array_free);
        // The array holds a job until the filter takes it.
        let left_array = (start + cycles.total).max(self.filtered);
        self.left_array.push_back(left_array);
        if self.left_array.len() > KEPT {
            self.left_array.pop_front();
            self.left_first += 1;
        }
        self.filtered = left_array + cost.filter(complete.weighted);
        let output_from = self.filtered.max(self.left);
        self.left = output_from + cost.output(complete.pixels);
        if self.left_first == 0 && self.left_array.len() == 1 {
            let firsts = self.firsts.get_or_insert(Firsts::default());
            (firsts.array, firsts.filter, firsts.output) = (start, left_array, output_from);
        }
        seen(complete, cycles);
    }

    /// When the last channel has left, and when the first thing reached each stage.
    pub(super) fn end(&self) -> (u64, Firsts) {
        (self.left, self.firsts.unwrap_or_default())
    }
}

/// Jobs whose times are kept: more than a unit has bins and materials in its weight SRAM.
const KEPT: usize = 1 << 17;
