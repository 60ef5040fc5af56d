//! The level: the latents of one level of a grid as reals.

use ndarray::Array3;
use ntmu_isa::Asset;

/// The latents of a level of a grid, \[channel, row, column\], as the reals that their codes stand
/// for: −(2^B−1)/2^(B+1) to 1/2. `None` where the asset has no such level.
#[must_use]
pub fn level_reals(asset: &Asset, grid: usize, level: u8) -> Option<Array3<f64>> {
    let shape = &asset.shape;
    if grid >= asset.grids.len() || level >= shape.level_count() {
        return None;
    }
    let (columns, rows) = shape.level_size(grid, level);
    let (columns, rows) = (columns as usize, rows as usize);
    let base = usize::try_from(shape.level_base(grid, level)).ok()?;
    let channels = usize::from(shape.grids[grid].channels);
    let format = shape.grids[grid].format;
    let codes = asset.grids[grid].get(base..base + rows * columns * channels)?;
    let scale = f64::from(1_u16 << format.bits());
    Some(Array3::from_shape_fn(
        (channels, rows, columns),
        |(channel, row, column)| {
            let code = codes[(row * columns + column) * channels + channel];
            f64::from(format.value(code)) / scale
        },
    ))
}
