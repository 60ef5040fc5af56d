//! Stepped: the unit, cycle by cycle.
//!
//! ```text
//! requests ► queue ► address ► tags ► corner FIFO ► embed ► job ► MAC array ► output queue ► out
//!                                │         ▲
//!                                └ memory ─┘
//! ```
//!
//! Every stage holds one thing at a time, in request order, and keeps it until the next stage has
//! room. Time jumps from one cycle at which something can change to the next; every cycle between
//! is charged to the cause that holds for all of them.

use super::compute::Compute;
use super::cost::Cost;
use super::ledger::{Cause, Ledger};
use super::lookup::{Lookup, Outcomes};
use super::memory::Arrival;
use crate::trace::Trace;
use std::collections::VecDeque;

/// A stage that holds one group for a known time.
#[derive(Clone, Copy, Debug, Default)]
struct Stage {
    /// Groups that have left.
    passed: u64,
    /// When the group in it is done.
    end: Option<u64>,
}

impl Stage {
    fn is_done(&self, now: u64) -> bool {
        self.end.is_some_and(|end| end <= now)
    }

    fn pass(&mut self) {
        self.passed += 1;
        self.end = None;
    }
}

/// A group that waits for its corners.
#[derive(Clone, Copy, Debug)]
struct Waiting {
    arrival: Arrival,
    /// The corners can be read.
    ready: u64,
}

/// Jobs whose embedded inputs the unit holds: one in the array, and one that is being embedded.
const INPUT_JOBS: u64 = 2;

/// The unit at one cycle.
#[derive(Debug)]
struct Engine<'a> {
    cost: &'a Cost<'a>,
    ledger: Ledger,
    request: Stage,
    /// Groups in the request queue.
    queued: u64,
    address: Stage,
    lookup: Lookup<'a>,
    fifo: VecDeque<Waiting>,
    embed: Stage,
    compute: Compute<'a>,
    /// Jobs that the array has taken, and handed over.
    started: u64,
    handed_over: u64,
    /// Texels of each job in the output queue.
    output: VecDeque<u64>,
    output_texels: u64,
    output_end: Option<u64>,
    /// When each job's last channel left.
    left: Vec<u64>,
}

/// What a run leaves behind.
#[derive(Clone, Debug)]
pub(super) struct Run {
    pub(super) ledger: Ledger,
    pub(super) outcomes: Outcomes,
    pub(super) latent_bytes: u64,
    /// When each job's last channel left.
    pub(super) left: Vec<u64>,
    /// Lines asked of memory, in order, where they were wanted.
    pub(super) missed: Vec<u64>,
}

/// Runs the unit until the last channel has left. Time never jumps further than `stride` cycles.
pub(super) fn run(cost: &Cost, trace: &Trace, stride: u64, record_misses: bool) -> Run {
    let mut engine = Engine::new(cost, trace);
    engine.lookup.missed = record_misses.then(Vec::new);
    if cost.jobs > 0 {
        engine.ledger.charge(Cause::WeightFill, cost.weight_fill());
        engine.run(stride);
    }
    Run {
        ledger: engine.ledger,
        outcomes: engine.lookup.outcomes,
        latent_bytes: engine.lookup.memory.bytes,
        left: engine.left,
        missed: engine.lookup.missed.unwrap_or_default(),
    }
}

