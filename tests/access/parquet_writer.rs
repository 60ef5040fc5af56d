//! Parquet files for the tests, by the crate's own writer.

use parquet::basic::Compression;
use parquet::column::writer::ColumnWriter;
use parquet::data_type::ByteArray;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::parser::parse_message_type;
use std::sync::Arc;

/// The numbers of a column, in the type in which it is written.
#[derive(Clone, Debug)]
pub(crate) enum Numbers {
    Int32(Vec<i32>),
    Int64(Vec<i64>),
    Float(Vec<f32>),
    Double(Vec<f64>),
    Text(Vec<String>),
}

/// How a file is written.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Form {
    pub(crate) is_snappy: bool,
    pub(crate) has_dictionary: bool,
    pub(crate) group_rows: usize,
}

pub(crate) const PLAIN: Form = Form {
    is_snappy: false,
    has_dictionary: false,
    group_rows: usize::MAX,
};

/// A column: its declaration (`required int32 x`), its numbers, and for an `optional` one which rows
/// are null.
pub(crate) type Written = (String, Numbers, Vec<bool>);

/// The file's bytes. Columns have as many rows as the first.
pub(crate) fn parquet(columns: &[Written], form: Form) -> Vec<u8> {
    let fields: Vec<String> = columns.iter().map(|(f, ..)| format!("{f};")).collect();
    let schema = format!("message trace {{ {} }}", fields.join(" "));
    let schema = Arc::new(parse_message_type(&schema).unwrap());
    let compression = if form.is_snappy {
        Compression::SNAPPY
    } else {
        Compression::UNCOMPRESSED
    };
    let properties = WriterProperties::builder()
        .set_compression(compression)
        .set_dictionary_enabled(form.has_dictionary)
        .build();
    let mut writer = SerializedFileWriter::new(Vec::new(), schema, Arc::new(properties)).unwrap();
    let rows = columns.first().map_or(0, |(_, numbers, _)| numbers.len());
    let mut start = 0;
    while start < rows {
        let end = start.saturating_add(form.group_rows).min(rows);
        let mut group = writer.next_row_group().unwrap();
        for (declaration, numbers, nulls) in columns {
            let is_there: Vec<bool> = (start..end)
                .map(|i| !nulls.get(i).unwrap_or(&false))
                .collect();
            let levels: Vec<i16> = is_there.iter().map(|&there| there.into()).collect();
            let levels = declaration
                .starts_with("optional")
                .then_some(levels.as_slice());
            let mut column = group.next_column().unwrap().unwrap();
            macro_rules! write {
                ($writer:expr, $values:expr) => {{
                    let values = $values[start..end].iter().zip(&is_there);
                    let values: Vec<_> = values.filter(|v| *v.1).map(|v| v.0.clone()).collect();
                    $writer.write_batch(&values, levels, None).unwrap();
                }};
            }
            match (column.untyped(), numbers) {
                (ColumnWriter::Int32ColumnWriter(w), Numbers::Int32(v)) => write!(w, v),
                (ColumnWriter::Int64ColumnWriter(w), Numbers::Int64(v)) => write!(w, v),
                (ColumnWriter::FloatColumnWriter(w), Numbers::Float(v)) => write!(w, v),
                (ColumnWriter::DoubleColumnWriter(w), Numbers::Double(v)) => write!(w, v),
                (ColumnWriter::ByteArrayColumnWriter(w), Numbers::Text(v)) => {
                    let v: Vec<ByteArray> = v.iter().map(|t| t.as_str().into()).collect();
                    write!(w, v);
                }
                (_, numbers) => panic!("{declaration} and {numbers:?}"),
            }
            column.close().unwrap();
        }
        group.close().unwrap();
        start = end;
    }
    writer.into_inner().unwrap()
}

impl Numbers {
    fn len(&self) -> usize {
        match self {
            Numbers::Int32(v) => v.len(),
            Numbers::Int64(v) => v.len(),
            Numbers::Float(v) => v.len(),
            Numbers::Double(v) => v.len(),
            Numbers::Text(v) => v.len(),
        }
    }
}
