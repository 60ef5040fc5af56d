//! The mip chain of a texture set.

use ndarray::{Array3, ArrayView3, Axis};

/// Number of mips of a set of this size: M + 1 with M = floor(log2(max(width, height))) − 2, at
/// least 1. The chain of the paper ends at 4 × 4 texels, so a 2048² set has 10 mips.
#[must_use]
pub fn mip_count(width: u32, height: u32) -> u8 {
    let log2 = width.max(height).max(1).ilog2();
    // At most 31 − 2 + 1.
    log2.saturating_sub(2) as u8 + 1
}

/// All mips of `mip0` (`[channel, row, column]`, at least one row and column), `mip0` first.
///
/// Mip m has `max(1, width >> m)` columns and `max(1, height >> m)` rows. Each texel is the mean
/// of 2 × 2 texels of the mip before, taken over the stored codes in f32 and not quantised again.
/// Where a size is odd the last row or column of the finer mip is dropped; where it is 1 it
/// stands in for its missing neighbour.
#[must_use]
pub fn mip_chain(mip0: Array3<f32>) -> Vec<Array3<f32>> {
    let (_, height, width) = mip0.dim();
    let side = |size: usize| u32::try_from(size).unwrap_or(u32::MAX);
    let count = usize::from(mip_count(side(width), side(height)));
    let mut chain = Vec::with_capacity(count);
    let mut finest = mip0;
    for _ in 1..count {
        let next = halve(finest.view());
        chain.push(std::mem::replace(&mut finest, next));
    }
    chain.push(finest);
    chain
}

fn halve(fine: ArrayView3<'_, f32>) -> Array3<f32> {
    let (channels, height, width) = fine.dim();
    let mut coarse = Array3::zeros((channels, (height / 2).max(1), (width / 2).max(1)));
    for (fine, mut coarse) in fine.outer_iter().zip(coarse.outer_iter_mut()) {
        for (y, mut row) in coarse.axis_iter_mut(Axis(0)).enumerate() {
            let above = fine.row((2 * y).min(height - 1));
            let below = fine.row((2 * y + 1).min(height - 1));
            for (x, texel) in row.iter_mut().enumerate() {
                let (left, right) = ((2 * x).min(width - 1), (2 * x + 1).min(width - 1));
                *texel = ((above[left] + above[right]) + (below[left] + below[right])) * 0.25;
            }
        }
    }
    coarse
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::array;

    #[test]
    fn the_chain_ends_at_four_texels() {
        assert_eq!(mip_count(2048, 2048), 10);
        assert_eq!(mip_count(1024, 256), 9);
        assert_eq!(mip_count(8, 1), 2);
        assert_eq!(mip_count(7, 7), 1);
        assert_eq!(mip_count(1, 1), 1);
        assert_eq!(mip_count(16384, 16384), 13);
    }

    #[test]
    fn a_texel_is_the_mean_of_four() {
        let fine = array![[[0.0, 1.0, 0.5, 0.5], [0.25, 0.75, 0.0, 1.0]]];
        assert_eq!(halve(fine.view()), array![[[0.5, 0.5]]]);
    }

    #[test]
    fn an_odd_row_and_column_are_dropped() {
        let fine = array![[[0.0, 1.0, 9.0], [1.0, 0.0, 9.0], [9.0, 9.0, 9.0]]];
        assert_eq!(halve(fine.view()), array![[[0.5]]]);
    }

    #[test]
    fn a_single_row_stands_in_for_its_neighbour() {
        let fine = array![[[0.0, 1.0, 0.25, 0.75]]];
        assert_eq!(halve(fine.view()), array![[[0.5, 0.5]]]);
        assert_eq!(
            halve(fine.permuted_axes([0, 2, 1]).view()),
            array![[[0.5], [0.5]]]
        );
    }

    #[test]
    fn sizes_halve_rounding_down() {
        let sizes: Vec<_> = mip_chain(Array3::zeros((2, 5, 37)))
            .iter()
            .map(|mip| mip.dim())
            .collect();
        assert_eq!(sizes, [(2, 5, 37), (2, 2, 18), (2, 1, 9), (2, 1, 4)]);
    }
}
