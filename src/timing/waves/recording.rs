//! Recording: what a run showed in a window, put into the order of cycles.
//!
//! Intervals are reported when they end, and one may be as long as the run; so nothing can be
//! written in order before the run is over, and all of the window is kept. An interval takes 80
//! bytes, another change 24; memory that grows or is sorted takes up to twice as much.

use super::cut::{Cut, Window};
use ntmu_model::time::watch::{Interval, Signal};
use ntmu_model::time::{Cause, Watch};

/// Something that is different from a cycle on.
#[derive(Clone, Copy, Debug)]
pub(super) enum Change {
    /// The interval of this index is over.
    Leave(usize),
    /// The interval of this index begins.
    Enter(usize),
    /// A signal's value.
    Level(Signal, u64),
    /// What the cycles are charged to; nothing behind the window.
    Charge(Option<Cause>),
}

/// A watch that keeps everything in its window.
#[derive(Debug)]
pub(super) struct Recording {
    pub(super) cut: Cut,
    pub(super) intervals: Vec<Interval>,
    changes: Vec<(u64, Change)>,
    charged: Option<Cause>,
}

impl Recording {
    pub(super) fn new(window: Window) -> Recording {
        Recording {
            cut: Cut::new(window),
            intervals: Vec::new(),
            changes: Vec::new(),
            charged: None,
        }
    }

    /// All changes in the order of cycles. In one cycle what leaves comes before what enters, and
    /// levels of a signal stay in the order in which they came.
    pub(super) fn take_changes(&mut self) -> Vec<(u64, Change)> {
        let mut changes = std::mem::take(&mut self.changes);
        changes.reserve(2 * self.intervals.len() + 1);
        for (index, interval) in self.intervals.iter().enumerate() {
            changes.push((interval.start, Change::Enter(index)));
            changes.push((interval.end, Change::Leave(index)));
        }
        changes.push((self.cut.summary().to, Change::Charge(None)));
        changes.sort_by_key(|&(at, change)| {
            let rank = match change {
                Change::Leave(_) => 0,
                Change::Enter(_) => 1,
                Change::Level(..) => 2,
                Change::Charge(_) => 3,
            };
            (at, rank)
        });
        changes
    }
}

impl Watch for Recording {
    fn interval(&mut self, interval: Interval) {
        if let Some(interval) = self.cut.interval(interval) {
            self.intervals.push(interval);
        }
    }

    fn charge(&mut self, cause: Cause, start: u64, end: u64) {
        if let Some((start, _)) = self.cut.charge(start, end)
            && self.charged != Some(cause)
        {
            self.charged = Some(cause);
            self.changes.push((start, Change::Charge(Some(cause))));
        }
    }

    fn level(&mut self, signal: Signal, at: u64, value: u64) {
        if let Some(at) = self.cut.level(at) {
            self.changes.push((at, Change::Level(signal, value)));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sizes_are_those_that_the_documentation_gives() {
        let change = size_of::<(u64, Change)>();
        assert_eq!(change, 24);
        assert_eq!(size_of::<Interval>() + 2 * change, 80);
    }
}
