//! Cut: which cycles of a run a file shows.

use ntmu_model::time::watch::Interval;
use serde::Serialize;

/// The cycles `from..to` of a run. What began before or ends after is cut at the edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Window {
    /// The first cycle.
    pub from: u64,
    /// The cycle after the last.
    pub to: u64,
}

impl Window {
    /// The whole run, however long.
    pub const ALL: Window = Window {
        from: 0,
        to: u64::MAX,
    };
}

/// The first million cycles.
impl Default for Window {
    fn default() -> Window {
        Window {
            from: 0,
            to: 1_000_000,
        }
    }
}

/// What a file shows of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Summary {
    /// Cycles of the run.
    pub cycles: u64,
    /// The first cycle in the file.
    pub from: u64,
    /// The cycle after the last one in the file.
    pub to: u64,
    /// Intervals, levels, charges and misses that the file shows, whole or cut.
    pub shown: u64,
    /// Those that lie outside the window.
    pub left_out: u64,
}

/// Cuts what a run shows to a window, and counts.
#[derive(Debug)]
pub(super) struct Cut {
    pub(super) window: Window,
    cycles: u64,
    shown: u64,
    left_out: u64,
}

impl Cut {
    pub(super) fn new(window: Window) -> Cut {
        Cut {
            window,
            cycles: 0,
            shown: 0,
            left_out: 0,
        }
    }

    fn count(&mut self, is_shown: bool) {
        if is_shown {
            self.shown += 1;
        } else {
            self.left_out += 1;
        }
    }

    /// The cycles of `start..end` in the window, if there are any.
    fn range(&mut self, start: u64, end: u64) -> Option<(u64, u64)> {
        if start == end {
            return None;
        }
        let (start, end) = (start.max(self.window.from), end.min(self.window.to));
        self.count(start < end);
        (start < end).then_some((start, end))
    }

    /// The interval's part in the window, if it holds a cycle.
    pub(super) fn interval(&mut self, interval: Interval) -> Option<Interval> {
        let (start, end) = self.range(interval.start, interval.end)?;
        Some(Interval {
            start,
            end,
            ..interval
        })
    }

    /// The charge's part in the window, if it holds a cycle. The run is at least as long.
    pub(super) fn charge(&mut self, start: u64, end: u64) -> Option<(u64, u64)> {
        self.run_until(end);
        self.range(start, end)
    }

    /// The run is at least as long.
    pub(super) fn run_until(&mut self, end: u64) {
        self.cycles = self.cycles.max(end);
    }

    /// From when on the window shows a level: an earlier one holds at its start.
    pub(super) fn level(&mut self, at: u64) -> Option<u64> {
        self.count(at < self.window.to);
        (at < self.window.to).then_some(at.max(self.window.from))
    }

    /// Whether what happens in the cycle is shown.
    pub(super) fn holds(&mut self, at: u64) -> bool {
        let is_shown = (self.window.from..self.window.to).contains(&at);
        self.count(is_shown);
        is_shown
    }

    pub(super) fn summary(&self) -> Summary {
        let Window { from, to } = self.window;
        let from = from.min(self.cycles);
        Summary {
            cycles: self.cycles,
            from,
            to: to.min(self.cycles).max(from),
            shown: self.shown,
            left_out: self.left_out,
        }
    }
}
