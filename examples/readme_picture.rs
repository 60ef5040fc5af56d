//! Makes the README's picture, `assets/study.jpg`: three maps of the built-in set, from left to
//! right the source, the decoded texels, and eight times their difference.
//!
//! `cargo run --release --example readme_picture`

use image::{Rgb, RgbImage};
use ndarray::{Array3, ArrayView3, Axis, Slice};
use ntmu::built_in;
use ntmu::decoded::Decoded;

/// Maps shown, top to bottom.
const MAPS: [&str; 3] = ["color", "normal", "height"];
/// How much a difference is enlarged.
const AMPLIFICATION: f32 = 8.0;
/// Pixels between pictures.
const GAP: u32 = 8;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let asset = built_in::asset()?;
    let source = built_in::source().texels.swap_remove(0);
    let decoded = Decoded::of_mip(&asset, 0)
        .reals(&asset.shape)
        .swap_remove(0);
    let difference = Array3::from_shape_fn(source.dim(), |at| {
        (AMPLIFICATION * (source[at] - decoded[at]).abs()).min(1.0)
    });

    let (_, height, width) = source.dim();
    let (width, height) = (width as u32, height as u32);
    let rows = MAPS.len() as u32;
    let background = Rgb([255, 255, 255]);
    let mut sheet = RgbImage::from_pixel(
        3 * width + 2 * GAP,
        rows * height + (rows - 1) * GAP,
        background,
    );
    for (row, name) in (0..).zip(MAPS) {
        let map = asset.metadata.maps.iter().find(|map| map.name == name);
        let map = map.ok_or_else(|| format!("the built-in asset has no map {name:?}"))?;
        let first = usize::from(map.first_channel);
        let channels = Slice::from(first..first + usize::from(map.channel_count));
        for (column, texels) in (0..).zip([&source, &decoded, &difference]) {
            let texels = texels.slice_axis(Axis(0), channels);
            paint(
                &mut sheet,
                texels,
                column * (width + GAP),
                row * (height + GAP),
            );
        }
    }
    sheet.save("assets/study.jpg")?;
    Ok(())
}

/// Paints a map of one or three channels with its upper left corner at (`left`, `top`).
fn paint(sheet: &mut RgbImage, texels: ArrayView3<'_, f32>, left: u32, top: u32) {
    let (channels, height, width) = texels.dim();
    for y in 0..height {
        for x in 0..width {
            let pixel = [0, 1, 2]
                .map(|c: usize| (255.0 * texels[[c.min(channels - 1), y, x]]).round() as u8);
            sheet.put_pixel(left + x as u32, top + y as u32, Rgb(pixel));
        }
    }
}
