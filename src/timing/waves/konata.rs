//! Konata: a log in the format Kanata 0004 for the pipeline viewer Konata
//! (`docs/kanata-log-format.md` of github.com/shioyadan/Konata).

use super::cut::{Summary, Window};
use super::recording::{Change, Recording};
use super::sink::Sink;
use super::{label, layer_and_batch};
use ntmu_model::time::watch::{Interval, Stage};
use ntmu_model::time::{Cause, Unit, Watch};
use std::collections::HashMap;
use std::io::{self, Write};

/// A watch that makes a pipeline diagram.
///
/// A row for each group, for each job, and for each layer of a batch, in the order in which they
/// come into the unit; they are the threads 0, 1 and 2 of the log.
///
/// | row | stages |
/// |---|---|
/// | group | Rq request, Ad address, Lk lookup, Co corners, Em embed |
/// | job | Wf weight-fill (lane 1), Jw job-wait, Fi filter, Ow output-wait, Ou output |
/// | layer of a batch | De dense, Rz requantize |
///
/// Everything in the window is kept until the end: 80 bytes an interval, 24 a change of the cause, a
/// row's state of some 50 bytes, and at most twice that while it grows and is sorted.
#[derive(Debug)]
pub struct Konata<W: Write> {
    sink: Sink<W>,
    identity: String,
    recording: Recording,
}

/// What a row is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Row {
    Group(u64),
    Job(u64),
    Layer(u64, u32),
}

impl Row {
    fn of(interval: &Interval) -> Row {
        if layer_and_batch(interval).is_some() {
            Row::Layer(interval.number, interval.part)
        } else if interval.stage.is_front() {
            Row::Group(interval.number)
        } else {
            Row::Job(interval.number)
        }
    }

    /// Its number, and its thread.
    fn simulated(self) -> (u64, u32) {
        match self {
            Row::Group(number) => (number, 0),
            Row::Job(number) => (number, 1),
            Row::Layer(number, _) => (number, 2),
        }
    }
}

/// Lane and name of a stage.
fn stage_name(stage: Stage) -> (u32, &'static str) {
    match stage {
        Stage::Request => (0, "Rq"),
        Stage::Address => (0, "Ad"),
        Stage::Lookup => (0, "Lk"),
        Stage::Corners => (0, "Co"),
        Stage::Embed => (0, "Em"),
        // Weights come while the job is still gathered, or waits.
        Stage::WeightFill => (1, "Wf"),
        Stage::JobWait => (0, "Jw"),
        Stage::Dense => (0, "De"),
        Stage::Requantize => (0, "Rz"),
        Stage::Filter => (0, "Fi"),
        Stage::OutputWait => (0, "Ow"),
        Stage::Output => (0, "Ou"),
    }
}

/// How far a row is written.
#[derive(Debug, Default)]
struct Written {
    /// Its number in the log, once it has begun.
    id: Option<u64>,
    /// Intervals that are still to end.
    left: u64,
}

impl<W: Write> Konata<W> {
    /// A log of a unit's run. Nothing is written before [`Konata::finish`].
    pub fn new(writer: W, unit: &Unit, window: Window) -> Konata<W> {
        Konata {
            sink: Sink::new(writer),
            identity: unit.identity(),
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
            let mut log = Log {
                out,
                cycle: summary.from,
                rows: HashMap::new(),
                begun: 0,
                retired: 0,
            };
            log.write(&changes, intervals, &self.identity)?;
            log.move_to(summary.to)
        });
        self.sink.finish()?;
        Ok(summary)
    }
}

impl<W: Write> Watch for Konata<W> {
    fn interval(&mut self, interval: Interval) {
        self.recording.interval(interval);
    }

    fn charge(&mut self, cause: Cause, start: u64, end: u64) {
        self.recording.charge(cause, start, end);
    }
}

/// The file while it is written.
#[derive(Debug)]
struct Log<O: Write> {
    out: O,
    cycle: u64,
    rows: HashMap<Row, Written>,
    begun: u64,
    retired: u64,
}

impl<O: Write> Log<O> {
    /// Writes the header and all rows.
    fn write(
        &mut self,
        changes: &[(u64, Change)],
        intervals: &[Interval],
        identity: &str,
    ) -> io::Result<()> {
        for interval in intervals {
            self.rows.entry(Row::of(interval)).or_default().left += 1;
        }
        write!(self.out, "Kanata\t0004\nC=\t{}\n", self.cycle)?;
        for &(at, change) in changes {
            match change {
                Change::Enter(index) => {
                    self.move_to(at)?;
                    self.enter(&intervals[index], identity)?;
                }
                Change::Leave(index) => {
                    self.move_to(at)?;
                    self.leave(&intervals[index])?;
                }
                Change::Level(..) | Change::Charge(_) => {}
            }
        }
        Ok(())
    }

    fn move_to(&mut self, cycle: u64) -> io::Result<()> {
        if cycle > self.cycle {
            writeln!(self.out, "C\t{}", cycle - self.cycle)?;
            self.cycle = cycle;
        }
        Ok(())
    }

    /// Starts a stage, and its row if that is new.
    fn enter(&mut self, interval: &Interval, identity: &str) -> io::Result<()> {
        let row = Row::of(interval);
        let out = &mut self.out;
        let written = self.rows.entry(row).or_default();
        let id = match written.id {
            Some(id) => id,
            None => {
                let id = self.begun;
                let (number, thread) = row.simulated();
                writeln!(out, "I\t{id}\t{number}\t{thread}")?;
                writeln!(out, "L\t{id}\t0\t{}", label(interval))?;
                writeln!(out, "L\t{id}\t1\tfrom cycle {}", interval.start)?;
                if id == 0 {
                    // The format has no other place for it. A name may hold anything.
                    let unit = identity.replace(char::is_control, " ");
                    writeln!(out, "L\t{id}\t1\t; unit {unit}")?;
                }
                self.begun += 1;
                written.id = Some(id);
                id
            }
        };
        let (lane, name) = stage_name(interval.stage);
        writeln!(out, "S\t{id}\t{lane}\t{name}")
    }

    /// Ends a stage, and its row if that was the last.
    fn leave(&mut self, interval: &Interval) -> io::Result<()> {
        let row = Row::of(interval);
        let out = &mut self.out;
        let written = self.rows.entry(row).or_default();
        let id = written.id.unwrap_or_default();
        written.left = written.left.saturating_sub(1);
        let (lane, name) = stage_name(interval.stage);
        writeln!(out, "E\t{id}\t{lane}\t{name}")?;
        if written.left == 0 {
            self.rows.remove(&row);
            writeln!(out, "R\t{id}\t{}\t0", self.retired)?;
            self.retired += 1;
        }
        Ok(())
    }
}
