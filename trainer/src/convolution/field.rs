//! Field: images with the channels of a position together, rows padded for the kernels, and a
//! border of zeros.

use crate::kernel::ROWS;
use rayon::prelude::*;

/// `[item][plane][row][column][channel]`. A field of four planes holds an image by the parity of
/// its rows and columns: plane 2·(row mod 2) + (column mod 2). Whatever lies outside the rows and
/// columns is zero.
#[derive(Clone, Debug)]
pub(crate) struct Field {
    pub(crate) items: usize,
    pub(crate) planes: usize,
    /// Rows and columns of a plane without its border.
    pub(crate) rows: usize,
    pub(crate) columns: usize,
    /// Rows and columns of zeros on every side.
    pub(crate) border: usize,
    /// Channels, with those that only pad.
    pub(crate) channels: usize,
    data: Vec<f32>,
}

impl Field {
    /// Zeros.
    pub(crate) fn zero(
        (items, planes): (usize, usize),
        (rows, columns): (usize, usize),
        border: usize,
        channels: usize,
    ) -> Field {
        let mut field = Field {
            items,
            planes,
            rows,
            columns,
            border,
            channels,
            data: Vec::new(),
        };
        field.data = vec![0.0; items * planes * (rows + 2 * border) * field.row_len()];
        field
    }

    /// Columns that the kernels write: a multiple of [`ROWS`].
    pub(crate) const fn width(&self) -> usize {
        self.columns.next_multiple_of(ROWS)
    }

    const fn row_len(&self) -> usize {
        (self.width() + 2 * self.border) * self.channels
    }

    /// [`Field::width`] positions of a row, both counted from the border's first.
    #[inline(always)]
    pub(crate) fn part(&self, item: usize, plane: usize, row: usize, column: usize) -> &[f32] {
        let rows = self.rows + 2 * self.border;
        let row = (item * self.planes + plane) * rows + row;
        let start = row * self.row_len() + column * self.channels;
        &self.data[start..start + self.width() * self.channels]
    }

    /// A row without its border.
    #[inline(always)]
    pub(crate) fn row(&self, item: usize, plane: usize, row: usize) -> &[f32] {
        self.part(item, plane, row + self.border, self.border)
    }

    /// Calls `each(item, plane, row, positions)` for every row without its border, in parallel, and
    /// clears what it left beyond the columns.
    pub(crate) fn fill(&mut self, each: impl Fn(usize, usize, usize, &mut [f32]) + Sync) {
        let (border, channels) = (self.border, self.channels);
        let (width, columns) = (self.width(), self.columns);
        let (rows, planes) = (self.rows, self.planes);
        let row_len = self.row_len();
        let all = self.data.par_chunks_mut(row_len).enumerate();
        all.for_each(|(index, positions)| {
            let (plane, row) = (index / (rows + 2 * border), index % (rows + 2 * border));
            if row < border || row >= rows + border {
                return;
            }
            let positions = &mut positions[border * channels..(border + width) * channels];
            each(plane / planes, plane % planes, row - border, positions);
            positions[columns * channels..].fill(0.0);
        });
    }

    /// A field of one plane as four, for a kernel of 5×5 at every second position.
    pub(crate) fn split(&self) -> Field {
        let sides = (self.rows / 2, self.columns / 2);
        let mut out = Field::zero((self.items, 4), sides, 1, self.channels);
        let channels = self.channels;
        out.fill(|item, plane, row, positions| {
            let from = self.row(item, 0, 2 * row + plane / 2);
            let pairs = from.chunks_exact(2 * channels);
            for (to, pair) in positions.chunks_exact_mut(channels).zip(pairs) {
                to.copy_from_slice(&pair[plane % 2 * channels..][..channels]);
            }
        });
        out
    }

    /// The way back of [`Field::split`], into a field with this border.
    pub(crate) fn join(&self, border: usize) -> Field {
        let sides = (2 * self.rows, 2 * self.columns);
        let mut out = Field::zero((self.items, 1), sides, border, self.channels);
        let channels = self.channels;
        out.fill(|item, _, row, positions| {
            let [even, odd] = [0, 1].map(|column| self.row(item, row % 2 * 2 + column, row / 2));
            let pairs = even.chunks_exact(channels).zip(odd.chunks_exact(channels));
            for (to, (even, odd)) in positions.chunks_exact_mut(2 * channels).zip(pairs) {
                to[..channels].copy_from_slice(even);
                to[channels..].copy_from_slice(odd);
            }
        });
        out
    }

    /// A field of one plane from `[item][channel][row][column]`, each number through `map`.
    pub(crate) fn from_planar(
        numbers: &[f32],
        [items, count, rows, columns]: [usize; 4],
        (border, channels): (usize, usize),
        map: impl Fn(f32) -> f32 + Sync,
    ) -> Field {
        let mut out = Field::zero((items, 1), (rows, columns), border, channels);
        out.fill(|item, _, row, positions| {
            for channel in 0..count {
                let start = ((item * count + channel) * rows + row) * columns;
                let from = &numbers[start..start + columns];
                for (to, &number) in positions.chunks_exact_mut(channels).zip(from) {
                    to[channel] = map(number);
                }
            }
        });
        out
    }

    /// The first `count` channels of a field of one plane, `[item][channel][row][column]`.
    pub(crate) fn to_planar(&self, count: usize) -> Vec<f32> {
        let (rows, columns) = (self.rows, self.columns);
        let mut out = vec![0.0; self.items * count * rows * columns];
        let all = out.par_chunks_mut(columns).enumerate();
        all.for_each(|(index, to)| {
            let (plane, row) = (index / rows, index % rows);
            let from = self.row(plane / count, 0, row).chunks_exact(self.channels);
            for (to, from) in to.iter_mut().zip(from) {
                *to = from[plane % count];
            }
        });
        out
    }
}
