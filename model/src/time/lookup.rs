//! Lookup: the group in front of the tags of the latent cache.

use super::assemble::Group;
use super::cache::Tags;
use super::choice::{CacheKind, Misses};
use super::distinct::DistinctLines;
use super::ledger::Cause;
use super::memory::{Arrival, Memory};
use super::unit::Unit;
use super::watch::{Signal, Watch};

/// Lookups of lines by outcome.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Outcomes {
    /// The line was there.
    pub(super) hits: u64,
    /// The line was under way.
    pub(super) merges: u64,
    /// The line was asked for.
    pub(super) misses: u64,
}

/// A group in front of the tags.
#[derive(Debug)]
struct Looked {
    group: Group,
    /// When it came.
    since: u64,
    fetch: usize,
    /// The next line.
    line: usize,
    /// Start and end of the tags' cycles for the fetch.
    start: u64,
    end: u64,
    /// A miss register is free from here on.
    stalled_until: Option<u64>,
    /// The tags wait for the lines under way.
    is_blocked: bool,
    /// The fetch has waited for a miss register.
    has_stalled: bool,
    /// The latest line so far.
    arrival: Arrival,
    misses: u32,
}

/// What the cache holds.
#[derive(Debug)]
enum Held {
    Sets(Tags),
    Nothing,
    Everything(DistinctLines),
}

/// The tags, the miss registers and the group in front of them.
#[derive(Debug)]
pub(super) struct Lookup {
    held: Held,
    is_blocking: bool,
    line_bytes: u64,
    pub(super) memory: Memory,
    pub(super) outcomes: Outcomes,
    looked: Option<Looked>,
}

/// A group that has passed the tags.
pub(super) struct Passed {
    pub(super) group: Group,
    /// Its latest line.
    pub(super) arrival: Arrival,
    /// When it came to the tags.
    pub(super) since: u64,
}

impl Lookup {
    pub(super) fn new(unit: &Unit) -> Lookup {
        Lookup {
            held: match unit.cache {
                CacheKind::Finite => Held::Sets(Tags::new(
                    unit.cache_sets,
                    unit.cache_ways,
                    unit.replacement,
                )),
                CacheKind::None => Held::Nothing,
                CacheKind::Infinite => Held::Everything(DistinctLines::default()),
            },
            is_blocking: unit.misses == Misses::Blocking,
            line_bytes: u64::from(unit.line_bytes),
            memory: Memory::new(unit),
            outcomes: Outcomes::default(),
            looked: None,
        }
    }

    /// Whether no group is in front of the tags.
    pub(super) fn is_idle(&self) -> bool {
        self.looked.is_none()
    }

    /// Takes a group.
    pub(super) fn start(&mut self, now: u64, group: Group, watch: &mut impl Watch) {
        let end = now + group.fetches.first().map_or(1, |fetch| fetch.tag_cycles);
        self.looked = Some(Looked {
            group,
            since: now,
            fetch: 0,
            line: 0,
            start: now,
            end,
            stalled_until: None,
            is_blocked: false,
            has_stalled: false,
            arrival: Arrival::THERE,
            misses: 0,
        });
        self.issue(now, watch);
    }

    /// Looks up the lines of the fetch from the next one on, until one finds no miss register.
    fn issue(&mut self, now: u64, watch: &mut impl Watch) {
        let Some(mut looked) = self.looked.take() else {
            return;
        };
        looked.stalled_until = None;
        self.settle(now, watch);
        let before = self.memory.under_way();
        let end = looked
            .group
            .fetches
            .get(looked.fetch)
            .map_or(0, |fetch| fetch.end);
        while looked.line < end {
            let line = looked.group.lines[looked.line];
            let arrival = match self.find(line) {
                Some(arrival) if arrival.at > now => {
                    self.outcomes.merges += 1;
                    arrival
                }
                Some(arrival) => {
                    self.outcomes.hits += 1;
                    arrival
                }
                None => match self.memory.request(line, now) {
                    Ok((is_fetched, arrival)) => {
                        self.outcomes.misses += 1;
                        looked.misses += 1;
                        self.install(line, arrival);
                        if is_fetched {
                            watch.miss(now, line * self.line_bytes);
                        }
                        arrival
                    }
                    Err(free) => {
                        looked.stalled_until = Some(free);
                        looked.has_stalled = true;
                        break;
                    }
                },
            };
            if arrival.at > looked.arrival.at {
                looked.arrival = arrival;
            }
            looked.line += 1;
        }
        if looked.has_stalled && looked.stalled_until.is_none() {
            looked.end = looked.end.max(now + 1);
        }
        self.looked = Some(looked);
        let after = self.memory.under_way();
        if after != before {
            watch.level(Signal::MissRegisters, now, after as u64);
        }
    }

