//! Jobs: the jobs between the front end and the array, and the weights that they wait for.

use super::assemble::Job;
use super::cost::Cost;
use super::unit::Unit;
use super::watch::{Interval, Signal, Stage, Watch};
use std::collections::VecDeque;

/// A job whose inputs the unit holds.
#[derive(Clone, Copy, Debug)]
struct Gathered {
    number: u64,
    /// Groups embedded so far.
    groups: u64,
    /// When the last of them was embedded.
    at: u64,
}

/// A complete job, in the order of the array.
#[derive(Clone, Copy, Debug)]
struct Complete {
    job: Job,
    /// When its weights are there, once they are asked for.
    filled: Option<u64>,
}

/// The jobs that the array has not taken yet.
#[derive(Debug)]
pub(super) struct Jobs<'a> {
    costs: &'a [Cost<'a>],
    /// Jobs whose inputs the unit can hold: one in each bin, and one in the array.
    room: usize,
    latency: u64,
    gathered: Vec<Gathered>,
    complete: VecDeque<Complete>,
    /// Until when weights come in.
    filling: u64,
    /// Jobs that the array has taken and handed over.
    started: u64,
    handed_over: u64,
    /// Bytes of parameters that came in.
    pub(super) fill_bytes: u64,
    /// Times that a material's parameters came in.
    pub(super) fills: u64,
}

impl<'a> Jobs<'a> {
    pub(super) fn new(unit: &Unit, costs: &'a [Cost<'a>]) -> Jobs<'a> {
        Jobs {
            costs,
            room: unit.material_bins as usize + 1,
            latency: u64::from(unit.weight_latency_cycles),
            gathered: Vec::new(),
            complete: VecDeque::new(),
            filling: 0,
            started: 0,
            handed_over: 0,
            fill_bytes: 0,
            fills: 0,
        }
    }

    /// Whether every job has been taken.
    pub(super) fn is_empty(&self) -> bool {
        self.gathered.is_empty() && self.complete.is_empty()
    }

    /// Whether a group of this job can be embedded.
    pub(super) fn has_place(&self, job: u64) -> bool {
        let in_array = (self.started - self.handed_over) as usize;
        self.gathered.iter().any(|gathered| gathered.number == job)
            || self.gathered.len() + in_array < self.room
    }

    /// Opens the job of a group that is being embedded.
    pub(super) fn open(&mut self, job: u64, now: u64, watch: &mut impl Watch) {
        if self.gathered.iter().all(|gathered| gathered.number != job) {
            self.gathered.push(Gathered {
                number: job,
                groups: 0,
                at: now,
            });
            watch.level(Signal::HeldJobs, now, self.gathered.len() as u64);
        }
    }

    /// A group of the job has been embedded.
    pub(super) fn gather(&mut self, job: u64, now: u64) {
        let mut jobs = self.gathered.iter_mut();
        if let Some(gathered) = jobs.find(|gathered| gathered.number == job) {
            gathered.groups += 1;
            gathered.at = now;
        }
    }

    /// No more groups of these jobs will come.
    pub(super) fn complete(&mut self, jobs: &[Job]) {
        for &job in jobs {
            let filled = job.fill_bytes.is_none().then_some(0);
            self.complete.push_back(Complete { job, filled });
        }
    }

    /// Asks for weights; whether it did.
    pub(super) fn advance(&mut self, now: u64, watch: &mut impl Watch) -> bool {
        if self.filling > now {
            return false;
        }
        let mut waiting = self.complete.iter_mut();
        let Some(next) = waiting.find(|complete| complete.filled.is_none()) else {
            return false;
        };
        if self.handed_over < next.job.fill_after {
            return false;
        }
        let bytes = next.job.fill_bytes.unwrap_or(0);
        let cost = &self.costs[usize::from(next.job.material)];
        self.filling = now + self.latency + cost.fill(bytes);
        next.filled = Some(self.filling);
        self.fill_bytes += bytes;
        self.fills += 1;
        watch.interval(Interval {
            stage: Stage::WeightFill,
            number: next.job.number,
            part: 0,
            start: now,
            end: self.filling,
        });
        true
    }

    /// Gives the array its next job, if that is embedded and its weights are there.
    pub(super) fn take(&mut self, now: u64, watch: &mut impl Watch) -> Option<Job> {
        let next = *self.complete.front()?;
        let index = self.embedded(&next.job)?;
        next.filled.filter(|&at| at <= now)?;
        let gathered = self.gathered.remove(index);
        watch.level(Signal::HeldJobs, now, self.gathered.len() as u64);
        self.complete.pop_front();
        self.started += 1;
        watch.interval(Interval {
            stage: Stage::JobWait,
            number: next.job.number,
            part: 0,
            start: gathered.at,
            end: now,
        });
        Some(next.job)
    }

    /// The array has handed its job over.
    pub(super) fn hand_over(&mut self) {
        self.handed_over += 1;
    }

    /// Whether the next job waits for nothing but its weights.
    pub(super) fn waits_for_weights(&self) -> bool {
        let next = self.complete.front();
        next.is_some_and(|next| self.embedded(&next.job).is_some())
    }

    /// Where a job with all its groups is.
    fn embedded(&self, job: &Job) -> Option<usize> {
        let mut jobs = self.gathered.iter();
        jobs.position(|gathered| gathered.number == job.number && gathered.groups == job.groups)
    }

    /// The cycle at which weights are there.
    pub(super) fn event(&self) -> u64 {
        self.filling
    }
}
