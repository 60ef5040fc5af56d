//! Trace files as Parquet.
//!
//! The reader that stands behind panics on some damaged files; every call into it is guarded.

use super::columns::{Column, Columns, Row};
use super::error::{AccessError, At};
use parquet::basic::{Compression, ConvertedType, LogicalType};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::DataType;
use parquet::errors::ParquetError;
use parquet::file::metadata::RowGroupMetaData;
use parquet::file::reader::{FileReader as _, SerializedFileReader};
use parquet::schema::types::ColumnDescriptor;
use std::fs::File;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

/// Rows that are decoded at once.
const CHUNK: usize = 4096;

/// A Parquet file, read chunk by chunk.
pub(super) struct ParquetRows {
    path: PathBuf,
    file: SerializedFileReader<File>,
    /// Row groups not yet begun.
    groups: std::ops::Range<usize>,
    /// One a column, in the order of the file.
    leaves: Vec<Leaf>,
    /// Rows of the group that are not yet in a chunk.
    left: u64,
    /// Rows of the chunk: those read, of those there.
    chunk: std::ops::Range<usize>,
    rows: u64,
}

/// A column of a row group.
struct Leaf {
    column: Column,
    reader: Numbers,
    is_unsigned: bool,
    whole: Vec<i128>,
    real: Vec<f32>,
}

/// A column's reader, with room for a chunk.
enum Numbers {
    Int32(Typed<parquet::data_type::Int32Type>),
    Int64(Typed<parquet::data_type::Int64Type>),
    Float(Typed<parquet::data_type::FloatType>),
    Double(Typed<parquet::data_type::DoubleType>),
}

struct Typed<T: DataType> {
    reader: ColumnReaderImpl<T>,
    values: Vec<T::T>,
    levels: Vec<i16>,
}

impl ParquetRows {
    pub(super) fn open(path: &Path) -> Result<(ParquetRows, Columns), AccessError> {
        guarded(path, || ParquetRows::open_unguarded(path))
    }

    fn open_unguarded(path: &Path) -> Result<(ParquetRows, Columns), AccessError> {
        let file = File::open(path).map_err(|source| AccessError::Io {
            path: path.to_owned(),
            source,
        })?;
        let size = file.metadata().map_or(0, |metadata| metadata.len());
        let file = SerializedFileReader::new(file).map_err(|e| damaged(path, e))?;
        let schema = file.metadata().file_metadata().schema_descr_ptr();
        let names = schema.columns().iter().map(|c| c.path().string());
        let names: Vec<String> = names.collect();
        let columns = Columns::new(path, names.iter().map(String::as_str))?;
        for (&column, descriptor) in columns.order.iter().zip(schema.columns()) {
            check_type(path, column, descriptor)?;
        }
        for group in file.metadata().row_groups() {
            check_place(path, size, group)?;
            check_compression(path, &columns, group)?;
        }
        let groups = 0..file.num_row_groups();
        let rows = ParquetRows {
            path: path.to_owned(),
            file,
            groups,
            leaves: Vec::new(),
            left: 0,
            chunk: 0..0,
            rows: 0,
        };
        Ok((rows, columns))
    }

    /// Puts the next row in the place of `row`; false at the end.
    pub(super) fn read(&mut self, columns: &Columns, row: &mut Row) -> Result<bool, AccessError> {
        while self.chunk.is_empty() {
            let path = self.path.clone();
            if self.left > 0 {
                guarded(&path, || self.read_chunk())?;
            } else if let Some(group) = self.groups.next() {
                guarded(&path, || self.begin(columns, group))?;
            } else {
                return Ok(false);
            }
        }
        let index = self.chunk.start;
        self.chunk.start += 1;
        self.rows += 1;
        row.at = At::Row(self.rows);
        for leaf in &self.leaves {
            if leaf.column.is_whole() {
                row.set_whole(leaf.column, leaf.whole[index]);
            } else {
                row.set_real(leaf.column, leaf.real[index]);
            }
        }
        Ok(true)
    }

