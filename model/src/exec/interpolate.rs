//! Interpolate: four corners become one latent vector, rounded once.

use ntmu_isa::Asset;
use ntmu_isa::embed::lerp_input;

/// Writes one input per channel of the grid; gives their number.
pub(super) fn lerp(
    asset: &Asset,
    grid: usize,
    codes: &[u8],
    weights: [i32; 4],
    lanes: &mut [i16],
) -> usize {
    let shape = asset.shape.grids[grid];
    let channels = usize::from(shape.channels);
    for (channel, lane) in lanes[..channels].iter_mut().enumerate() {
        let sum = weights
            .iter()
            .enumerate()
            .map(|(corner, weight)| weight * shape.format.value(codes[corner * channels + channel]))
            .sum();
        *lane = lerp_input(sum, shape.format, asset.profile.input) as i16;
    }
    channels
}
