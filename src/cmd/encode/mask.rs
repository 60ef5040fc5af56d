//! Mask: which texels count, from a map of the set or an image file.

use super::Encode;
use anyhow::Context as _;
use ndarray::Array2;
use ntmu::trainer::Source;
use std::path::Path;

impl Encode {
    /// Does to the source what the flags say before any step sees it.
    pub(super) fn prepare(&self, source: &mut Source) -> anyhow::Result<()> {
        if let Some(mask) = &self.mask {
            let is_map = source.maps.iter().any(|map| map.name == *mask);
            if !is_map && Path::new(mask).is_file() {
                source.mask = Some(read(Path::new(mask))?);
            } else {
                source.mask_with(mask).context("--mask")?;
            }
        }
        for map in &self.renormalise {
            source.renormalise(map).context("--renormalise")?;
        }
        source.validate()?;
        Ok(())
    }
}

/// The texels of an image that are not zero: in its alpha, where it has one, or in any colour.
fn read(path: &Path) -> anyhow::Result<Array2<bool>> {
    let image = image::ImageReader::open(path)
        .with_context(|| format!("{}", path.display()))?
        .with_guessed_format()?
        .decode()
        .with_context(|| format!("{}", path.display()))?;
    let has_alpha = image.color().has_alpha();
    let texels = image.to_rgba16();
    let (width, height) = texels.dimensions();
    Ok(Array2::from_shape_fn(
        (height as usize, width as usize),
        |(row, column)| {
            let [red, green, blue, alpha] = texels.get_pixel(column as u32, row as u32).0;
            if has_alpha {
                alpha != 0
            } else {
                red != 0 || green != 0 || blue != 0
            }
        },
    ))
}
