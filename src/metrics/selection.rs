//! The selection: the planes of two sets that are compared.

use super::error::MetricsError;
use super::mask::Mask;
use ndarray::{Array3, ArrayView2, Axis};

/// One channel of one mip of both sets.
pub(super) struct PlanePair<'a> {
    pub(super) reference: ArrayView2<'a, f32>,
    pub(super) test: ArrayView2<'a, f32>,
    /// The texels that count; all of them without it.
    pub(super) mask: Option<ArrayView2<'a, bool>>,
}

impl PlanePair<'_> {
    /// Texels that count.
    pub(super) fn count(&self) -> usize {
        match self.mask {
            None => self.reference.len(),
            Some(mask) => mask.iter().filter(|counts| **counts).count(),
        }
    }
}

/// The selected planes of both sets, mips outermost.
pub(super) fn select<'a>(
    reference: &'a [Array3<f32>],
    test: &'a [Array3<f32>],
    channels: &[usize],
    mips: &[usize],
    mask: Option<&'a Mask>,
) -> Result<Vec<PlanePair<'a>>, MetricsError> {
    let allowed = reference.len().min(test.len());
    let mut planes = Vec::with_capacity(channels.len() * mips.len());
    for &mip in mips {
        let (Some(a), Some(b)) = (reference.get(mip), test.get(mip)) else {
            return Err(MetricsError::Mip {
                found: mip,
                allowed,
            });
        };
        if a.dim() != b.dim() {
            return Err(MetricsError::Shape {
                mip,
                found: b.dim(),
                allowed: a.dim(),
            });
        }
        let (_, rows, columns) = a.dim();
        let mask = match mask {
            None => None,
            Some(mask) => Some(mask.plane(mip, (rows, columns))?),
        };
        for &channel in channels {
            let allowed = a.len_of(Axis(0));
            if channel >= allowed {
                return Err(MetricsError::Channel {
                    found: channel,
                    allowed,
                });
            }
            planes.push(PlanePair {
                reference: a.index_axis(Axis(0), channel),
                test: b.index_axis(Axis(0), channel),
                mask,
            });
        }
    }
    if planes.iter().all(|planes| planes.count() == 0) {
        return Err(MetricsError::Empty);
    }
    Ok(planes)
}