    fn begin(&mut self, columns: &Columns, group: usize) -> Result<(), AccessError> {
        let path = &self.path;
        let group = self.file.get_row_group(group);
        let group = group.map_err(|e| damaged(path, e))?;
        let rows = group.metadata().num_rows();
        self.left = u64::try_from(rows)
            .map_err(|_| damaged(path, format!("a row group with {rows} rows")))?;
        let leaves = columns.order.iter().enumerate().map(|(index, &column)| {
            let reader = group.get_column_reader(index);
            let reader = reader.map_err(|e| damaged(path, e))?;
            let descriptor = group.metadata().column(index).column_descr();
            let reader = Numbers::of(reader).ok_or_else(|| wrong_type(path, column, descriptor))?;
            Ok(Leaf {
                column,
                reader,
                is_unsigned: is_unsigned(descriptor),
                whole: Vec::new(),
                real: Vec::new(),
            })
        });
        self.leaves = leaves.collect::<Result<_, AccessError>>()?;
        Ok(())
    }

    fn read_chunk(&mut self) -> Result<(), AccessError> {
        let count = usize::try_from(self.left).map_or(CHUNK, |left| left.min(CHUNK));
        for leaf in &mut self.leaves {
            match leaf.read(count) {
                Ok(None) => {}
                Ok(Some(null)) => {
                    return Err(AccessError::Number {
                        path: self.path.clone(),
                        at: At::Row(self.rows + null as u64 + 1),
                        column: leaf.column,
                        found: "null".to_owned(),
                        allowed: "a number",
                    });
                }
                Err(error) => return Err(damaged(&self.path, error)),
            }
        }
        self.left -= count as u64;
        self.chunk = 0..count;
        Ok(())
    }
}

impl Leaf {
    /// Reads exactly so many numbers; gives the first that is null.
    fn read(&mut self, count: usize) -> Result<Option<usize>, ParquetError> {
        let (whole, real) = (&mut self.whole, &mut self.real);
        whole.clear();
        real.clear();
        let is_unsigned = self.is_unsigned;
        match &mut self.reader {
            Numbers::Int32(typed) => typed.read(count, |n| {
                let n = if is_unsigned {
                    i128::from(n as u32)
                } else {
                    n.into()
                };
                whole.push(n);
                real.push(n as f32);
            }),
            Numbers::Int64(typed) => typed.read(count, |n| {
                let n = if is_unsigned {
                    i128::from(n as u64)
                } else {
                    n.into()
                };
                whole.push(n);
                real.push(n as f32);
            }),
            Numbers::Float(typed) => typed.read(count, |n| real.push(n)),
            Numbers::Double(typed) => typed.read(count, |n| real.push(n as f32)),
        }
    }
}

impl<T: DataType> Typed<T> {
    const fn new(reader: ColumnReaderImpl<T>) -> Typed<T> {
        Typed {
            reader,
            values: Vec::new(),
            levels: Vec::new(),
        }
    }

    fn read(
        &mut self,
        count: usize,
        take: impl FnMut(T::T),
    ) -> Result<Option<usize>, ParquetError> {
        self.values.clear();
        self.levels.clear();
        let mut done = 0;
        while done < count {
            let levels = Some(&mut self.levels);
            let read = self
                .reader
                .read_records(count - done, levels, None, &mut self.values);
            let (records, ..) = read?;
            if records == 0 {
                let found = format!("a column with {done} rows where its group has {count} more");
                return Err(ParquetError::General(found));
            }
            done += records;
        }
        if self.values.len() != count {
            let null = self.levels.iter().position(|&level| level == 0);
            return Ok(Some(null.unwrap_or(self.values.len())));
        }
        self.values.drain(..).for_each(take);
        Ok(None)
    }
}

impl Numbers {
    fn of(reader: ColumnReader) -> Option<Numbers> {
        match reader {
            ColumnReader::Int32ColumnReader(r) => Some(Numbers::Int32(Typed::new(r))),
            ColumnReader::Int64ColumnReader(r) => Some(Numbers::Int64(Typed::new(r))),
            ColumnReader::FloatColumnReader(r) => Some(Numbers::Float(Typed::new(r))),
            ColumnReader::DoubleColumnReader(r) => Some(Numbers::Double(Typed::new(r))),
            ColumnReader::BoolColumnReader(_)
            | ColumnReader::Int96ColumnReader(_)
            | ColumnReader::ByteArrayColumnReader(_)
            | ColumnReader::FixedLenByteArrayColumnReader(_) => None,
        }
    }
}

