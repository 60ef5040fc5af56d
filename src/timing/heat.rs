//! Heat: where on the screen lines of the latent cache were looked up and missed.

pub(crate) mod colour;
mod digits;
mod picture;

use ntmu_model::time::Watch;
use serde::Serialize;
use std::io::{self, Write};

/// Cells along an axis. With more pixels, a cell becomes larger: 16 MiB are enough for any screen.
const MOST_CELLS: usize = 1024;
/// The largest cell's side, as a power of two. 2^22 pixels in 1024 cells are all that a demand can
/// number.
const MOST_SHIFT: u32 = 22;

/// Lookups of a cell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Counts {
    lookups: u64,
    misses: u64,
}

/// Which number a picture shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum HeatValue {
    /// Lines that were asked for.
    #[default]
    Misses,
    /// Lines that were looked up.
    Lookups,
    /// Misses / lookups.
    MissRate,
}

/// A watch that adds up lookups and misses in square cells of the screen.
///
/// A group of texels counts where its first pixel lies, so cells smaller than a group's pixels have
/// holes between them. Cells double their side whenever the screen turns out to have more than 1024
/// of them along an axis.
#[derive(Clone, Debug)]
pub struct MissMap {
    /// The side of a cell, as a power of two.
    shift: u32,
    /// Rows of [`MOST_CELLS`] cells, as many as are needed.
    cells: Vec<Counts>,
    columns: usize,
}

/// One cell that something was looked up in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct HeatCell {
    /// Its first column of pixels.
    pub pixel_x: u64,
    /// Its first row of pixels.
    pub pixel_y: u64,
    /// Lines looked up, each once for a fetch of a group.
    pub lookups: u64,
    /// Those that had to be asked for.
    pub misses: u64,
}

/// The map in numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct HeatSummary {
    /// Pixels along the side of a cell.
    pub cell_pixels: u32,
    /// Cells along x and y, from pixel 0 to the last one that something was looked up for.
    pub cells: [usize; 2],
    /// Lines looked up in all cells.
    pub lookups: u64,
    /// Misses in all cells.
    pub misses: u64,
    /// The most of a cell.
    pub most_lookups: u64,
    /// The most of a cell.
    pub most_misses: u64,
}

/// 2×2 pixels, a quad.
impl Default for MissMap {
    fn default() -> MissMap {
        MissMap::new(2)
    }
}

impl MissMap {
    /// An empty map whose cells have so many pixels along their side, rounded up to a power of two
    /// of at most 2^22.
    #[must_use]
    pub fn new(cell_pixels: u32) -> MissMap {
        let side = cell_pixels.clamp(1, 1 << MOST_SHIFT).next_power_of_two();
        MissMap {
            shift: side.trailing_zeros(),
            cells: Vec::new(),
            columns: 0,
        }
    }

    /// Doubles the cells' side.
    fn coarsen(&mut self) {
        let rows = self.rows().div_ceil(2);
        let mut coarse = vec![Counts::default(); rows * MOST_CELLS];
        for (index, counts) in self.cells.iter().enumerate() {
            let (row, column) = (index / MOST_CELLS, index % MOST_CELLS);
            let cell = &mut coarse[row / 2 * MOST_CELLS + column / 2];
            cell.lookups += counts.lookups;
            cell.misses += counts.misses;
        }
        self.cells = coarse;
        self.columns = self.columns.div_ceil(2);
        self.shift += 1;
    }

    fn rows(&self) -> usize {
        self.cells.len() / MOST_CELLS
    }

    /// Each row of the map, without the cells behind its last column.
    fn lines(&self) -> impl Iterator<Item = &[Counts]> {
        let lines = self.cells.chunks_exact(MOST_CELLS);
        lines.map(|line| &line[..self.columns])
    }

    /// Every cell that something was looked up in, row by row.
    pub fn cells(&self) -> impl Iterator<Item = HeatCell> {
        self.lines().enumerate().flat_map(move |(row, line)| {
            let cells = line.iter().enumerate().filter(|(_, c)| c.lookups > 0);
            cells.map(move |(column, counts)| HeatCell {
                pixel_x: (column as u64) << self.shift,
                pixel_y: (row as u64) << self.shift,
                lookups: counts.lookups,
                misses: counts.misses,
            })
        })
    }

    /// The map in numbers.
    #[must_use]
    pub fn summary(&self) -> HeatSummary {
        let mut summary = HeatSummary {
            cell_pixels: 1 << self.shift,
            cells: [self.columns, self.rows()],
            lookups: 0,
            misses: 0,
            most_lookups: 0,
            most_misses: 0,
        };
        for counts in self.lines().flatten() {
            summary.lookups += counts.lookups;
            summary.misses += counts.misses;
            summary.most_lookups = summary.most_lookups.max(counts.lookups);
            summary.most_misses = summary.most_misses.max(counts.misses);
        }
        summary
    }

    /// Writes the cells as CSV: `pixel_x,pixel_y,lookups,misses`.
    ///
    /// # Errors
    /// When the writer fails.
    pub fn write_csv(&self, writer: impl Write) -> io::Result<()> {
        let mut writer = csv::Writer::from_writer(writer);
        for cell in self.cells() {
            writer.serialize(cell)?;
        }
        writer.flush()
    }

    /// Writes the summary and the cells as JSON.
    ///
    /// # Errors
    /// When the writer fails.
    pub fn write_json(&self, writer: impl Write) -> io::Result<()> {
        #[derive(Serialize)]
        struct Map {
            #[serde(flatten)]
            summary: HeatSummary,
            map: Vec<HeatCell>,
        }
        let map = Map {
            summary: self.summary(),
            map: self.cells().collect(),
        };
        let mut writer = io::BufWriter::new(writer);
        serde_json::to_writer(&mut writer, &map)?;
        writer.flush()
    }
}

impl Watch for MissMap {
    fn lookup(&mut self, pixel: [u32; 2], lines: u32, misses: u32) {
        let far = pixel[0].max(pixel[1]);
        while (far >> self.shift) as usize >= MOST_CELLS {
            self.coarsen();
        }
        let [column, row] = pixel.map(|along| (along >> self.shift) as usize);
        if row >= self.rows() {
            self.cells.resize((row + 1) * MOST_CELLS, Counts::default());
        }
        self.columns = self.columns.max(column + 1);
        let cell = &mut self.cells[row * MOST_CELLS + column];
        cell.lookups += u64::from(lines);
        cell.misses += u64::from(misses);
    }
}
