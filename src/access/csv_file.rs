//! Trace files as CSV.

use super::columns::{Column, Columns, Row};
use super::error::{AccessError, At};
use csv::{ByteRecord, ReaderBuilder, Trim};
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

/// The longest line that is read for certain; nine numbers need a hundredth of it.
const MAX_LINE: usize = 1 << 16;

/// A CSV file, read row by row.
pub(super) struct CsvRows {
    path: PathBuf,
    reader: csv::Reader<LineLimit<File>>,
    record: ByteRecord,
    rows: u64,
}

impl CsvRows {
    pub(super) fn open(path: &Path) -> Result<(CsvRows, Columns), AccessError> {
        let file = File::open(path).map_err(|source| AccessError::Io {
            path: path.to_owned(),
            source,
        })?;
        let limited = LineLimit {
            inner: file,
            since_line: 0,
        };
        let mut builder = ReaderBuilder::new();
        builder.flexible(true).trim(Trim::All);
        let mut rows = CsvRows {
            path: path.to_owned(),
            reader: builder.from_reader(limited),
            record: ByteRecord::new(),
            rows: 0,
        };
        let header = rows.reader.byte_headers().cloned();
        let header = header.map_err(|error| refused(path, error))?;
        let names: Result<Vec<&str>, AccessError> = header
            .iter()
            .map(|name| {
                std::str::from_utf8(name).map_err(|_| AccessError::NotText {
                    path: path.to_owned(),
                    at: At::Header,
                })
            })
            .collect();
        let columns = Columns::new(path, names?.into_iter())?;
        Ok((rows, columns))
    }

    /// Puts the next row in the place of `row`; false at the end.
    pub(super) fn read(&mut self, columns: &Columns, row: &mut Row) -> Result<bool, AccessError> {
        let is_there = self.reader.read_byte_record(&mut self.record);
        if !is_there.map_err(|error| refused(&self.path, error))? {
            return Ok(false);
        }
        self.rows += 1;
        row.at = At::Row(self.rows);
        if self.record.len() != columns.order.len() {
            return Err(AccessError::Fields {
                path: self.path.clone(),
                at: row.at,
                found: self.record.len(),
                allowed: columns.order.len(),
            });
        }
        for (&column, field) in columns.order.iter().zip(&self.record) {
            let Ok(text) = std::str::from_utf8(field) else {
                return Err(AccessError::NotText {
                    path: self.path.clone(),
                    at: row.at,
                });
            };
            let is_number = if column.is_whole() {
                text.parse().map(|n| row.set_whole(column, n)).is_ok()
            } else {
                text.parse().map(|n| row.set_real(column, n)).is_ok()
            };
            if !is_number {
                return Err(self.not_a_number(column, text, row.at));
            }
        }
        Ok(true)
    }

    fn not_a_number(&self, column: Column, found: &str, at: At) -> AccessError {
        let allowed = if column.is_whole() {
            "an integer"
        } else {
            "a number"
        };
        AccessError::Number {
            path: self.path.clone(),
            at,
            column,
            found: found.to_owned(),
            allowed,
        }
    }
}

#[allow(clippy::wildcard_enum_match_arm, reason = "the enum is not exhaustive")]
fn refused(path: &Path, error: csv::Error) -> AccessError {
    let path = path.to_owned();
    let source = match error.into_kind() {
        csv::ErrorKind::Io(source) => source,
        // The reader is told to allow rows of any length, and to leave fields as bytes.
        other => std::io::Error::other(format!("{other:?}")),
    };
    if source.get_ref().is_some_and(|e| e.is::<TooLong>()) {
        return AccessError::LineLength {
            path,
            allowed: MAX_LINE,
        };
    }
    AccessError::Io { path, source }
}

/// Refuses a line that is too long to be one before memory is filled with it.
struct LineLimit<R> {
    inner: R,
    /// Bytes after the last end of a line.
    since_line: usize,
}

#[derive(Debug, thiserror::Error)]
#[error("line too long")]
struct TooLong;

impl<R: Read> Read for LineLimit<R> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let count = self.inner.read(buffer)?;
        let is_end = |byte: &u8| *byte == b'\n' || *byte == b'\r';
        let read = &buffer[..count];
        self.since_line = match read.iter().rposition(is_end) {
            Some(end) => count - end - 1,
            None => self.since_line + count,
        };
        if self.since_line > MAX_LINE {
            return Err(std::io::Error::other(TooLong));
        }
        Ok(count)
    }
}
