//! Columns: what a trace file's columns are called, and which belong together.

use super::error::{AccessError, At};
use std::path::Path;

/// A column of a trace file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Column {
    /// Texel of the mip along x.
    X,
    /// Texel of the mip along y.
    Y,
    /// The mip.
    Mip,
    /// The material, from 0.
    Material,
    /// Column on the screen.
    PixelX,
    /// Row on the screen.
    PixelY,
    /// Across the texture, 0 to 1.
    U,
    /// Down the texture, 0 to 1.
    V,
    /// The level of detail.
    Lod,
    /// Change of u from a pixel to the next on its right.
    DuDx,
    /// Change of v from a pixel to the next on its right.
    DvDx,
    /// Change of u from a pixel to the next below.
    DuDy,
    /// Change of v from a pixel to the next below.
    DvDy,
}

/// Columns that there are.
pub(super) const COLUMNS: usize = 13;

impl Column {
    /// Every column.
    pub const ALL: [Column; COLUMNS] = [
        Column::X,
        Column::Y,
        Column::Mip,
        Column::Material,
        Column::PixelX,
        Column::PixelY,
        Column::U,
        Column::V,
        Column::Lod,
        Column::DuDx,
        Column::DvDx,
        Column::DuDy,
        Column::DvDy,
    ];

    /// The name in a header.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Column::X => "x",
            Column::Y => "y",
            Column::Mip => "mip",
            Column::Material => "material",
            Column::PixelX => "pixel_x",
            Column::PixelY => "pixel_y",
            Column::U => "u",
            Column::V => "v",
            Column::Lod => "lod",
            Column::DuDx => "dudx",
            Column::DvDx => "dvdx",
            Column::DuDy => "dudy",
            Column::DvDy => "dvdy",
        }
    }

    /// Whether its numbers are integers; those of the others are f32.
    #[must_use]
    pub const fn is_whole(self) -> bool {
        match self {
            Column::X
            | Column::Y
            | Column::Mip
            | Column::Material
            | Column::PixelX
            | Column::PixelY => true,
            Column::U
            | Column::V
            | Column::Lod
            | Column::DuDx
            | Column::DvDx
            | Column::DuDy
            | Column::DvDy => false,
        }
    }
}

/// How the rows of a file say what they ask.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Kind {
    /// A texel: `x`, `y`, `mip`.
    Texels,
    /// A sample: `u`, `v`, `lod`.
    Lods,
    /// A sample: `u`, `v`, `dudx`, `dvdx`, `dudy`, `dvdy`.
    Gradients,
}

impl Kind {
    /// Every kind.
    pub const ALL: [Kind; 3] = [Kind::Texels, Kind::Lods, Kind::Gradients];

    /// The columns that the kind needs.
    #[must_use]
    pub const fn columns(self) -> &'static [Column] {
        match self {
            Kind::Texels => &[Column::X, Column::Y, Column::Mip],
            Kind::Lods => &[Column::U, Column::V, Column::Lod],
            Kind::Gradients => &[
                Column::U,
                Column::V,
                Column::DuDx,
                Column::DvDx,
                Column::DuDy,
                Column::DvDy,
            ],
        }
    }
}

/// What any kind can have besides.
const OPTIONAL: [Column; 3] = [Column::Material, Column::PixelX, Column::PixelY];

/// A file's columns, in its own order.
#[derive(Clone, Debug)]
pub(super) struct Columns {
    pub(super) order: Vec<Column>,
    pub(super) kind: Kind,
    pub(super) has_pixels: bool,
}

impl Columns {
    /// The columns with these names, if together they are those of a trace.
    pub(super) fn new<'n>(
        path: &Path,
        names: impl Iterator<Item = &'n str>,
    ) -> Result<Columns, AccessError> {
        let mut order: Vec<Column> = Vec::new();
        for name in names {
            let known = Column::ALL.into_iter().find(|column| column.name() == name);
            match known {
                Some(column) if !order.contains(&column) => order.push(column),
                Some(_) | None => {
                    return Err(AccessError::Column {
                        path: path.to_owned(),
                        found: name.to_owned(),
                    });
                }
            }
        }
        let has = |column: &Column| order.contains(column);
        let kind = Kind::ALL.into_iter().find(|kind| {
            let (own, other) = (kind.columns(), |c: &&Column| !OPTIONAL.contains(c));
            own.iter().all(has) && order.iter().filter(other).count() == own.len()
        });
        let has_pixels = has(&Column::PixelX);
        match kind {
            Some(kind) if has_pixels == has(&Column::PixelY) => Ok(Columns {
                order,
                kind,
                has_pixels,
            }),
            Some(_) | None => Err(AccessError::Header {
                path: path.to_owned(),
                found: order,
            }),
        }
    }
}

/// One row's numbers. Columns that the file does not have are 0.
#[derive(Clone, Debug)]
pub(super) struct Row {
    pub(super) at: At,
    whole: [i128; COLUMNS],
    real: [f32; COLUMNS],
}

impl Default for Row {
    fn default() -> Row {
        Row {
            at: At::Header,
            whole: [0; COLUMNS],
            real: [0.0; COLUMNS],
        }
    }
}

impl Row {
    pub(super) const fn whole(&self, column: Column) -> i128 {
        self.whole[column as usize]
    }

    pub(super) const fn real(&self, column: Column) -> f32 {
        self.real[column as usize]
    }

    pub(super) const fn set_whole(&mut self, column: Column, number: i128) {
        self.whole[column as usize] = number;
    }

    pub(super) const fn set_real(&mut self, column: Column, number: f32) {
        self.real[column as usize] = number;
    }
}
