//! The mask: which texels count.

use super::error::MetricsError;
use crate::texture_set::mip_chain;
use ndarray::{Array2, ArrayView2, Axis};

/// Weights of 0 or 1, one plane \[row, column\] per mip, mip 0 first. A set whose maps do not
/// cover the whole image, an atlas, is measured where it is covered.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mask {
    planes: Vec<Array2<bool>>,
}

impl Mask {
    /// A mask of these planes. That they fit is checked where the mask is used.
    #[must_use]
    pub fn new(planes: Vec<Array2<bool>>) -> Mask {
        Mask { planes }
    }

    /// The mask of a coverage of mip 0, 0..=1, at least one row and column: its mips are those of a
    /// map, and a texel counts where it is at least one half, as an alpha test has it.
    #[must_use]
    pub fn of_coverage(coverage: Array2<f32>) -> Mask {
        let chain = mip_chain(coverage.insert_axis(Axis(0)));
        let planes = chain
            .iter()
            .map(|mip| mip.index_axis(Axis(0), 0).mapv(|value| value >= 0.5));
        Mask::new(planes.collect())
    }

    /// The plane of a mip of this many rows and columns.
    pub(super) fn plane(
        &self,
        mip: usize,
        size: (usize, usize),
    ) -> Result<ArrayView2<'_, bool>, MetricsError> {
        let Some(plane) = self.planes.get(mip) else {
            return Err(MetricsError::MaskMips {
                found: self.planes.len(),
                allowed: mip + 1,
            });
        };
        if plane.dim() != size {
            return Err(MetricsError::MaskShape {
                mip,
                found: plane.dim(),
                allowed: size,
            });
        }
        Ok(plane.view())
    }

    /// Share of mip 0 that counts, 0 to 1.
    #[must_use]
    pub fn share(&self) -> f64 {
        self.planes.first().map_or(0.0, |plane| {
            let counted = plane.iter().filter(|counts| **counts).count();
            counted as f64 / plane.len().max(1) as f64
        })
    }

    /// Whether any texel of a mip counts.
    #[must_use]
    pub fn covers(&self, mip: usize) -> bool {
        self.planes
            .get(mip)
            .is_some_and(|plane| plane.iter().any(|counts| *counts))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mip_counts_where_at_least_half_of_it_is_covered() {
        // Columns 0 to 4 of 8: half of mip 1's third column is covered, a quarter of mip 2's second.
        let coverage = Array2::from_shape_fn((8, 8), |(_, x)| f32::from(u8::from(x < 5)));
        let mask = Mask::of_coverage(coverage);
        assert_eq!(mask.planes.len(), 2);
        assert_eq!(
            mask.planes[0].row(0).to_vec(),
            [[true; 5].as_slice(), &[false; 3]].concat()
        );
        assert_eq!(mask.planes[1].row(3).to_vec(), [true, true, true, false]);
        assert_eq!(mask.share(), 0.625);
        assert!(mask.covers(0) && !mask.covers(2));
    }
}
