//! Stepped: the unit, cycle by cycle.
//!
//! ```text
//! requests ► queue ► address ► tags ► corner FIFO ► embed ► jobs ► MAC array ► filter ► queue ► out
//!                                │         ▲                 ▲
//!                                └ memory ─┘        weights ─┘
//! ```
//!
//! Every stage holds one thing at a time and keeps it until the next stage has room. Time jumps from
//! one cycle at which something can change to the next; every cycle between is charged to the cause
//! that holds for all of them.

use super::assemble::{Assembler, Group, Job};
use super::back::Back;
use super::closed_form::Sums;
use super::compute::Compute;
use super::cost::Cost;
use super::front::{self, Front};
use super::jobs::Jobs;
use super::ledger::{Cause, Ledger};
use super::meter::Meter;
use super::unit::Unit;
use super::watch::{Interval, Stage, Watch};
use crate::demand::Demands;

/// A group that is being embedded.
#[derive(Debug)]
struct Embedding {
    group: Group,
    start: u64,
    end: u64,
}

/// The unit at one cycle.
pub(super) struct Stepped<'a, 'd, D: Demands, W: Watch> {
    costs: &'a [Cost<'a>],
    pub(super) assembler: Assembler<'a, 'd, D>,
    is_exhausted: bool,
    pub(super) sums: Sums<'a>,
    pub(super) meter: Meter<'a>,
    pub(super) ledger: Ledger,
    pub(super) front: Front<'a>,
    embedding: Option<Embedding>,
    pub(super) jobs: Jobs<'a>,
    compute: Compute<'a>,
    computed: Option<Job>,
    back: Back<'a>,
    watch: &'d mut W,
}

impl<'a, 'd, D: Demands, W: Watch> Stepped<'a, 'd, D, W> {
    /// The unit before the first cycle.
    ///
    /// # Errors
    /// When the first demand cannot be read.
    pub(super) fn new(
        unit: &'a Unit,
        costs: &'a [Cost<'a>],
        demands: &'d mut D,
        watch: &'d mut W,
    ) -> Result<Stepped<'a, 'd, D, W>, D::Error> {
        let assembler = Assembler::new(unit, costs, demands)?;
        let first = assembler
            .first_material()
            .map(|material| &costs[usize::from(material)]);
        let start = first.map_or(0, Cost::first_fill);
        let mut stepped = Stepped {
            costs,
            is_exhausted: false,
            sums: Sums::new(unit, costs, start),
            meter: Meter::new(unit, costs),
            ledger: Ledger::default(),
            front: Front::new(unit, costs),
            embedding: None,
            jobs: Jobs::new(unit, costs),
            compute: Compute::new(unit),
            computed: None,
            back: Back::new(unit, costs),
            assembler,
            watch,
        };
        if let Some(first) = first.filter(|first| first.resident_bytes > 0) {
            stepped.jobs.fill_bytes = first.resident_bytes;
            stepped.jobs.fills = 1;
            stepped.charge(Cause::WeightFill, start);
            stepped.watch.interval(Interval {
                stage: Stage::WeightFill,
                number: 0,
                part: 0,
                start: 0,
                end: start,
            });
        }
        Ok(stepped)
    }

    /// Runs until the last channel has left. Time never jumps further than `stride` cycles.
    ///
    /// # Errors
    /// When a demand cannot be read.
    pub(super) fn run(&mut self, stride: u64) -> Result<(), D::Error> {
        loop {
            let now = self.ledger.cycles();
            while self.advance(now)? {}
            if self.is_done() {
                self.front.lookup.settle(now, self.watch);
                return Ok(());
            }
            let next = self.next_event(now).min(now.saturating_add(stride));
            self.charge(self.cause(now), next - now);
        }
    }

    fn charge(&mut self, cause: Cause, cycles: u64) {
        let start = self.ledger.cycles();
        self.ledger.charge(cause, cycles);
        self.watch.charge(cause, start, start + cycles);
    }

    fn is_done(&self) -> bool {
        self.is_exhausted
            && self.front.is_empty()
            && self.embedding.is_none()
            && self.jobs.is_empty()
            && self.compute.is_idle()
            && self.back.is_empty()
    }

    /// Everything that happens at the start of cycle `now`, from the end of the unit to its front,
    /// so that a freed place is taken in the same cycle. Whether anything happened.
    fn advance(&mut self, now: u64) -> Result<bool, D::Error> {
        let (mut changed, left) = self.back.advance(now, self.watch);
        if let Some(job) = left {
            self.meter.left(now, &job, &self.ledger);
        }
        changed |= self.advance_array(now);
        changed |= self.advance_embedding(now);
        let jobs = &mut self.jobs;
        let meter = &mut self.meter;
        changed |= self.front.advance(now, self.watch, |group| {
            meter.passed(group);
            jobs.complete(&group.completes);
        });
        if !self.is_exhausted && self.front.has_place() {
            match self.assembler.next()? {
                Some(group) => {
                    self.sums.group(&group);
                    self.front.take(now, group);
                    changed = true;
                }
                None => self.is_exhausted = true,
            }
        }
        Ok(changed)
    }

    fn advance_array(&mut self, now: u64) -> bool {
        let mut changed = self.jobs.advance(now, self.watch);
        if self.compute.is_done(now)
            && self.back.has_place()
            && let Some(job) = self.computed.take()
        {
            self.compute.release();
            self.jobs.hand_over();
            self.back.take(now, job);
            changed = true;
        }
        if self.compute.is_idle()
            && let Some(job) = self.jobs.take(now, self.watch)
        {
            self.compute
                .start(now, &self.costs[usize::from(job.material)], &job);
            self.meter.started(&job);
            self.computed = Some(job);
            changed = true;
        }
        changed | self.compute.advance(now, self.watch)
    }

    fn advance_embedding(&mut self, now: u64) -> bool {
        let mut changed = false;
        if let Some(done) = self.embedding.take_if(|embedding| embedding.end <= now) {
            front::show(self.watch, Stage::Embed, &done.group, done.start, now);
            self.jobs.gather(done.group.job, now);
            self.assembler.recycle(done.group);
            changed = true;
        }
        if self.embedding.is_none()
            && let Some(first) = self.front.first(now)
            && self.jobs.has_place(first.job)
            && let Some(group) = self.front.leave(now, self.watch)
        {
            self.jobs.open(group.job, now, self.watch);
            let end = now + self.costs[usize::from(group.material)].embed(&group);
            self.embedding = Some(Embedding {
                group,
                start: now,
                end,
            });
            changed = true;
        }
        changed
    }

    /// What cycle `now` is spent on.
    fn cause(&self, now: u64) -> Cause {
        if self.compute.is_done(now) {
            return self.back.cause(now);
        }
        if let Some(cause) = self.compute.cause(now) {
            return cause;
        }
        // No job is in the array. The oldest group that is not embedded is held up somewhere.
        if self.jobs.waits_for_weights() {
            Cause::WeightFill
        } else if self.embedding.is_some() {
            Cause::Embed
        } else if self.is_exhausted && self.front.is_empty() {
            Cause::Drain
        } else {
            self.front.cause(now)
        }
    }

    /// The next cycle after `now` at which something may happen or the cause may change.
    fn next_event(&self, now: u64) -> u64 {
        let embedding = self.embedding.as_ref().map_or(0, |embedding| embedding.end);
        let single = [embedding, self.jobs.event()];
        let events = single.into_iter().chain(self.back.events());
        let events = events
            .chain(self.compute.events())
            .chain(self.front.events());
        events.filter(|&event| event > now).fold(u64::MAX, u64::min)
    }
}
