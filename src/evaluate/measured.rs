//! Measured: a decoded set against its source.

use crate::metrics::MetricsError;
use crate::quality::{Quality, maps_of_set};
use crate::texture_set::TextureSet;
use ndarray::Array3;

/// The quality of a set after a codec, mip chain for mip chain.
pub(super) fn quality(set: &TextureSet, decoded: &[Array3<f32>]) -> Result<Quality, MetricsError> {
    Quality::measure(&set.texels, decoded, &maps_of_set(set))
}
