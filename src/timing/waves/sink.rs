//! Sink: a writer that remembers its first error.

use std::io::{self, BufWriter, Write};

/// A buffered writer for those who cannot return an error when it happens.
#[derive(Debug)]
pub(super) struct Sink<W: Write> {
    writer: BufWriter<W>,
    error: Option<io::Error>,
}

impl<W: Write> Sink<W> {
    pub(super) fn new(writer: W) -> Sink<W> {
        Sink {
            writer: BufWriter::new(writer),
            error: None,
        }
    }

    /// Writes, unless something has failed before.
    pub(super) fn write(&mut self, write: impl FnOnce(&mut BufWriter<W>) -> io::Result<()>) {
        if self.error.is_none()
            && let Err(error) = write(&mut self.writer)
        {
            self.error = Some(error);
        }
    }

    /// Writes what is still held.
    ///
    /// # Errors
    /// The first one.
    pub(super) fn finish(mut self) -> io::Result<()> {
        self.write(Write::flush);
        match self.error {
            None => Ok(()),
            Some(error) => {
                // Dropping the buffer would write it once more.
                drop(self.writer.into_parts());
                Err(error)
            }
        }
    }
}
