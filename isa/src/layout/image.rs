//! Image: the bytes of the grids as memory holds them.

use super::Layout;
use crate::shape::Shape;

impl Layout {
    /// The grids as memory holds them: [`Layout::total_bytes`] bytes, zeros between the codes.
    ///
    /// Of either grid `codes` has levels of rows of cells, cells of channels, as an asset has them. A code's
    /// bits above the grid's format are dropped; cells that are not there are zeros.
    #[must_use]
    pub fn pack(self, shape: &Shape, codes: [&[u8]; 2]) -> Vec<u8> {
        let mut image = vec![0; self.total_bytes(shape) as usize];
        for (grid, codes) in codes.into_iter().enumerate() {
            let g = shape.grids[grid];
            let cells = codes.chunks_exact(usize::from(g.channels));
            for (place, cell) in places(shape, grid).zip(cells) {
                for (bit, &code) in self.first_bits(shape, grid, place).zip(cell) {
                    let field = u16::from(code & g.format.max_code()) << (bit % 8);
                    for (byte, part) in image[(bit / 8) as usize..]
                        .iter_mut()
                        .zip(field.to_le_bytes())
                    {
                        *byte |= part;
                    }
                }
            }
        }
        image
    }

    /// Adds the codes of one cell, one for each channel, as they are read from memory. The cell, at
    /// (level, x, y), lies within the grid, the image is one of [`Layout::pack`] of the same shape; bytes
    /// beyond an image are zeros.
    pub fn cell(
        self,
        shape: &Shape,
        image: &[u8],
        grid: usize,
        cell: (u8, u32, u32),
        codes: &mut Vec<u8>,
    ) {
        let mask = shape.grids[grid].format.max_code();
        let byte = |at: u64| image.get(at as usize).copied().unwrap_or(0);
        codes.extend(self.first_bits(shape, grid, cell).map(|bit| {
            let field = u16::from_le_bytes([byte(bit / 8), byte(bit / 8 + 1)]);
            (field >> (bit % 8)) as u8 & mask
        }));
    }

    /// The codes of both grids, as an asset has them: the inverse of [`Layout::pack`].
    #[must_use]
    pub fn unpack(self, shape: &Shape, image: &[u8]) -> [Vec<u8>; 2] {
        [0, 1].map(|grid| {
            let mut codes = Vec::with_capacity(shape.grid_latents(grid) as usize);
            for cell in places(shape, grid) {
                self.cell(shape, image, grid, cell, &mut codes);
            }
            codes
        })
    }

    /// [`Layout::first_bit`] of each channel of a cell. From one to the next the distance is the same
    /// in every storage, so that the cell's place need not be found for each.
    fn first_bits(
        self,
        shape: &Shape,
        grid: usize,
        (level, x, y): (u8, u32, u32),
    ) -> impl Iterator<Item = u64> {
        let start = self.first_bit(shape, grid, level, x, y, 0);
        let step = self.first_bit(shape, grid, level, x, y, 1) - start;
        (0..u64::from(shape.grids[grid].channels)).map(move |channel| start + channel * step)
    }
}

/// The cells of a grid as (level, x, y): level after level, row after row.
fn places(shape: &Shape, grid: usize) -> impl Iterator<Item = (u8, u32, u32)> {
    (0..shape.level_count()).flat_map(move |level| {
        let (width, height) = shape.level_size(grid, level);
        (0..height).flat_map(move |y| (0..width).map(move |x| (level, x, y)))
    })
}
