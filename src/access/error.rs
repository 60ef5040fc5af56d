//! What can be wrong with a trace file.

use super::columns::{Column, Kind};
use std::fmt;
use std::ops::RangeInclusive;
use std::path::PathBuf;

/// Where in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum At {
    /// The names of the columns.
    Header,
    /// A row, from 1: neither the header nor empty lines are counted.
    Row(u64),
}

impl fmt::Display for At {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            At::Header => write!(f, "header"),
            At::Row(row) => write!(f, "row {row}"),
        }
    }
}

/// Why a trace file was refused: where, what was found, and what is allowed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum AccessError {
    /// The file system said no.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's answer.
        source: std::io::Error,
    },
    /// The name does not say what the file is.
    #[error("{}: allowed is a name that ends in .csv or .parquet", path.display())]
    Ending {
        /// The file.
        path: PathBuf,
    },
    /// There is a header, and nothing after it.
    #[error("{}: found no rows; allowed: one or more", path.display())]
    Empty {
        /// The file.
        path: PathBuf,
    },
    /// A column that is not known, or stands there twice.
    #[error("{}: found column `{found}`; allowed, each once: {}", path.display(), listed(&Column::ALL))]
    Column {
        /// The file.
        path: PathBuf,
        /// The name.
        found: String,
    },
    /// Columns that do not make a request.
    #[error("{}: found columns {}; allowed: {}", path.display(), listed(found), forms())]
    Header {
        /// The file.
        path: PathBuf,
        /// Those that are there.
        found: Vec<Column>,
    },
    /// A row with too few fields or too many.
    #[error("{}: {at}: found {found} fields; allowed: {allowed}, as in the header", path.display())]
    Fields {
        /// The file.
        path: PathBuf,
        /// The row.
        at: At,
        /// Fields of the row.
        found: usize,
        /// Fields of the header.
        allowed: usize,
    },
    /// A field, or the header, is not UTF-8.
    #[error("{}: {at}: found bytes that are not UTF-8; allowed: text in UTF-8", path.display())]
    NotText {
        /// The file.
        path: PathBuf,
        /// The row.
        at: At,
    },
    /// A line so long that it cannot be a trace's.
    #[error("{}: found a line of more than {allowed} bytes; allowed: {allowed}", path.display())]
    LineLength {
        /// The file.
        path: PathBuf,
        /// The most bytes.
        allowed: usize,
    },
    /// A field that is no number of its column's type.
    #[error("{}: {at}, column {}: found `{found}`; allowed: {allowed}", path.display(), column.name())]
    Number {
        /// The file.
        path: PathBuf,
        /// The row.
        at: At,
        /// The column.
        column: Column,
        /// The field.
        found: String,
        /// What may stand there.
        allowed: &'static str,
    },
    /// A material, mip, texel or pixel that does not exist.
    #[error(
        "{}: {at}, column {}: found {found}; allowed: {}..={}",
        path.display(), column.name(), allowed.start(), allowed.end()
    )]
    Range {
        /// The file.
        path: PathBuf,
        /// The row.
        at: At,
        /// The column.
        column: Column,
        /// The number.
        found: i128,
        /// The smallest and the largest.
        allowed: RangeInclusive<i128>,
    },
    /// NaN, an infinity, or a number beyond those of f32.
    #[error(
        "{}: {at}, column {}: found {found} as f32; allowed: finite numbers, at most {:e}",
        path.display(), column.name(), f32::MAX
    )]
    NotFinite {
        /// The file.
        path: PathBuf,
        /// The row.
        at: At,
        /// The column.
        column: Column,
        /// The number.
        found: f32,
    },
    /// The file is no Parquet file, or a damaged one.
    #[error("{}: cannot be read as Parquet: {found}", path.display())]
    Parquet {
        /// The file.
        path: PathBuf,
        /// The reader's words.
        found: String,
    },
    /// A column of a Parquet file has a type that its numbers cannot have.
    #[error("{}: column {}: found type {found}; allowed: {allowed}", path.display(), column.name())]
    ColumnType {
        /// The file.
        path: PathBuf,
        /// The column.
        column: Column,
        /// The type.
        found: String,
        /// What it may be.
        allowed: &'static str,
    },
    /// A column of a Parquet file is compressed in a way that is not built in.
    #[error("{}: column {}: found compression {found}; allowed: {allowed}", path.display(), column.name())]
    Compression {
        /// The file.
        path: PathBuf,
        /// The column.
        column: Column,
        /// The compression.
        found: String,
        /// What it may be.
        allowed: &'static str,
    },
}

fn listed(columns: &[Column]) -> String {
    let names: Vec<&str> = columns.iter().map(|column| column.name()).collect();
    names.join(",")
}

fn forms() -> String {
    let kinds = Kind::ALL.map(|kind| listed(kind.columns()));
    format!(
        "one of {}; with any of them material, and pixel_x with pixel_y",
        kinds.join(" or ")
    )
}
