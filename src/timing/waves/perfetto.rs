//! Perfetto: the trace event format of Chrome, in its JSON object form, for ui.perfetto.dev.

use super::cut::{Cut, Summary, Window};
use super::sink::Sink;
use super::{label, layer_and_batch};
use ntmu_model::time::watch::{Interval, Signal, Stage};
use ntmu_model::time::{Cause, Unit, Watch};
use serde::Serialize;
use std::collections::BTreeSet;
use std::io::{self, Write};

/// A watch that writes events as they happen; a cycle is a microsecond.
///
/// A track for the ledger, one for each stage, and a counter for each signal. Where a stage holds
/// more than one thing, each further one is on a track of its own behind it: `corners`,
/// `corners +1`, … Nothing is kept but the ends of the tracks.
#[derive(Debug)]
pub struct Perfetto<W: Write> {
    sink: Sink<W>,
    cut: Cut,
    identity: String,
    clock_mhz: u32,
    is_first: bool,
    lanes: [Lanes; Stage::ALL.len()],
    /// The charge that may go on.
    charged: Option<(Cause, u64, u64)>,
    levels: [Level; Signal::ALL.len()],
}

/// The tracks of a stage: end of what is on each, and its number.
#[derive(Debug, Default)]
struct Lanes(BTreeSet<(u64, u32)>);

impl Lanes {
    /// A track that is free from `start` on, the one that has been free for the shortest time.
    fn take(&mut self, start: u64, end: u64) -> u32 {
        let free = self.0.range(..=(start, u32::MAX)).next_back().copied();
        let lane = free.map_or(self.0.len() as u32, |(_, lane)| lane);
        if let Some(free) = free {
            self.0.remove(&free);
        }
        self.0.insert((end, lane));
        lane
    }
}

/// A signal's value and since when it has it; the one before it, which has been written.
#[derive(Clone, Copy, Debug)]
struct Level {
    at: u64,
    value: u64,
    written: Option<u64>,
}

/// The only process.
const PROCESS: u32 = 1;
/// The ledger's track.
const LEDGER: u64 = 1;

/// A track of a stage, in the order of the texel's journey. Perfetto has 32 bits for it, and order 31;
/// a stage holds at most 2^20 groups.
fn track(stage: Stage, lane: u32) -> u64 {
    (stage as u64 + 1) << 21 | u64::from(lane)
}

/// One event; times are microseconds.
#[derive(Serialize)]
struct Event<'a, A: Serialize> {
    name: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    cat: Option<&'a str>,
    ph: &'static str,
    ts: u64,
    #[serde(skip_serializing_if = "Option::is_none")]
    dur: Option<u64>,
    pid: u32,
    tid: u64,
    args: A,
}

#[derive(Serialize)]
struct Held {
    number: u64,
    #[serde(skip_serializing_if = "Option::is_none")]
    layer: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    batch: Option<u32>,
}

#[derive(Serialize)]
struct Nothing {}

#[derive(Serialize)]
struct Value {
    value: u64,
}

#[derive(Serialize)]
struct Name<'a> {
    name: &'a str,
}

#[derive(Serialize)]
struct SortIndex {
    sort_index: u64,
}

/// What the file says of itself.
#[derive(Serialize)]
struct About<'a> {
    unit: &'a str,
    clock_mhz: u32,
    microsecond: &'static str,
    cycles: u64,
    from: u64,
    to: u64,
}

impl<W: Write> Perfetto<W> {
    /// A trace of a unit's run.
    pub fn new(writer: W, unit: &Unit, window: Window) -> Perfetto<W> {
        let level = Level {
            at: window.from,
            value: 0,
            written: None,
        };
        let mut perfetto = Perfetto {
            sink: Sink::new(writer),
            cut: Cut::new(window),
            identity: unit.identity(),
            clock_mhz: unit.clock_mhz,
            is_first: true,
            lanes: Default::default(),
            charged: None,
            levels: [level; Signal::ALL.len()],
        };
        perfetto
            .sink
            .write(|out| write!(out, "{{\"traceEvents\":["));
        perfetto
    }

