//! Vcd: a value change dump (IEEE Std 1364-2005, clause 18) for GTKWave and Surfer.

use super::cut::{Summary, Window};
use super::layer_and_batch;
use super::recording::{Change, Recording};
use super::sink::Sink;
use ::vcd::{IdCode, SimulationCommand, TimescaleUnit, Value, VarType, Writer};
use ntmu_model::time::watch::{Interval, Signal, Stage};
use ntmu_model::time::{Cause, Unit, Watch};
use std::collections::BTreeSet;
use std::io::{self, Write};

/// What a time of the file means.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum VcdTime {
    /// Times are cycles. A viewer calls them nanoseconds, because the format has no cycles.
    #[default]
    Cycles,
    /// Times are femtoseconds at the unit's clock; a cycle starts at cycle · 10^9 / MHz, rounded
    /// down.
    Seconds,
}

impl VcdTime {
    /// What the file calls a time, and how it explains it.
    fn timescale(self) -> (TimescaleUnit, &'static str) {
        match self {
            VcdTime::Cycles => (TimescaleUnit::NS, "A unit of time is a cycle"),
            VcdTime::Seconds => (TimescaleUnit::FS, "A unit of time is a femtosecond"),
        }
    }

    /// The time at which a cycle starts.
    fn of(self, cycle: u64, clock_mhz: u32) -> u64 {
        match self {
            VcdTime::Cycles => cycle,
            VcdTime::Seconds => {
                let femtoseconds = u128::from(cycle) * 1_000_000_000 / u128::from(clock_mhz);
                u64::try_from(femtoseconds).unwrap_or(u64::MAX)
            }
        }
    }
}

/// A watch that makes a value change dump.
///
/// Wires for each stage: `busy`; `number`, the group or job that has been there longest, `x` if none;
/// and in the array and at the requantisers the `layer` and the `batch`. A vector for each signal.
/// The ledger's cause as a string and as a number, its place in [`Cause::ALL`].
///
/// Everything in the window is kept until the end: 80 bytes an interval, 24 another change, and at most
/// twice that while it grows and is sorted.
#[derive(Debug)]
pub struct Vcd<W: Write> {
    sink: Sink<W>,
    head: Head,
    recording: Recording,
}

/// What the header says.
#[derive(Debug)]
struct Head {
    identity: String,
    clock_mhz: u32,
    time: VcdTime,
}

impl<W: Write> Vcd<W> {
    /// A dump of a unit's run. Nothing is written before [`Vcd::finish`].
    pub fn new(writer: W, unit: &Unit, window: Window, time: VcdTime) -> Vcd<W> {
        Vcd {
            sink: Sink::new(writer),
            head: Head {
                identity: unit.identity(),
                clock_mhz: unit.clock_mhz,
                time,
            },
            recording: Recording::new(window),
        }
    }

    /// Writes the file.
    ///
    /// # Errors
    /// When the writer fails.
    pub fn finish(mut self) -> io::Result<Summary> {
        let changes = self.recording.take_changes();
        let summary = self.recording.cut.summary();
        let intervals = &self.recording.intervals;
        self.sink.write(|out| {
            let mut writer = Writer::new(out);
            self.head.write(&mut writer)?;
            write_changes(&mut writer, &self.head, summary, &changes, intervals)
        });
        self.sink.finish()?;
        Ok(summary)
    }
}

impl Head {
    fn write<O: Write>(&self, writer: &mut Writer<O>) -> io::Result<()> {
        let (timescale, meaning) = self.time.timescale();
        writer.version(concat!("ntmu ", env!("CARGO_PKG_VERSION")))?;
        // A dollar sign could end the comment.
        let identity = self.identity.replace('$', "_");
        let clock = self.clock_mhz;
        writer.comment(&format!(
            "{meaning}; the clock is {clock} MHz. Unit: {identity}"
        ))?;
        writer.timescale(1, timescale)
    }
}

/// Writes the variables, their values at the start of the window, and every change.
fn write_changes<O: Write>(
    writer: &mut Writer<O>,
    head: &Head,
    summary: Summary,
    changes: &[(u64, Change)],
    intervals: &[Interval],
) -> io::Result<()> {
    let stamp = |cycle| head.time.of(cycle, head.clock_mhz);
    let wires = Wires::define(writer)?;
    let mut values = Values::default();
    let mut shown: Option<Vec<Shown>> = None;
    for changes in changes.chunk_by(|a, b| a.0 == b.0) {
        let at = changes[0].0;
        if shown.is_none() && at > summary.from {
            writer.timestamp(stamp(summary.from))?;
            shown = Some(wires.dump(writer, &values)?);
        }
        for (_, change) in changes {
            values.apply(change, intervals);
        }
        // What the window cuts does not end with it; a window behind the run holds nothing.
        let is_cut = at == summary.to && summary.to < summary.cycles;
        if is_cut || at > summary.to {
            break;
        }
        if let Some(shown) = shown.as_mut() {
            wires.update(writer, stamp(at), &values, shown)?;
        }
    }
    if shown.is_none() {
        writer.timestamp(stamp(summary.from))?;
        wires.dump(writer, &values)?;
    }
    writer.timestamp(stamp(summary.to))
}

impl<W: Write> Watch for Vcd<W> {
    fn interval(&mut self, interval: Interval) {
        self.recording.interval(interval);
    }

    fn charge(&mut self, cause: Cause, start: u64, end: u64) {
        self.recording.charge(cause, start, end);
    }

    fn level(&mut self, signal: Signal, at: u64, value: u64) {
        self.recording.level(signal, at, value);
    }
}