    /// Frees the miss registers of the lines that are there at `now`, and shows when each was free.
    pub(super) fn settle(&mut self, now: u64, watch: &mut impl Watch) {
        self.memory.retire(now, |at, in_use| {
            watch.level(Signal::MissRegisters, at, in_use as u64);
        });
    }

    /// When the line's data are there, if it need not be asked for. A line that was replaced while
    /// it was under way, and is wanted again, joins the miss under way.
    fn find(&mut self, line: u64) -> Option<Arrival> {
        match &mut self.held {
            Held::Sets(tags) => tags.touch(line).or_else(|| {
                let arrival = self.memory.pending(line)?;
                tags.install(line, arrival);
                Some(arrival)
            }),
            Held::Nothing => None,
            Held::Everything(lines) => lines
                .has(line)
                .then(|| self.memory.pending(line).unwrap_or(Arrival::THERE)),
        }
    }

    fn install(&mut self, line: u64, arrival: Arrival) {
        match &mut self.held {
            Held::Sets(tags) => tags.install(line, arrival),
            Held::Nothing => {}
            Held::Everything(lines) => lines.add(line),
        }
    }

    /// What happens at the start of cycle `now`. The group once its fetches are done.
    pub(super) fn advance(&mut self, now: u64, watch: &mut impl Watch) -> Option<Passed> {
        let free = self.looked.as_ref()?.stalled_until;
        if free.is_some_and(|free| free <= now) {
            self.issue(now, watch);
        }
        let looked = self.looked.as_mut()?;
        if looked.stalled_until.is_some() || looked.end > now {
            return None;
        }
        if looked.fetch + 1 < looked.group.fetches.len() {
            looked.fetch += 1;
            looked.start = now;
            looked.has_stalled = false;
            looked.end = now + looked.group.fetches[looked.fetch].tag_cycles;
            self.issue(now, watch);
            return None;
        }
        if self.is_blocking
            && looked.misses > 0
            && let Some(last) = self.memory.last().filter(|&last| last > now)
        {
            // The tags take nothing more until the lines are there.
            looked.end = last;
            looked.is_blocked = true;
            return None;
        }
        let looked = self.looked.take()?;
        let lines = looked.group.lines.len() as u32;
        watch.lookup(looked.group.pixel, lines, looked.misses);
        Some(Passed {
            group: looked.group,
            arrival: looked.arrival,
            since: looked.since,
        })
    }

    /// What cycle `now` is spent on, of the group in front of the tags.
    pub(super) fn cause(&self, now: u64) -> Option<Cause> {
        let looked = self.looked.as_ref()?;
        Some(if looked.stalled_until.is_some() {
            Cause::MshrFull
        } else if looked.is_blocked {
            Cause::LatentMiss
        } else if now == looked.start || looked.has_stalled {
            Cause::Lookup
        } else {
            Cause::BankConflict
        })
    }

    /// The cycles at which the cause may change or something may happen.
    pub(super) fn events(&self) -> [u64; 2] {
        self.looked
            .as_ref()
            .map_or([0; 2], |looked| match looked.stalled_until {
                Some(free) => [free, free],
                None => [looked.start + 1, looked.end],
            })
    }
}
