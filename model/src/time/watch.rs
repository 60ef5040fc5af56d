//! Watch: what a run makes visible while it runs, for waveforms, timelines and pictures.
//!
//! A run is the same whoever watches. Times are cycles from the start of the run.

use super::ledger::Cause;

/// Where something was held for a while.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Stage {
    /// A group's requests come in.
    Request,
    /// A group at the address generators.
    Address,
    /// A group at the tags.
    Lookup,
    /// A group in the corner FIFO, from its tags until it is read.
    Corners,
    /// A group is unpacked, interpolated and embedded.
    Embed,
    /// A job's weights come from outside; the first material's before the first request, for job 0.
    WeightFill,
    /// A job waits for the array, from its last group until it starts.
    JobWait,
    /// A layer of a batch in the array; the part is layer · 256 + batch.
    Dense,
    /// The same layer's accumulators at the requantisers, to the last activation.
    Requantize,
    /// A job at the filter, until the output queue has room.
    Filter,
    /// A job in the output queue, from the filter until its channels start to leave.
    OutputWait,
    /// A job's channels leave the unit.
    Output,
}

impl Stage {
    /// Every stage, in the order of the texel's journey.
    pub const ALL: [Stage; 12] = [
        Stage::Request,
        Stage::Address,
        Stage::Lookup,
        Stage::Corners,
        Stage::Embed,
        Stage::WeightFill,
        Stage::JobWait,
        Stage::Dense,
        Stage::Requantize,
        Stage::Filter,
        Stage::OutputWait,
        Stage::Output,
    ];

    /// The name in traces.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Stage::Request => "request",
            Stage::Address => "address",
            Stage::Lookup => "lookup",
            Stage::Corners => "corners",
            Stage::Embed => "embed",
            Stage::WeightFill => "weight-fill",
            Stage::JobWait => "job-wait",
            Stage::Dense => "dense",
            Stage::Requantize => "requantize",
            Stage::Filter => "filter",
            Stage::OutputWait => "output-wait",
            Stage::Output => "output",
        }
    }

    /// Whether its things are groups; the others are jobs.
    #[must_use]
    pub const fn is_front(self) -> bool {
        match self {
            Stage::Request | Stage::Address | Stage::Lookup | Stage::Corners | Stage::Embed => true,
            Stage::WeightFill
            | Stage::JobWait
            | Stage::Dense
            | Stage::Requantize
            | Stage::Filter
            | Stage::OutputWait
            | Stage::Output => false,
        }
    }
}

/// A thing in a stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Interval {
    /// The stage.
    pub stage: Stage,
    /// The group's number, or the job's, from 0.
    pub number: u64,
    /// The part of it; see [`Stage::Dense`]. 0 elsewhere.
    pub part: u32,
    /// The first cycle.
    pub start: u64,
    /// The cycle after the last.
    pub end: u64,
}

/// A number on a wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Signal {
    /// Groups in the request queue.
    RequestQueue,
    /// Groups in the corner FIFO.
    CornerFifo,
    /// Lines under way.
    MissRegisters,
    /// Jobs whose inputs are held, open or waiting for the array.
    HeldJobs,
    /// Pixels in the output queue.
    OutputQueue,
}

impl Signal {
    /// Every signal.
    pub const ALL: [Signal; 5] = [
        Signal::RequestQueue,
        Signal::CornerFifo,
        Signal::MissRegisters,
        Signal::HeldJobs,
        Signal::OutputQueue,
    ];

    /// The name in traces.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Signal::RequestQueue => "request_queue_groups",
            Signal::CornerFifo => "corner_fifo_groups",
            Signal::MissRegisters => "miss_registers_lines",
            Signal::HeldJobs => "held_jobs",
            Signal::OutputQueue => "output_queue_pixels",
        }
    }
}

/// Whoever watches a run. Everything is ignored unless it is overridden.
pub trait Watch {
    /// Something was in a stage. Called when it leaves or, where that is known before, earlier:
    /// neither starts nor ends are in order, and an interval may be empty.
    fn interval(&mut self, interval: Interval) {
        let _ = interval;
    }

    /// The ledger charged the cycles `start..end` to a cause; without gaps, in order. There may be
    /// none, and the same cause may follow itself.
    fn charge(&mut self, cause: Cause, start: u64, end: u64) {
        let _ = (cause, start, end);
    }

    /// A signal has this value from cycle `at` on; it had 0 before the first. Cycles do not go back
    /// within a signal, and of several values in one cycle the last one holds. Across signals they may:
    /// lines that came are seen when the tags next look.
    fn level(&mut self, signal: Signal, at: u64, value: u64) {
        let _ = (signal, at, value);
    }

    /// A group of this pixel (its first) looked up lines: so many, and so many of them missed.
    fn lookup(&mut self, pixel: [u32; 2], lines: u32, misses: u32) {
        let _ = (pixel, lines, misses);
    }

    /// The unit asked memory for the line that starts at this byte address.
    fn miss(&mut self, at: u64, address: u64) {
        let _ = (at, address);
    }
}

/// Nobody.
impl Watch for () {}

/// Both, the first one first.
impl<A: Watch, B: Watch> Watch for (A, B) {
    fn interval(&mut self, interval: Interval) {
        self.0.interval(interval);
        self.1.interval(interval);
    }

    fn charge(&mut self, cause: Cause, start: u64, end: u64) {
        self.0.charge(cause, start, end);
        self.1.charge(cause, start, end);
    }

    fn level(&mut self, signal: Signal, at: u64, value: u64) {
        self.0.level(signal, at, value);
        self.1.level(signal, at, value);
    }

    fn lookup(&mut self, pixel: [u32; 2], lines: u32, misses: u32) {
        self.0.lookup(pixel, lines, misses);
        self.1.lookup(pixel, lines, misses);
    }

    fn miss(&mut self, at: u64, address: u64) {
        self.0.miss(at, address);
        self.1.miss(at, address);
    }
}

/// Whoever is there.
impl<W: Watch> Watch for Option<W> {
    fn interval(&mut self, interval: Interval) {
        if let Some(watch) = self {
            watch.interval(interval);
        }
    }

    fn charge(&mut self, cause: Cause, start: u64, end: u64) {
        if let Some(watch) = self {
            watch.charge(cause, start, end);
        }
    }

    fn level(&mut self, signal: Signal, at: u64, value: u64) {
        if let Some(watch) = self {
            watch.level(signal, at, value);
        }
    }

    fn lookup(&mut self, pixel: [u32; 2], lines: u32, misses: u32) {
        if let Some(watch) = self {
            watch.lookup(pixel, lines, misses);
        }
    }

    fn miss(&mut self, at: u64, address: u64) {
        if let Some(watch) = self {
            watch.miss(at, address);
        }
    }
}
