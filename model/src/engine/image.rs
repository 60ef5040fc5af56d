//! Image: every texel of a texel block, of a run of rows, or of a mip.

use super::embed::Axes;
use super::kernel::TILE;
use super::tile::TileScratch;
use super::{Engine, Inputs};
use crate::request::{BLOCK, Request, RequestError};
use ndarray::parallel::prelude::*;
use ndarray::{Array3, ArrayView3, ArrayViewMut3, Axis, s};

/// Texels of a strip, the part of an image that one thread decodes at a time: enough that what is
/// prepared for each of them does not count.
const STRIP_TEXELS: u32 = 8192;

/// Texels of a band of [`Engine::bands`]: at 16 channels of 32 bits, 16 MiB.
const BAND_TEXELS: u32 = 1 << 18;

impl Engine<'_> {
    /// The channel codes of one texel block, as `exec::Decoder::block` gives them: counted in
    /// blocks from the mip's first texel, \[channel, row, column\], fewer at the edge of a mip.
    ///
    /// # Errors
    /// When the mip or the block does not exist.
    pub fn block(&self, column: u32, row: u32, mip: u8) -> Result<Array3<i32>, RequestError> {
        let shape = &self.asset.shape;
        let (left, top) = (column.saturating_mul(BLOCK), row.saturating_mul(BLOCK));
        Request::new(shape, left, top, mip)?;
        let (width, height) = shape.mip_size(mip);
        let (columns, rows) = (BLOCK.min(width - left), BLOCK.min(height - top));
        let size = (shape.outputs.len(), rows as usize, columns as usize);
        let mut codes = Array3::zeros(size);
        let axis_x = Axes::new(self.asset, false, (left, columns), mip);
        self.strip(&axis_x, (left, top), mip, codes.view_mut());
        Ok(codes)
    }

    /// The channel codes of a mip: \[channel, row, column\]. `mip` is below the chain's length.
    ///
    /// Strips of rows are decoded in parallel; the codes do not depend on it.
    #[must_use]
    pub fn mip(&self, mip: u8) -> Array3<i32> {
        let (width, height) = self.asset.shape.mip_size(mip);
        let channels = self.asset.shape.outputs.len();
        let mut codes = Array3::zeros((channels, height as usize, width as usize));
        let axis_x = Axes::new(self.asset, false, (0, width), mip);
        self.rows(&axis_x, 0, mip, codes.view_mut());
        codes
    }

    /// The channel codes of a mip, band after band of rows: `receive` gets the first row of each
    /// and its codes, \[channel, row, column\]. Memory stays bounded whatever the mip's size.
    pub fn bands(&self, mip: u8, mut receive: impl FnMut(u32, ArrayView3<'_, i32>)) {
        let (width, height) = self.asset.shape.mip_size(mip);
        let most = (BAND_TEXELS / width).clamp(1, height);
        let channels = self.asset.shape.outputs.len();
        let mut codes = Array3::zeros((channels, most as usize, width as usize));
        let axis_x = Axes::new(self.asset, false, (0, width), mip);
        for first in (0..height).step_by(most as usize) {
            let rows = most.min(height - first) as usize;
            self.rows(&axis_x, first, mip, codes.slice_mut(s![.., ..rows, ..]));
            receive(first, codes.slice(s![.., ..rows, ..]));
        }
    }

    /// Whole rows from `first` on, strips of them in parallel.
    fn rows(&self, axis_x: &Axes, first: u32, mip: u8, mut codes: ArrayViewMut3<'_, i32>) {
        let (width, _) = self.asset.shape.mip_size(mip);
        let rows = (STRIP_TEXELS / width).max(1);
        codes
            .axis_chunks_iter_mut(Axis(1), rows as usize)
            .into_par_iter()
            .enumerate()
            .for_each(|(strip, codes)| {
                self.strip(axis_x, (0, first + strip as u32 * rows), mip, codes);
            });
    }

    /// The texels of a rectangle, one row after the other, a tile at a time.
    fn strip(
        &self,
        axis_x: &Axes,
        (left, top): (u32, u32),
        mip: u8,
        mut codes: ArrayViewMut3<'_, i32>,
    ) {
        let (_, rows, columns) = codes.dim();
        let axis_y = Axes::new(self.asset, true, (top, rows as u32), mip);
        let mut scratch = TileScratch::new(self);
        let texels = rows * columns;
        for first in (0..texels).step_by(TILE) {
            let count = TILE.min(texels - first);
            for (row, column, at, length) in pieces(first, count, columns) {
                let place = (left + column as u32, top + row as u32, mip);
                let axes = (axis_x, &axis_y);
                let (register, texels) = (scratch.inputs(), (at, length));
                match &self.inputs {
                    Inputs::Bytes(embed) => {
                        let quads = &mut register.quads;
                        embed.run(self.asset, self.kernels, axes, place, texels, quads);
                    }
                    Inputs::Words(embed) => {
                        let pairs = &mut register.pairs;
                        embed.run(self.asset, self.kernels, axes, place, texels, pairs);
                    }
                }
            }
            self.tile(&mut scratch);
            for (mut plane, sums) in codes.outer_iter_mut().zip(scratch.codes()) {
                // Whole rows of a plane lie behind each other, as their texels do in a tile.
                if let Some(plane) = plane.as_slice_mut() {
                    plane[first..first + count].copy_from_slice(&sums.0[..count]);
                    continue;
                }
                for (row, column, at, length) in pieces(first, count, columns) {
                    let mut to = plane.slice_mut(s![row, column..column + length]);
                    match to.as_slice_mut() {
                        Some(to) => to.copy_from_slice(&sums.0[at..at + length]),
                        None => to.iter_mut().zip(&sums.0[at..]).for_each(|(t, &f)| *t = f),
                    }
                }
            }
        }
    }
}

/// The pieces of rows in `count` texels from the `first` of a rectangle on, row after row: the row,
/// the first column, the first texel of the tile, how many.
fn pieces(
    first: usize,
    count: usize,
    columns: usize,
) -> impl Iterator<Item = (usize, usize, usize, usize)> {
    let mut at = 0;
    std::iter::from_fn(move || {
        let (row, column) = ((first + at) / columns, (first + at) % columns);
        let length = (count - at).min(columns - column);
        let piece = (row, column, at, length);
        at += length;
        (length > 0).then_some(piece)
    })
}
