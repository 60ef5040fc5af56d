//! Back: what happens to a job's texels behind the array: filter, output queue, output.

use super::assemble::Job;
use super::cost::Cost;
use super::ledger::Cause;
use super::unit::Unit;
use super::watch::{Interval, Signal, Stage, Watch};
use std::collections::VecDeque;

/// A job that has left the array.
#[derive(Clone, Copy, Debug)]
struct Filtered {
    job: Job,
    start: u64,
    end: u64,
}

/// A job in the output queue.
#[derive(Clone, Copy, Debug)]
struct Queued {
    job: Job,
    since: u64,
}

/// The filter and the output queue.
#[derive(Debug)]
pub(super) struct Back<'a> {
    costs: &'a [Cost<'a>],
    room: u64,
    filtered: Option<Filtered>,
    queue: VecDeque<Queued>,
    /// Pixels in the queue.
    queued: u64,
    /// When the first job of the queue started to leave, and when it has left.
    leaving: Option<(u64, u64)>,
}

impl<'a> Back<'a> {
    pub(super) fn new(unit: &Unit, costs: &'a [Cost<'a>]) -> Back<'a> {
        Back {
            costs,
            room: u64::from(unit.output_queue_pixels),
            filtered: None,
            queue: VecDeque::new(),
            queued: 0,
            leaving: None,
        }
    }

    /// Whether the filter can take a job.
    pub(super) fn has_place(&self) -> bool {
        self.filtered.is_none()
    }

    /// Whether nothing is left.
    pub(super) fn is_empty(&self) -> bool {
        self.filtered.is_none() && self.queue.is_empty()
    }

    /// Takes a job.
    pub(super) fn take(&mut self, now: u64, job: Job) {
        let end = now + self.costs[usize::from(job.material)].filter(job.weighted);
        self.filtered = Some(Filtered {
            job,
            start: now,
            end,
        });
    }

    /// What happens at the start of cycle `now`: whether anything did, and the job that has left.
    pub(super) fn advance(&mut self, now: u64, watch: &mut impl Watch) -> (bool, Option<Job>) {
        let mut changed = false;
        let mut left = None;
        if let Some((start, end)) = self.leaving
            && end <= now
            && let Some(queued) = self.queue.pop_front()
        {
            self.leaving = None;
            self.queued -= queued.job.pixels;
            watch.level(Signal::OutputQueue, now, self.queued);
            show(watch, Stage::Output, &queued.job, start, end);
            left = Some(queued.job);
            changed = true;
        }
        if let Some(filtered) = self.filtered
            && filtered.end <= now
            && self.queued + filtered.job.pixels <= self.room
        {
            self.filtered = None;
            self.queued += filtered.job.pixels;
            watch.level(Signal::OutputQueue, now, self.queued);
            show(watch, Stage::Filter, &filtered.job, filtered.start, now);
            self.queue.push_back(Queued {
                job: filtered.job,
                since: now,
            });
            changed = true;
        }
        if self.leaving.is_none()
            && let Some(queued) = self.queue.front()
        {
            let cost = &self.costs[usize::from(queued.job.material)];
            self.leaving = Some((now, now + cost.output(queued.job.pixels)));
            show(watch, Stage::OutputWait, &queued.job, queued.since, now);
            changed = true;
        }
        (changed, left)
    }

    /// What a job that the filter has no place for waits for.
    pub(super) fn cause(&self, now: u64) -> Cause {
        match self.filtered {
            Some(filtered) if filtered.end > now => Cause::Filter,
            Some(_) | None => Cause::OutputFull,
        }
    }

    /// The cycles at which something may happen.
    pub(super) fn events(&self) -> [u64; 2] {
        let filtered = self.filtered.map_or(0, |filtered| filtered.end);
        [filtered, self.leaving.map_or(0, |leaving| leaving.1)]
    }
}

fn show(watch: &mut impl Watch, stage: Stage, job: &Job, start: u64, end: u64) {
    watch.interval(Interval {
        stage,
        number: job.number,
        part: 0,
        start,
        end,
    });
}
