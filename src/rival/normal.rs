//! Normal: the third channel of a normal map, from the other two.
//!
//! Block codecs store the X and Y of a unit vector and leave Z = √(1 − X² − Y²) to the shader. That
//! is only right where the map's vectors are unit vectors. Published maps often are not: of the
//! scans tried, some have a blue channel of another range, and a mip made as a mean of codes has
//! vectors shorter than 1.

use crate::texture_set::{Encoding, Map, TextureSet};
use ndarray::{Array2, ArrayView2, Axis, Zip};

/// The largest root mean square of the reconstruction's error, in codes of 8 bits, at which the
/// third channel counts as following from the two. Storing three channels at 8 bits and coding them
/// as JPEG at high quality leaves one to two.
pub const TOLERANCE: f64 = 2.0;

/// Whether all three channels of `map` can be had from the first two, over the whole chain.
#[must_use]
pub fn third_follows(set: &TextureSet, map: &Map) -> bool {
    let is_normal = match map.encoding {
        Encoding::NormalGl | Encoding::NormalDx => true,
        Encoding::Srgb | Encoding::Linear => false,
    };
    if !is_normal || map.channel_count != 3 {
        return false;
    }
    let [x, y, z] = [0, 1, 2].map(|channel| map.first_channel + channel);
    let (mut sum, mut count) = (0.0, 0_usize);
    for mip in &set.texels {
        let plane = |channel| mip.index_axis(Axis(0), channel);
        let third = third(plane(x), plane(y));
        Zip::from(&third).and(plane(z)).for_each(|&found, &stored| {
            sum += (f64::from(found) - f64::from(stored)).powi(2);
        });
        count += third.len();
    }
    255.0 * (sum / count as f64).sqrt() <= TOLERANCE
}

/// The third channel, 0..=1, from the first two: (1 + √max(0, 1 − X² − Y²)) / 2 with X = 2·code − 1.
#[must_use]
pub fn third(x: ArrayView2<'_, f32>, y: ArrayView2<'_, f32>) -> Array2<f32> {
    Zip::from(x).and(y).map_collect(|&x, &y| {
        let (x, y) = (2.0 * f64::from(x) - 1.0, 2.0 * f64::from(y) - 1.0);
        let z = (1.0 - x * x - y * y).max(0.0).sqrt();
        ((1.0 + z) / 2.0) as f32
    })
}
