//! Trace files: what a renderer asked, row by row, as demands.
//!
//! A file is read as it is needed: a row at a time from CSV, a page of every column at a time from
//! Parquet. Memory does not grow with the file. The format is in the book, `docs/src/traces.md`.

mod columns;
mod csv_file;
mod error;
mod parquet_file;
mod write;

pub use columns::{Column, Kind};
pub use error::{AccessError, At};
pub use write::write_csv;

use crate::isa::sampler::{Detail, SampleRequest};
use crate::model::sampler::Sampled;
use crate::model::stream::random_bits;
use crate::model::{Demand, Demands, Place, Request};
use columns::{Columns, Row};
use std::path::{Path, PathBuf};

/// Demands from a file.
///
/// A row that sees nothing but a sampler's border asks for nothing, and is passed over. After an
/// error there is no more to read.
pub struct TraceFile<'m> {
    path: PathBuf,
    materials: &'m [Sampled],
    columns: Columns,
    rows: Rows,
    row: Row,
    count: u64,
    has_failed: bool,
    /// Being made; its memory goes round with that of the caller's.
    next: Demand,
}

enum Rows {
    Csv(csv_file::CsvRows),
    Parquet(Box<parquet_file::ParquetRows>),
}

impl<'m> TraceFile<'m> {
    /// Opens a `.csv` or `.parquet` file whose materials, by number, are these.
    ///
    /// # Errors
    /// When the file cannot be read, has another ending, or its columns are not those of a trace.
    pub fn open(path: &Path, materials: &'m [Sampled]) -> Result<TraceFile<'m>, AccessError> {
        let ends_in = |ending: &str| {
            path.extension()
                .is_some_and(|e| e.eq_ignore_ascii_case(ending))
        };
        let (rows, columns) = if ends_in("csv") {
            let (rows, columns) = csv_file::CsvRows::open(path)?;
            (Rows::Csv(rows), columns)
        } else if ends_in("parquet") {
            let (rows, columns) = parquet_file::ParquetRows::open(path)?;
            (Rows::Parquet(Box::new(rows)), columns)
        } else {
            return Err(AccessError::Ending {
                path: path.to_owned(),
            });
        };
        Ok(TraceFile {
            path: path.to_owned(),
            materials,
            columns,
            rows,
            row: Row::default(),
            count: 0,
            has_failed: false,
            next: Demand::default(),
        })
    }

    /// How the rows say what they ask.
    #[must_use]
    pub fn kind(&self) -> Kind {
        self.columns.kind
    }

    /// Rows read so far.
    #[must_use]
    pub fn rows(&self) -> u64 {
        self.count
    }

    /// Makes `next` of the next row that asks for something; false at the end.
    fn advance_once(&mut self) -> Result<bool, AccessError> {
        loop {
            let is_there = match &mut self.rows {
                Rows::Csv(rows) => rows.read(&self.columns, &mut self.row)?,
                Rows::Parquet(rows) => rows.read(&self.columns, &mut self.row)?,
            };
            if !is_there {
                if self.count == 0 {
                    return Err(AccessError::Empty {
                        path: self.path.clone(),
                    });
                }
                return Ok(false);
            }
            self.count += 1;
            self.demand()?;
            if !self.next.places.is_empty() {
                return Ok(true);
            }
        }
    }

    /// Makes `next` of the row.
    fn demand(&mut self) -> Result<(), AccessError> {
        let count = self.materials.len() as i128;
        let material = self.whole(Column::Material, 0..=count - 1)? as u16;
        let sampled = &self.materials[usize::from(material)];
        let pixel = if self.columns.has_pixels {
            let axis = |column| self.whole(column, 0..=u32::MAX.into()).map(|n| n as u32);
            [axis(Column::PixelX)?, axis(Column::PixelY)?]
        } else {
            self.pixel()
        };
        let detail = match self.columns.kind {
            Kind::Texels => {
                let shape = sampled.shape();
                let mip = self.whole(Column::Mip, 0..=i128::from(shape.mip_count) - 1)? as u8;
                let (width, height) = shape.mip_size(mip);
                let x = self.whole(Column::X, 0..=i128::from(width) - 1)? as u32;
                let y = self.whole(Column::Y, 0..=i128::from(height) - 1)? as u32;
                self.next.places.clear();
                let texel = Request::new(shape, x, y, mip).ok();
                self.next.places.extend(texel.map(Place::of));
                self.next.weights = 1;
                None
            }
            Kind::Lods => Some(Detail::Lod(self.bits(Column::Lod)?)),
            Kind::Gradients => Some(Detail::Gradients {
                x: [self.bits(Column::DuDx)?, self.bits(Column::DvDx)?],
                y: [self.bits(Column::DuDy)?, self.bits(Column::DvDy)?],
            }),
        };
        if let Some(detail) = detail {
            let request = SampleRequest {
                place: [self.bits(Column::U)?, self.bits(Column::V)?],
                detail,
                random: random_bits(pixel),
            };
            sampled.demand(&request, &mut self.next);
        }
        self.next.pixel = pixel;
        self.next.material = material;
        Ok(())
    }

    /// Without pixels, four rows after each other are a quad, in a strip two pixels high.
    fn pixel(&self) -> [u32; 2] {
        let index = self.count - 1;
        [
            ((index / 4 * 2) as u32) | (index & 1) as u32,
            (index >> 1 & 1) as u32,
        ]
    }

    fn whole(
        &self,
        column: Column,
        allowed: std::ops::RangeInclusive<i128>,
    ) -> Result<i128, AccessError> {
        let found = self.row.whole(column);
        if allowed.contains(&found) {
            return Ok(found);
        }
        Err(AccessError::Range {
            path: self.path.clone(),
            at: self.row.at,
            column,
            found,
            allowed,
        })
    }

    fn bits(&self, column: Column) -> Result<u32, AccessError> {
        let found = self.row.real(column);
        if found.is_finite() {
            return Ok(found.to_bits());
        }
        Err(AccessError::NotFinite {
            path: self.path.clone(),
            at: self.row.at,
            column,
            found,
        })
    }
}

impl Demands for TraceFile<'_> {
    type Error = AccessError;

    fn advance(&mut self, demand: &mut Demand) -> Result<bool, AccessError> {
        if self.has_failed {
            return Ok(false);
        }
        let is_there = self.advance_once();
        self.has_failed = is_there.is_err();
        if let Ok(true) = is_there {
            std::mem::swap(demand, &mut self.next);
        }
        is_there
    }
}
