//! Image: every texel of a texel block, or of a mip.

use super::Decoder;
use super::machine::Machine;
use crate::request::{BLOCK, Request, RequestError};
use ndarray::parallel::prelude::*;
use ndarray::{Array3, Axis};

impl Decoder<'_> {
    /// The channel codes of one texel block, counted in blocks from the mip's first texel:
    /// \[channel, row, column\], 4×4 texels, fewer at the edge of a mip.
    ///
    /// # Errors
    /// When the mip or the block does not exist.
    pub fn block(&self, column: u32, row: u32, mip: u8) -> Result<Array3<i32>, RequestError> {
        let shape = &self.asset().shape;
        let (left, top) = (column.saturating_mul(BLOCK), row.saturating_mul(BLOCK));
        Request::new(shape, left, top, mip)?;
        let (width, height) = shape.mip_size(mip);
        let (columns, rows) = (BLOCK.min(width - left), BLOCK.min(height - top));
        let size = (shape.outputs.len(), rows as usize, columns as usize);
        let mut codes = Array3::zeros(size);
        let mut machine = Machine::new(self);
        for (row, mut texels) in (top..).zip(codes.axis_iter_mut(Axis(1))) {
            for (column, mut texel) in (left..).zip(texels.axis_iter_mut(Axis(1))) {
                let emitted = machine.texel(Request::within(column, row, mip), &mut ());
                for (code, &value) in texel.iter_mut().zip(emitted) {
                    *code = value;
                }
            }
        }
        Ok(codes)
    }

    /// The channel codes of a mip: \[channel, row, column\]. `mip` is below the chain's length.
    ///
    /// Rows of texel blocks are decoded in parallel; the codes do not depend on it.
    #[must_use]
    pub fn mip(&self, mip: u8) -> Array3<i32> {
        let shape = &self.asset().shape;
        let (width, height) = shape.mip_size(mip);
        let channels = shape.outputs.len();
        let mut codes = Array3::zeros((channels, height as usize, width as usize));
        codes
            .axis_chunks_iter_mut(Axis(1), BLOCK as usize)
            .into_par_iter()
            .enumerate()
            .for_each(|(block_row, mut rows)| {
                let mut machine = Machine::new(self);
                for (row, mut texels) in rows.axis_iter_mut(Axis(1)).enumerate() {
                    let y = block_row as u32 * BLOCK + row as u32;
                    for (x, mut texel) in texels.axis_iter_mut(Axis(1)).enumerate() {
                        let request = Request::within(x as u32, y, mip);
                        let emitted = machine.texel(request, &mut ());
                        for (code, &value) in texel.iter_mut().zip(emitted) {
                            *code = value;
                        }
                    }
                }
            });
        codes
    }
}
