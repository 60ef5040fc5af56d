//! Interpolate: four corners become one latent vector, rounded as the profile says.

use super::position::Corners;
use ntmu_isa::Asset;
use ntmu_isa::embed::lerp_input;

/// Writes one input per channel of the grid; gives their number.
pub(super) fn lerp(
    asset: &Asset,
    grid: usize,
    codes: &[u8],
    corners: &Corners,
    lanes: &mut [i16],
) -> usize {
    let shape = asset.shape.grids[grid];
    let channels = usize::from(shape.channels);
    let fractions = corners.fractions(asset.profile.subtexel_bits);
    for (channel, lane) in lanes[..channels].iter_mut().enumerate() {
        let values = [0, 1, 2, 3]
            .map(|corner: usize| shape.format.value(codes[corner * channels + channel]));
        let (format, bits) = (shape.format, asset.shape.input_bits);
        *lane = lerp_input(values, fractions, format, bits, &asset.profile) as i16;
    }
    channels
}
