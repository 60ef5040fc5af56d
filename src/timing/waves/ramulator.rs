//! Ramulator: the lines asked of memory, as a trace for the DRAM simulator Ramulator 2
//! (Luo et al. 2023, arXiv:2308.11030).

use super::cut::{Cut, Summary, Window};
use super::sink::Sink;
use ntmu_model::time::{Cause, Unit, Watch};
use std::io::{self, Write};

/// Which of Ramulator 2's trace formats.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RamulatorFormat {
    /// For the front end `LoadStoreTrace`: `LD 0x1f40`. Accesses follow each other as fast as memory
    /// takes them.
    #[default]
    LoadStore,
    /// For the front end `SimpleO3`: `7 8000`, an address in decimal behind as many instructions
    /// without memory as cycles passed without a miss. With `ipc: 1` and the core at the unit's clock
    /// the accesses keep their distances, as far as the core's window and its cache let them.
    Instructions,
}

/// A watch that writes each access as it happens.
#[derive(Debug)]
pub struct Ramulator<W: Write> {
    sink: Sink<W>,
    format: RamulatorFormat,
    line_bytes: u64,
    access_bytes: u64,
    /// The cycle from which an instruction has to be accounted for.
    next: u64,
    cut: Cut,
}

/// The bubbles of a line of the trace are read as a C++ `int`.
const MOST_BUBBLES: u64 = i32::MAX as u64;

impl<W: Write> Ramulator<W> {
    /// A trace of the misses of a unit's run. A line is as many accesses of `access_bytes` as it
    /// holds: what the memory that is simulated moves for one, 64 for most, 32 for GDDR6. At least
    /// one byte.
    pub fn new(
        writer: W,
        unit: &Unit,
        window: Window,
        format: RamulatorFormat,
        access_bytes: u32,
    ) -> Ramulator<W> {
        Ramulator {
            sink: Sink::new(writer),
            format,
            line_bytes: u64::from(unit.line_bytes),
            access_bytes: u64::from(access_bytes.max(1)),
            next: window.from,
            cut: Cut::new(window),
        }
    }

    /// Writes what is still held.
    ///
    /// # Errors
    /// When the writer has failed, its first error.
    pub fn finish(self) -> io::Result<Summary> {
        self.sink.finish()?;
        Ok(self.cut.summary())
    }
}

impl<W: Write> Watch for Ramulator<W> {
    fn charge(&mut self, _cause: Cause, _start: u64, end: u64) {
        self.cut.run_until(end);
    }

    fn miss(&mut self, at: u64, address: u64) {
        if !self.cut.holds(at) {
            return;
        }
        for access in 0..self.line_bytes.div_ceil(self.access_bytes) {
            let address = address + access * self.access_bytes;
            match self.format {
                RamulatorFormat::LoadStore => {
                    self.sink.write(|out| writeln!(out, "LD {address:#x}"));
                }
                RamulatorFormat::Instructions => {
                    let bubbles = at.saturating_sub(self.next).min(MOST_BUBBLES);
                    self.sink.write(|out| writeln!(out, "{bubbles} {address}"));
                    self.next = self.next.max(at) + 1;
                }
            }
        }
    }
}