    /// Writes what is still held, and the tracks' names.
    ///
    /// # Errors
    /// When the writer has failed, its first error.
    pub fn finish(mut self) -> io::Result<Summary> {
        self.write_charge();
        let summary = self.cut.summary();
        for signal in Signal::ALL {
            self.write_level(signal);
        }
        self.name("process_name", LEDGER, &self.identity.clone());
        self.name("thread_name", LEDGER, "ledger");
        self.sort(LEDGER, 0);
        for stage in Stage::ALL {
            let mut lanes = self.lanes[stage as usize].0.len() as u32;
            // A stage that nothing passed is shown too.
            lanes = lanes.max(1);
            for lane in 0..lanes {
                let name = match lane {
                    0 => stage.name().to_owned(),
                    _ => format!("{} +{lane}", stage.name()),
                };
                let track = track(stage, lane);
                self.name("thread_name", track, &name);
                self.sort(track, track);
            }
        }
        let about = About {
            unit: &self.identity,
            clock_mhz: self.clock_mhz,
            microsecond: "one cycle of the unit",
            cycles: summary.cycles,
            from: summary.from,
            to: summary.to,
        };
        self.sink.write(|out| {
            write!(out, "\n],\"displayTimeUnit\":\"ms\",\"otherData\":")?;
            serde_json::to_writer(&mut *out, &about)?;
            writeln!(out, "}}")
        });
        self.sink.finish()?;
        Ok(summary)
    }

    fn event<A: Serialize>(&mut self, event: &Event<'_, A>) {
        let separator = if self.is_first { "\n" } else { ",\n" };
        self.is_first = false;
        self.sink.write(|out| {
            out.write_all(separator.as_bytes())?;
            Ok(serde_json::to_writer(&mut *out, event)?)
        });
    }

    fn metadata(&mut self, name: &str, tid: u64, args: impl Serialize) {
        self.event(&Event {
            name,
            cat: None,
            ph: "M",
            ts: 0,
            dur: None,
            pid: PROCESS,
            tid,
            args,
        });
    }

    fn name(&mut self, what: &str, tid: u64, name: &str) {
        self.metadata(what, tid, Name { name });
    }

    fn sort(&mut self, tid: u64, sort_index: u64) {
        self.metadata("thread_sort_index", tid, SortIndex { sort_index });
    }

    /// Writes the charge that does not go on.
    fn write_charge(&mut self) {
        if let Some((cause, start, end)) = self.charged.take() {
            self.event(&Event {
                name: cause.name(),
                cat: Some("ledger"),
                ph: "X",
                ts: start,
                dur: Some(end - start),
                pid: PROCESS,
                tid: LEDGER,
                args: Nothing {},
            });
        }
    }

    /// Writes a signal's value, if it differs from the one before it.
    fn write_level(&mut self, signal: Signal) {
        let level = &mut self.levels[signal as usize];
        let Level { at, value, .. } = *level;
        if level.written.replace(value) != Some(value) {
            self.event(&Event {
                name: signal.name(),
                cat: None,
                ph: "C",
                ts: at,
                dur: None,
                pid: PROCESS,
                tid: LEDGER,
                args: Value { value },
            });
        }
    }
}

impl<W: Write> Watch for Perfetto<W> {
    fn interval(&mut self, interval: Interval) {
        let Some(interval) = self.cut.interval(interval) else {
            return;
        };
        let Interval {
            stage,
            number,
            start,
            end,
            ..
        } = interval;
        let lane = self.lanes[stage as usize].take(start, end);
        let parts = layer_and_batch(&interval);
        self.event(&Event {
            name: &label(&interval),
            cat: Some(stage.name()),
            ph: "X",
            ts: start,
            dur: Some(end - start),
            pid: PROCESS,
            tid: track(stage, lane),
            args: Held {
                number,
                layer: parts.map(|parts| parts.0),
                batch: parts.map(|parts| parts.1),
            },
        });
    }

    fn charge(&mut self, cause: Cause, start: u64, end: u64) {
        let Some((start, end)) = self.cut.charge(start, end) else {
            return;
        };
        match self.charged.as_mut() {
            Some(charged) if charged.0 == cause => charged.2 = end,
            Some(_) | None => {
                self.write_charge();
                self.charged = Some((cause, start, end));
            }
        }
    }

    fn level(&mut self, signal: Signal, at: u64, value: u64) {
        let Some(at) = self.cut.level(at) else {
            return;
        };
        if self.levels[signal as usize].at < at {
            self.write_level(signal);
        }
        let level = &mut self.levels[signal as usize];
        (level.at, level.value) = (at, value);
    }
}