impl<'a> Engine<'a> {
    fn new(cost: &'a Cost<'a>, trace: &'a Trace) -> Engine<'a> {
        Engine {
            cost,
            ledger: Ledger::default(),
            request: Stage::default(),
            queued: 0,
            address: Stage::default(),
            lookup: Lookup::new(cost, trace),
            fifo: VecDeque::new(),
            embed: Stage::default(),
            compute: Compute::new(cost),
            started: 0,
            handed_over: 0,
            output: VecDeque::new(),
            output_texels: 0,
            output_end: None,
            left: Vec::new(),
        }
    }

    fn run(&mut self, stride: u64) {
        loop {
            let now = self.ledger.cycles();
            while self.advance(now) {}
            if self.left.len() as u64 == self.cost.jobs {
                return;
            }
            let next = self.next_event(now).min(now.saturating_add(stride));
            self.ledger.charge(self.cause(now), next - now);
        }
    }

    /// Everything that happens at the start of cycle `now`, from the end of the unit to its front,
    /// so that a freed place is taken in the same cycle. Whether anything happened.
    fn advance(&mut self, now: u64) -> bool {
        let back = self.advance_output(now) | self.advance_compute(now);
        back | self.advance_corners(now) | self.advance_front(now)
    }

    fn advance_output(&mut self, now: u64) -> bool {
        let mut changed = false;
        if self.output_end.is_some_and(|end| end <= now)
            && let Some(texels) = self.output.pop_front()
        {
            self.output_texels -= texels;
            self.output_end = None;
            self.left.push(now);
            changed = true;
        }
        if self.output_end.is_none()
            && let Some(&texels) = self.output.front()
        {
            self.output_end = Some(now + self.cost.output(texels));
            changed = true;
        }
        changed
    }

    fn advance_compute(&mut self, now: u64) -> bool {
        let mut changed = false;
        if self.compute.is_done(now) {
            let texels = self.cost.texels_of_job(self.handed_over);
            if self.output_texels + texels <= u64::from(self.cost.unit.output_queue_pixels) {
                self.compute.release();
                self.handed_over += 1;
                self.output.push_back(texels);
                self.output_texels += texels;
                changed = true;
            }
        }
        if self.compute.is_idle() && self.started < self.cost.jobs {
            let needed = ((self.started + 1) * self.cost.groups_per_job).min(self.cost.groups);
            if self.embed.passed >= needed {
                self.compute
                    .start(now, self.cost.texels_of_job(self.started));
                self.started += 1;
                changed = true;
            }
        }
        changed | self.compute.advance(now)
    }

    fn advance_corners(&mut self, now: u64) -> bool {
        let mut changed = false;
        if self.embed.is_done(now) {
            self.embed.pass();
            changed = true;
        }
        let has_place =
            self.embed.passed / self.cost.groups_per_job < self.handed_over + INPUT_JOBS;
        if self.embed.end.is_none()
            && has_place
            && self.fifo.front().is_some_and(|group| group.ready <= now)
        {
            self.fifo.pop_front();
            let texels = self.cost.texels_of_group(self.embed.passed);
            self.embed.end = Some(now + self.cost.embed(texels));
            changed = true;
        }
        changed
    }

    fn advance_front(&mut self, now: u64) -> bool {
        let unit = self.cost.unit;
        let group_texels = u64::from(unit.coalesced_texels);
        let mut changed = false;
        if let Some(arrival) = self.lookup.advance(now) {
            let ready = now.max(arrival.at) + u64::from(unit.hit_latency_cycles);
            self.fifo.push_back(Waiting { arrival, ready });
            changed = true;
        }
        let fifo_groups = u64::from(unit.corner_fifo_texels) / group_texels;
        let has_place = (self.fifo.len() as u64) < fifo_groups;
        if self.lookup.is_idle() && has_place && self.address.is_done(now) {
            self.lookup.start(now, self.address.passed);
            self.address.pass();
            changed = true;
        }
        if self.address.end.is_none() && self.queued > 0 {
            self.queued -= 1;
            let texels = self.cost.texels_of_group(self.address.passed);
            self.address.end = Some(now + self.cost.address(texels));
            changed = true;
        }
        if self.request.is_done(now)
            && self.queued < u64::from(unit.request_queue_texels) / group_texels
        {
            self.queued += 1;
            self.request.pass();
            changed = true;
        }
        if self.request.end.is_none() && self.request.passed < self.cost.groups {
            let texels = self.cost.texels_of_group(self.request.passed);
            self.request.end = Some(now + self.cost.request(texels));
            changed = true;
        }
        changed
    }

    /// What cycle `now` is spent on.
    fn cause(&self, now: u64) -> Cause {
        if self.compute.is_done(now) {
            return Cause::OutputFull;
        }
        if let Some(cause) = self.compute.cause(now) {
            return cause;
        }
        if self.started == self.cost.jobs {
            return Cause::Drain;
        }
        // No job is in the array. The oldest group that is not embedded is held up somewhere.
        if self.embed.end.is_some() {
            return Cause::Embed;
        }
        if let Some(group) = self.fifo.front() {
            return if now < group.arrival.unloaded.min(group.arrival.at) {
                Cause::LatentMiss
            } else if now < group.arrival.at {
                Cause::MemoryBandwidth
            } else {
                Cause::Lookup
            };
        }
        if let Some(cause) = self.lookup.cause(now) {
            return cause;
        }
        if self.address.end.is_some() {
            Cause::Address
        } else {
            Cause::Starved
        }
    }

    /// The next cycle after `now` at which something may happen or the cause may change.
    fn next_event(&self, now: u64) -> u64 {
        let corners = self.fifo.front().map_or([0; 3], |group| {
            [group.arrival.unloaded, group.arrival.at, group.ready]
        });
        let ends = [
            self.output_end,
            self.embed.end,
            self.address.end,
            self.request.end,
        ];
        ends.into_iter()
            .flatten()
            .chain(self.compute.events())
            .chain(self.lookup.events())
            .chain(corners)
            .filter(|&event| event > now)
            .fold(u64::MAX, u64::min)
    }
}
