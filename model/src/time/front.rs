//! Front: a group's way from its requests to its corners: request queue, address generators, tags,
//! corner FIFO.

use super::assemble::Group;
use super::cost::Cost;
use super::ledger::Cause;
use super::lookup::{Lookup, Passed};
use super::memory::Arrival;
use super::unit::Unit;
use super::watch::{Interval, Signal, Stage, Watch};
use std::collections::VecDeque;

/// A group in a stage that holds one for a known time.
#[derive(Debug)]
struct Held {
    group: Group,
    start: u64,
    end: u64,
}

/// A group that waits for its corners.
#[derive(Debug)]
struct Waiting {
    group: Group,
    since: u64,
    arrival: Arrival,
    /// The corners can be read.
    ready: u64,
}

/// The front end.
#[derive(Debug)]
pub(super) struct Front<'a> {
    costs: &'a [Cost<'a>],
    hit_latency: u64,
    /// Groups that the queues hold.
    queue_room: usize,
    fifo_room: usize,
    request: Option<Held>,
    queue: VecDeque<Group>,
    address: Option<Held>,
    pub(super) lookup: Lookup,
    fifo: VecDeque<Waiting>,
}

impl<'a> Front<'a> {
    pub(super) fn new(unit: &Unit, costs: &'a [Cost<'a>]) -> Front<'a> {
        let groups = |texels: u32| (texels / unit.coalesced_texels) as usize;
        Front {
            costs,
            hit_latency: u64::from(unit.hit_latency_cycles),
            queue_room: groups(unit.request_queue_texels),
            fifo_room: groups(unit.corner_fifo_texels),
            request: None,
            queue: VecDeque::new(),
            address: None,
            lookup: Lookup::new(unit),
            fifo: VecDeque::new(),
        }
    }

    /// Whether the next group's requests can come in.
    pub(super) fn has_place(&self) -> bool {
        self.request.is_none()
    }

    /// Whether no group is left.
    pub(super) fn is_empty(&self) -> bool {
        self.request.is_none()
            && self.queue.is_empty()
            && self.address.is_none()
            && self.lookup.is_idle()
            && self.fifo.is_empty()
    }

    /// Takes a group.
    pub(super) fn take(&mut self, now: u64, group: Group) {
        let end = now + self.costs[usize::from(group.material)].request(&group);
        self.request = Some(Held {
            group,
            start: now,
            end,
        });
    }

    /// The first group whose corners are waited for.
    pub(super) fn first(&self, now: u64) -> Option<&Group> {
        let first = self.fifo.front().filter(|waiting| waiting.ready <= now);
        first.map(|waiting| &waiting.group)
    }

    /// The first group leaves the FIFO: its corners are read.
    pub(super) fn leave(&mut self, now: u64, watch: &mut impl Watch) -> Option<Group> {
        let waiting = self.fifo.pop_front()?;
        show(watch, Stage::Corners, &waiting.group, waiting.since, now);
        watch.level(Signal::CornerFifo, now, self.fifo.len() as u64);
        Some(waiting.group)
    }

    /// What happens at the start of cycle `now`; whether anything did. `pass` sees each group that
    /// passes the tags.
    pub(super) fn advance(
        &mut self,
        now: u64,
        watch: &mut impl Watch,
        mut pass: impl FnMut(&mut Group),
    ) -> bool {
        let mut changed = false;
        if let Some(passed) = self.lookup.advance(now, watch) {
            let Passed {
                mut group,
                arrival,
                since,
            } = passed;
            pass(&mut group);
            show(watch, Stage::Lookup, &group, since, now);
            self.fifo.push_back(Waiting {
                group,
                since: now,
                arrival,
                ready: now.max(arrival.at) + self.hit_latency,
            });
            watch.level(Signal::CornerFifo, now, self.fifo.len() as u64);
            changed = true;
        }
        if self.lookup.is_idle()
            && self.fifo.len() < self.fifo_room
            && let Some(held) = self.address.take_if(|held| held.end <= now)
        {
            show(watch, Stage::Address, &held.group, held.start, now);
            self.lookup.start(now, held.group, watch);
            changed = true;
        }
        if self.address.is_none()
            && let Some(group) = self.queue.pop_front()
        {
            watch.level(Signal::RequestQueue, now, self.queue.len() as u64);
            let end = now + self.costs[usize::from(group.material)].address(&group);
            self.address = Some(Held {
                group,
                start: now,
                end,
            });
            changed = true;
        }
        if self.queue.len() < self.queue_room
            && let Some(held) = self.request.take_if(|held| held.end <= now)
        {
            show(watch, Stage::Request, &held.group, held.start, now);
            self.queue.push_back(held.group);
            watch.level(Signal::RequestQueue, now, self.queue.len() as u64);
            changed = true;
        }
        changed
    }

    /// What the oldest group that is not embedded waits for.
    pub(super) fn cause(&self, now: u64) -> Cause {
        if let Some(waiting) = self.fifo.front() {
            return if now < waiting.arrival.unloaded.min(waiting.arrival.at) {
                Cause::LatentMiss
            } else if now < waiting.arrival.at {
                Cause::MemoryBandwidth
            } else {
                Cause::Lookup
            };
        }
        if let Some(cause) = self.lookup.cause(now) {
            cause
        } else if self.address.is_some() {
            Cause::Address
        } else {
            Cause::Starved
        }
    }

    /// The cycles at which the cause may change or something may happen.
    pub(super) fn events(&self) -> [u64; 7] {
        let [unloaded, at, ready] = self.fifo.front().map_or([0; 3], |waiting| {
            [waiting.arrival.unloaded, waiting.arrival.at, waiting.ready]
        });
        let [tags, done] = self.lookup.events();
        let end = |held: &Option<Held>| held.as_ref().map_or(0, |held| held.end);
        let (address, request) = (end(&self.address), end(&self.request));
        [unloaded, at, ready, tags, done, address, request]
    }
}

pub(super) fn show(watch: &mut impl Watch, stage: Stage, group: &Group, start: u64, end: u64) {
    watch.interval(Interval {
        stage,
        number: group.number,
        part: 0,
        start,
        end,
    });
}
