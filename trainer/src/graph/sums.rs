//! Sums: rows that share a cell added up, without atomics and in a fixed order.
//!
//! The way back of a gather adds many texels' gradients to few cells, and coarse mips send hundreds
//! of them to the same one. A tensor library's own scatter takes one thread for each channel, or
//! atomic additions whose order differs from run to run. Here the processor sorts the rows by cell
//! and cuts each cell's list into groups of [`WIDE`]; the device adds each group, then groups of
//! those sums, until one row is left for every cell: gathers and short sums, all of them parallel.

use burn_tensor::{Device, Int, Tensor, TensorData};
use std::ops::Range;

/// Rows that are added at once.
const WIDE: usize = 4;

/// Which rows to add, level by level.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Sums {
    rows: usize,
    /// For each level [`WIDE`] rows of the level before for each of its own; the one after the last
    /// row of any level is zero. Padded to a power of two, so that few shapes of kernels occur.
    levels: Vec<Vec<i32>>,
    /// For each cell its row of the last level.
    cells: Vec<i32>,
}

impl Sums {
    /// The sums of rows whose cells are `cell_of`, each below `cells`.
    pub(crate) fn new(cell_of: &[i32], cells: usize) -> Sums {
        // Rows by cell, in order within a cell.
        let mut ends = vec![0_usize; cells + 1];
        for &cell in cell_of {
            ends[cell as usize + 1] += 1;
        }
        for cell in 0..cells {
            ends[cell + 1] += ends[cell];
        }
        let mut runs: Vec<(usize, Range<usize>)> = (0..cells)
            .map(|cell| (cell, ends[cell]..ends[cell + 1]))
            .filter(|(_, run)| !run.is_empty())
            .collect();
        let mut sorted = vec![0_i32; cell_of.len()];
        for (row, &cell) in cell_of.iter().enumerate() {
            let place = &mut ends[cell as usize];
            sorted[*place] = row as i32;
            *place += 1;
        }
        let mut levels = Vec::new();
        let mut zero = cell_of.len() as i32;
        while runs.iter().any(|(_, run)| run.len() > 1) {
            let mut table = Vec::with_capacity(WIDE * runs.len());
            for (_, run) in &mut runs {
                let start = table.len() / WIDE;
                for group in sorted[run.clone()].chunks(WIDE) {
                    table.extend_from_slice(group);
                    table.resize(table.len().next_multiple_of(WIDE), zero);
                }
                *run = start..table.len() / WIDE;
            }
            let rows = table.len() / WIDE;
            table.resize((rows + 1).next_power_of_two() * WIDE, zero);
            levels.push(table);
            sorted = (0..rows as i32).collect();
            // The padding is a sum of zeros.
            zero = rows as i32;
        }
        let mut row_of = vec![zero; cells];
        for (cell, run) in runs {
            row_of[cell] = sorted[run.start];
        }
        Sums {
            rows: cell_of.len(),
            levels,
            cells: row_of,
        }
    }

    /// The sums of `rows` (rows × channels) for every cell, cells × channels.
    pub(crate) fn of(&self, rows: Tensor<2>) -> Tensor<2> {
        let device = rows.device();
        let [count, channels] = rows.dims();
        debug_assert_eq!(count, self.rows);
        let mut rows = Tensor::cat(vec![rows, Tensor::zeros([1, channels], &device)], 0);
        for table in &self.levels {
            let groups = rows.select(0, indices(table.clone(), &device));
            let groups = groups.reshape([table.len() / WIDE, WIDE, channels]);
            rows = groups.sum_dim(1).reshape([table.len() / WIDE, channels]);
        }
        rows.select(0, indices(self.cells.clone(), &device))
    }
}

/// Row numbers on a device.
pub(crate) fn indices(rows: Vec<i32>, device: &Device) -> Tensor<1, Int> {
    let len = rows.len();
    Tensor::from_data(TensorData::new(rows, [len]), device)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::graph::flat::{download, upload};
    use crate::random::{Purpose, Stream};

    #[test]
    fn sums_equal_the_definition_for_crowded_and_for_empty_cells() {
        let (cells, channels) = (37, 3);
        let stream = Stream::new(1, Purpose::Batch, 0);
        for (rows, crowd) in [(1_u64, 1), (36, 37), (500, 37), (500, 2), (1025, 1)] {
            let cell_of: Vec<i32> = (0..rows).map(|i| stream.below(i, crowd) as i32).collect();
            // Small integers: sums are exact in any order.
            let values: Vec<f32> = (0..rows * channels as u64)
                .map(|i| stream.below(rows + i, 33) as f32 - 16.0)
                .collect();
            let mut expected = vec![0.0; cells * channels];
            for (row, &cell) in cell_of.iter().enumerate() {
                for channel in 0..channels {
                    expected[cell as usize * channels + channel] +=
                        values[row * channels + channel];
                }
            }
            let tensor = upload(values, [rows as usize, channels], &Device::flex());
            let sums = Sums::new(&cell_of, cells).of(tensor);
            assert_eq!(sums.dims(), [cells, channels]);
            assert_eq!(download(sums).unwrap(), expected, "{rows} rows");
        }
    }
}
