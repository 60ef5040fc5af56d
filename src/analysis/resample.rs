//! Resampling: two levels of a grid at common places.

use ndarray::{Array2, Array3, ArrayView3, Axis, Slice};
use ntmu_isa::position::AddressMode;
use serde::Serialize;

/// How levels of different size are brought to common places.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Alignment {
    /// At the cells of the coarser level: a cell of it beside the mean of the finer cells on the
    /// same texels, as mips are made. Every example is of texels of its own, and nothing is made
    /// up between cells. The paper does not say what it did; this asks what its figure is about:
    /// whether the coarse level stores again what the fine one already has.
    #[default]
    Pool,
    /// At the cells of the finer level: the coarser one is interpolated bilinearly, as a sampler
    /// would. Detail that the coarse level cannot have counts against it.
    Bilinear,
}

impl Alignment {
    /// The name in options, tables and JSON.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Alignment::Pool => "pool",
            Alignment::Bilinear => "bilinear",
        }
    }
}

/// The features of two levels \[channel, row, column\] as examples \[place, feature\]. A cell of
/// `coarse` spans 2^`halvings` cells of `fine` along each axis, fewer at the far edges.
pub(super) fn examples(
    fine: ArrayView3<'_, f64>,
    coarse: ArrayView3<'_, f64>,
    halvings: u8,
    alignment: Alignment,
    mode: AddressMode,
) -> [Array2<f64>; 2] {
    match alignment {
        Alignment::Pool => {
            let (_, rows, columns) = coarse.dim();
            let pooled = pool(fine, halvings, (rows, columns));
            [flat(pooled.view()), flat(coarse)]
        }
        Alignment::Bilinear => {
            let (_, rows, columns) = fine.dim();
            let raised = interpolate(coarse, halvings, (rows, columns), mode);
            [flat(fine), flat(raised.view())]
        }
    }
}

/// \[channel, row, column\] as \[place, channel\].
fn flat(features: ArrayView3<'_, f64>) -> Array2<f64> {
    let (channels, rows, columns) = features.dim();
    Array2::from_shape_fn((rows * columns, channels), |(place, channel)| {
        features[[channel, place / columns, place % columns]]
    })
}

fn pool(fine: ArrayView3<'_, f64>, halvings: u8, size: (usize, usize)) -> Array3<f64> {
    let (channels, rows, columns) = fine.dim();
    let span = |index: usize, count: usize| {
        let first = (index << halvings).min(count.saturating_sub(1));
        first..((index + 1) << halvings).min(count).max(first + 1)
    };
    Array3::from_shape_fn((channels, size.0, size.1), |(channel, row, column)| {
        let (rows, columns) = (span(row, rows), span(column, columns));
        let cells = rows.len() * columns.len();
        let plane = fine.index_axis(Axis(0), channel);
        let block = plane.slice_axis(Axis(0), Slice::from(rows));
        let block = block.slice_axis(Axis(1), Slice::from(columns));
        block.sum() / cells as f64
    })
}

fn interpolate(
    coarse: ArrayView3<'_, f64>,
    halvings: u8,
    size: (usize, usize),
    mode: AddressMode,
) -> Array3<f64> {
    let (channels, rows, columns) = coarse.dim();
    // Centre of a fine cell in coarse cells: the one at or before it, and how far behind it.
    let place = |index: usize, count: usize| {
        let at = (index as f64 + 0.5) / f64::from(1_u32 << halvings.min(31)) - 0.5;
        let before = at.floor();
        let cell = |at: f64| mode.resolve(at as i32, count as u32) as usize;
        ([cell(before), cell(before + 1.0)], at - before)
    };
    Array3::from_shape_fn((channels, size.0, size.1), |(channel, row, column)| {
        let (ys, down) = place(row, rows);
        let (xs, across) = place(column, columns);
        let along = |y: usize| {
            (1.0 - across) * coarse[[channel, y, xs[0]]] + across * coarse[[channel, y, xs[1]]]
        };
        (1.0 - down) * along(ys[0]) + down * along(ys[1])
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp(rows: usize, columns: usize) -> Array3<f64> {
        Array3::from_shape_fn((1, rows, columns), |(_, y, x)| (10 * y + x) as f64)
    }

    #[test]
    fn pooling_takes_the_mean_of_what_a_cell_spans() {
        // 3 × 5 cells under 2 × 3: the last column spans one cell, the last row too.
        let pooled = pool(ramp(3, 5).view(), 1, (2, 3));
        let expected = ndarray::array![[[5.5, 7.5, 9.0], [20.5, 22.5, 24.0]]];
        assert_eq!(pooled, expected);
    }

    #[test]
    fn interpolation_meets_the_centres_of_cells() {
        // One halving: centres of fine cells are a quarter away from those of coarse cells.
        let raised = interpolate(ramp(1, 3).view(), 1, (2, 6), AddressMode::Clamp);
        let row: Vec<f64> = raised.iter().take(6).copied().collect();
        assert_eq!(row, [0.0, 0.25, 0.75, 1.25, 1.75, 2.0]);
        let wrapped = interpolate(ramp(1, 3).view(), 1, (2, 6), AddressMode::Wrap);
        assert_eq!(wrapped[[0, 0, 0]], 0.5);
    }

    #[test]
    fn both_levels_have_the_same_places() {
        for (alignment, places) in [(Alignment::Pool, 6), (Alignment::Bilinear, 15)] {
            let (fine, coarse) = (ramp(3, 5), ramp(2, 3));
            let mode = AddressMode::Mirror;
            let both = examples(fine.view(), coarse.view(), 1, alignment, mode);
            assert_eq!(both.map(|b| b.dim()), [(places, 1); 2]);
        }
    }
}
