//! Lookup: the lines that a group's fetches touch, and the cycles of the tags for them.

use super::cache::Tags;
use super::cost::Cost;
use super::ledger::Cause;
use super::memory::{Arrival, Memory};
use super::unit::Unit;
use crate::trace::Trace;

/// The distinct lines of one fetch of a group, and how they spread over the banks.
#[derive(Clone, Debug)]
pub(super) struct Lines {
    line_log2: u32,
    lookups_per_bank: u32,
    /// Lines of each bank.
    banks: Vec<u32>,
    /// The lines, in the order of first touch.
    pub(super) lines: Vec<u64>,
}

impl Lines {
    pub(super) fn new(unit: &Unit) -> Lines {
        Lines {
            line_log2: unit.line_bytes.trailing_zeros(),
            lookups_per_bank: unit.lookups_per_bank,
            banks: vec![0; unit.cache_banks as usize],
            lines: Vec::new(),
        }
    }

    /// Collects the lines of fetch `index` of texels `first..first + count`. The cycles of the tags:
    /// those of the bank with most lines, at least one.
    pub(super) fn collect(&mut self, trace: &Trace, first: u64, count: u64, index: usize) -> u64 {
        self.lines.clear();
        let mut before = None;
        for texel in first..first + count {
            let Some(fetch) = trace.texel(texel as usize).get(index) else {
                continue;
            };
            // Neighbours mostly lie in the same cell.
            if before == Some(fetch) {
                continue;
            }
            before = Some(fetch);
            for address in fetch.addresses {
                let end = address + u64::from(fetch.cell_bytes.max(1)) - 1;
                for line in address >> self.line_log2..=end >> self.line_log2 {
                    if !self.lines.contains(&line) {
                        self.lines.push(line);
                    }
                }
            }
        }
        self.banks.fill(0);
        let banks = self.banks.len() as u64;
        for line in &self.lines {
            self.banks[(line % banks) as usize] += 1;
        }
        let most = self.banks.iter().copied().max().unwrap_or(0);
        u64::from(most.div_ceil(self.lookups_per_bank).max(1))
    }
}

/// Fetches that a group makes: the program's, or more if the trace holds more.
pub(super) fn fetches(cost: &Cost, trace: &Trace, first: u64, count: u64) -> u64 {
    let traced = (first..first + count).map(|texel| trace.texel(texel as usize).len() as u64);
    traced.fold(cost.lookup(), u64::max)
}

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
#[derive(Clone, Copy, Debug)]
struct Group {
    first: u64,
    count: u64,
    fetch: u64,
    fetches: u64,
    /// The next of the fetch's lines.
    line: usize,
    /// Start and end of the tags' cycles for the fetch.
    start: u64,
    end: u64,
    /// A miss register is free from here on.
    stalled_until: Option<u64>,
    /// The fetch has waited for a miss register.
    has_stalled: bool,
    /// The latest line so far.
    arrival: Arrival,
}

/// The tags, the miss registers and the group in front of them.
#[derive(Debug)]
pub(super) struct Lookup<'a> {
    cost: &'a Cost<'a>,
    trace: &'a Trace,
    tags: Tags,
    pub(super) memory: Memory,
    lines: Lines,
    pub(super) outcomes: Outcomes,
    /// Lines asked for, in order, where they are wanted.
    pub(super) missed: Option<Vec<u64>>,
    group: Option<Group>,
}

impl<'a> Lookup<'a> {
    pub(super) fn new(cost: &'a Cost<'a>, trace: &'a Trace) -> Lookup<'a> {
        Lookup {
            cost,
            trace,
            tags: Tags::new(cost.unit.cache_sets, cost.unit.cache_ways),
            memory: Memory::new(cost.unit),
            lines: Lines::new(cost.unit),
            outcomes: Outcomes::default(),
            missed: None,
            group: None,
        }
    }

    /// Whether no group is in front of the tags.
    pub(super) fn is_idle(&self) -> bool {
        self.group.is_none()
    }

    /// Takes a group.
    pub(super) fn start(&mut self, now: u64, group: u64) {
        let first = group * u64::from(self.cost.unit.coalesced_texels);
        let count = self.cost.texels_of_group(group);
        let fetches = fetches(self.cost, self.trace, first, count);
        let end = now + self.lines.collect(self.trace, first, count, 0);
        self.group = Some(Group {
            first,
            count,
            fetch: 0,
            fetches,
            line: 0,
            start: now,
            end,
            stalled_until: None,
            has_stalled: false,
            arrival: Arrival::default(),
        });
        self.issue(now);
    }

    /// Looks up the lines of the fetch from the next one on, until one finds no miss register.
    fn issue(&mut self, now: u64) {
        let Some(group) = self.group.as_mut() else {
            return;
        };
        group.stalled_until = None;
        self.memory.retire(now);
        while let Some(&line) = self.lines.lines.get(group.line) {
            let is_held = self.tags.touch(line);
            let arrival = match self.memory.pending(line) {
                Some(arrival) => {
                    self.outcomes.merges += 1;
                    Some(arrival)
                }
                None if is_held => {
                    self.outcomes.hits += 1;
                    None
                }
                None => match self.memory.request(line, now) {
                    Ok(arrival) => {
                        self.outcomes.misses += 1;
                        if let Some(missed) = self.missed.as_mut() {
                            missed.push(line);
                        }
                        Some(arrival)
                    }
                    Err(free) => {
                        group.stalled_until = Some(free);
                        group.has_stalled = true;
                        return;
                    }
                },
            };
            if !is_held {
                self.tags.install(line);
            }
            if let Some(arrival) = arrival
                && arrival.at > group.arrival.at
            {
                group.arrival = arrival;
            }
            group.line += 1;
        }
        if group.has_stalled {
            group.end = group.end.max(now + 1);
        }
    }

    /// What happens at the start of cycle `now`. The group's latest line once its fetches are done.
    pub(super) fn advance(&mut self, now: u64) -> Option<Arrival> {
        let group = self.group.as_mut()?;
        if let Some(free) = group.stalled_until {
            if free <= now {
                self.issue(now);
            }
            return None;
        }
        if group.end > now {
            return None;
        }
        group.fetch += 1;
        if group.fetch == group.fetches {
            let arrival = group.arrival;
            self.group = None;
            return Some(arrival);
        }
        let (first, count, fetch) = (group.first, group.count, group.fetch as usize);
        group.line = 0;
        group.start = now;
        group.has_stalled = false;
        group.end = now + self.lines.collect(self.trace, first, count, fetch);
        self.issue(now);
        None
    }

    /// What cycle `now` is spent on, of the group in front of the tags.
    pub(super) fn cause(&self, now: u64) -> Option<Cause> {
        let group = self.group.as_ref()?;
        Some(if group.stalled_until.is_some() {
            Cause::MshrFull
        } else if now == group.start || group.has_stalled {
            Cause::Lookup
        } else {
            Cause::BankConflict
        })
    }

    /// The cycles at which the cause may change or something may happen.
    pub(super) fn events(&self) -> [u64; 2] {
        self.group
            .map_or([0; 2], |group| match group.stalled_until {
                Some(free) => [free, free],
                None => [group.start + 1, group.end],
            })
    }
}
