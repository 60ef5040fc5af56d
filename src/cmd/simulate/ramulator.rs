//! Misses as a trace for Ramulator 2: its load-store form, a line `LD 0x…` for each line asked of
//! memory, in order, by byte address. It has no times; Ramulator's own core model makes them.

use ntmu::model::time::Watch;
use std::io::{self, Write};

/// Writes the misses of the run that it watches.
pub(super) struct Ramulator<W> {
    writer: W,
    failed: Option<io::Error>,
}

impl<W: Write> Ramulator<W> {
    pub(super) fn new(writer: W) -> Ramulator<W> {
        Ramulator {
            writer,
            failed: None,
        }
    }

    /// Ends the file.
    ///
    /// # Errors
    /// The first error of the writer.
    pub(super) fn finish(mut self) -> io::Result<()> {
        match self.failed.take() {
            Some(error) => Err(error),
            None => self.writer.flush(),
        }
    }
}

impl<W: Write> Watch for Ramulator<W> {
    fn miss(&mut self, _at: u64, address: u64) {
        if self.failed.is_none() {
            self.failed = writeln!(self.writer, "LD {address:#x}").err();
        }
    }
}