/// Turns a panic into an error. What it leaves behind is not read again: errors end a trace.
fn guarded<T>(
    path: &Path,
    work: impl FnOnce() -> Result<T, AccessError>,
) -> Result<T, AccessError> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|payload| {
        let text = payload.downcast_ref::<String>().map(String::as_str);
        let text = text.or_else(|| payload.downcast_ref::<&str>().copied());
        Err(damaged(path, text.unwrap_or("the reader gave up")))
    })
}

fn damaged(path: &Path, found: impl ToString) -> AccessError {
    AccessError::Parquet {
        path: path.to_owned(),
        found: found.to_string(),
    }
}

fn is_unsigned(descriptor: &ColumnDescriptor) -> bool {
    use ConvertedType::{UINT_8, UINT_16, UINT_32, UINT_64};
    if let Some(LogicalType::Integer(integer)) = descriptor.logical_type_ref() {
        return !integer.is_signed;
    }
    [UINT_8, UINT_16, UINT_32, UINT_64].contains(&descriptor.converted_type())
}

fn wrong_type(path: &Path, column: Column, descriptor: &ColumnDescriptor) -> AccessError {
    let mut found = descriptor.physical_type().to_string();
    if let Some(logical) = descriptor.logical_type_ref() {
        found.push_str(&format!(" as {logical:?}"));
    }
    if descriptor.max_rep_level() > 0 {
        found.push_str(", repeated");
    }
    let allowed = if column.is_whole() {
        "INT32 or INT64, signed or unsigned"
    } else {
        "FLOAT, DOUBLE, INT32 or INT64"
    };
    AccessError::ColumnType {
        path: path.to_owned(),
        column,
        found,
        allowed,
    }
}

fn check_type(
    path: &Path,
    column: Column,
    descriptor: &ColumnDescriptor,
) -> Result<(), AccessError> {
    use ConvertedType::{INT_8, INT_16, INT_32, INT_64, NONE};
    use parquet::basic::Type;
    let is_number = match descriptor.physical_type() {
        Type::INT32 | Type::INT64 => match descriptor.logical_type_ref() {
            Some(logical) => matches!(logical, LogicalType::Integer(_)),
            None => {
                let signed = [NONE, INT_8, INT_16, INT_32, INT_64];
                signed.contains(&descriptor.converted_type()) || is_unsigned(descriptor)
            }
        },
        Type::FLOAT | Type::DOUBLE => !column.is_whole(),
        Type::BOOLEAN | Type::INT96 | Type::BYTE_ARRAY | Type::FIXED_LEN_BYTE_ARRAY => false,
    };
    if is_number && descriptor.max_rep_level() == 0 && descriptor.max_def_level() <= 1 {
        Ok(())
    } else {
        Err(wrong_type(path, column, descriptor))
    }
}

/// Whether the columns of a row group lie within the file, where the reader takes that for granted.
fn check_place(path: &Path, size: u64, group: &RowGroupMetaData) -> Result<(), AccessError> {
    for chunk in group.columns() {
        let start = chunk
            .dictionary_page_offset()
            .unwrap_or_else(|| chunk.data_page_offset());
        let length = chunk.compressed_size();
        let end = u64::try_from(start)
            .ok()
            .zip(u64::try_from(length).ok())
            .and_then(|(start, length)| start.checked_add(length));
        if end.is_none_or(|end| end > size) {
            let found = format!("{length} bytes from byte {start} on, in a file of {size}");
            return Err(damaged(path, found));
        }
    }
    Ok(())
}

fn check_compression(
    path: &Path,
    columns: &Columns,
    group: &RowGroupMetaData,
) -> Result<(), AccessError> {
    for (&column, chunk) in columns.order.iter().zip(group.columns()) {
        let found = chunk.compression();
        if ![Compression::UNCOMPRESSED, Compression::SNAPPY].contains(&found) {
            return Err(AccessError::Compression {
                path: path.to_owned(),
                column,
                found: found.to_string(),
                allowed: "UNCOMPRESSED, SNAPPY",
            });
        }
    }
    Ok(())
}