/// The state of the unit in a cycle.
#[derive(Debug, Default)]
struct Values {
    /// For each stage what is there, by start, number and part.
    held: [BTreeSet<(u64, u64, u32)>; Stage::ALL.len()],
    levels: [u64; Signal::ALL.len()],
    cause: Option<Cause>,
}

impl Values {
    fn apply(&mut self, change: &Change, intervals: &[Interval]) {
        let key = |interval: &Interval| (interval.start, interval.number, interval.part);
        match *change {
            Change::Leave(index) => {
                let interval = &intervals[index];
                self.held[interval.stage as usize].remove(&key(interval));
            }
            Change::Enter(index) => {
                let interval = &intervals[index];
                self.held[interval.stage as usize].insert(key(interval));
            }
            Change::Level(signal, value) => self.levels[signal as usize] = value,
            Change::Charge(cause) => self.cause = cause,
        }
    }

    fn of(&self, source: Source) -> Shown {
        let first = |stage: Stage| self.held[stage as usize].first();
        let part = |stage: Stage, of: fn((u32, u32)) -> u32| {
            let &(start, number, part) = first(stage)?;
            let interval = Interval {
                stage,
                number,
                part,
                start,
                end: start,
            };
            layer_and_batch(&interval).map(|parts| u64::from(of(parts)))
        };
        match source {
            Source::Busy(stage) => Shown::Bit(first(stage).is_some()),
            Source::Number(stage) => Shown::Vector(first(stage).map(|held| held.1)),
            Source::Layer(stage) => Shown::Vector(part(stage, |parts| parts.0)),
            Source::Batch(stage) => Shown::Vector(part(stage, |parts| parts.1)),
            Source::Level(signal) => Shown::Vector(Some(self.levels[signal as usize])),
            Source::Cause => Shown::Text(self.cause.map_or("none", Cause::name)),
            Source::CauseCode => Shown::Vector(self.cause.map(|cause| cause as u64)),
        }
    }
}

/// What a variable shows.
#[derive(Clone, Copy, Debug)]
enum Source {
    Busy(Stage),
    Number(Stage),
    Layer(Stage),
    Batch(Stage),
    Level(Signal),
    Cause,
    CauseCode,
}

/// A variable's value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Shown {
    Bit(bool),
    /// Unknown where there is nothing to show.
    Vector(Option<u64>),
    Text(&'static str),
}

impl Shown {
    fn write<W: Write>(self, writer: &mut Writer<W>, code: IdCode) -> io::Result<()> {
        match self {
            Shown::Bit(bit) => writer.change_scalar(code, bit),
            Shown::Vector(None) => writer.change_vector(code, [Value::X]),
            Shown::Vector(Some(value)) => {
                let digits = (u64::BITS - value.leading_zeros()).max(1);
                let bits = (0..digits)
                    .rev()
                    .map(|bit| Value::from(value >> bit & 1 == 1));
                writer.change_vector(code, bits)
            }
            Shown::Text(text) => writer.change_string(code, text),
        }
    }
}

/// The variables of the file.
#[derive(Debug)]
struct Wires(Vec<(IdCode, Source)>);

impl Wires {
    fn define<W: Write>(writer: &mut Writer<W>) -> io::Result<Wires> {
        let mut wires = Vec::new();
        writer.add_module("unit")?;
        writer.add_module("ledger")?;
        let codes = Cause::ALL.map(|cause| format!("{} {}", cause as u64, cause.name()));
        writer.comment(&format!("cause_code: {}", codes.join(", ")))?;
        let cause = writer.add_var(VarType::String, 1, "cause", None)?;
        wires.push((cause, Source::Cause));
        wires.push((writer.add_wire(8, "cause_code")?, Source::CauseCode));
        writer.upscope()?;
        writer.add_module("signals")?;
        for signal in Signal::ALL {
            wires.push((writer.add_wire(32, signal.name())?, Source::Level(signal)));
        }
        writer.upscope()?;
        for stage in Stage::ALL {
            writer.add_module(&stage.name().replace('-', "_"))?;
            wires.push((writer.add_wire(1, "busy")?, Source::Busy(stage)));
            wires.push((writer.add_wire(64, "number")?, Source::Number(stage)));
            if matches!(stage, Stage::Dense | Stage::Requantize) {
                wires.push((writer.add_wire(24, "layer")?, Source::Layer(stage)));
                wires.push((writer.add_wire(8, "batch")?, Source::Batch(stage)));
            }
            writer.upscope()?;
        }
        writer.upscope()?;
        writer.enddefinitions()?;
        Ok(Wires(wires))
    }

    /// Writes every value.
    fn dump<W: Write>(&self, writer: &mut Writer<W>, values: &Values) -> io::Result<Vec<Shown>> {
        writer.begin(SimulationCommand::Dumpvars)?;
        let mut all = Vec::with_capacity(self.0.len());
        for &(code, source) in &self.0 {
            let value = values.of(source);
            value.write(writer, code)?;
            all.push(value);
        }
        writer.end()?;
        Ok(all)
    }

    /// Writes the values that differ from those shown.
    fn update<W: Write>(
        &self,
        writer: &mut Writer<W>,
        stamp: u64,
        values: &Values,
        shown: &mut [Shown],
    ) -> io::Result<()> {
        let mut is_stamped = false;
        for (&(code, source), shown) in self.0.iter().zip(shown) {
            let value = values.of(source);
            if value != *shown {
                if !is_stamped {
                    writer.timestamp(stamp)?;
                    is_stamped = true;
                }
                value.write(writer, code)?;
                *shown = value;
            }
        }
        Ok(())
    }
}
