//! The project's own texture set: a brick wall, generated.
//!
//! Runs, tests and benchmarks need a material that is always there and whose licence is the
//! project's. It has nine channels (colour, normal, roughness, height, occlusion), repeats
//! exactly in both directions, and is hard in the ways scans are: flat faces beside sharp edges,
//! sand down to single texels, stains that only colour shows, channels that depend on each other
//! (normal and occlusion are computed from height) without being copies. The same size and seed
//! give the same codes on every platform.

use ndarray::{Array2, Array3, Axis};
use rayon::prelude::*;

use crate::texture_set::{Encoding, MAX_SIZE, Map, TextureSet, mip_chain};

mod masonry;
mod noise;
mod shading;
mod surface;

/// Texels a side when nothing else is asked for.
pub const DEFAULT_SIZE: u32 = 256;

/// Name, channels and encoding of the maps, in channel order.
const MAPS: [(&str, usize, Encoding); 5] = [
    ("color", 3, Encoding::Srgb),
    ("normal", 3, Encoding::NormalGl),
    ("roughness", 1, Encoding::Linear),
    ("height", 1, Encoding::Linear),
    ("occlusion", 1, Encoding::Linear),
];
const CHANNELS: usize = 9;

/// The brick wall with `size` × `size` texels, 8-bit codes in every channel, and its mips. The
/// same seed shows the same wall at every size; only the finest grain follows the texels.
///
/// # Panics
///
/// If `size` is not a power of two from 1 to [`MAX_SIZE`].
#[must_use]
pub fn generate(size: u32, seed: u64) -> TextureSet {
    assert!(
        size.is_power_of_two() && size <= MAX_SIZE,
        "size: found {size}, allowed are powers of two from 1 to {MAX_SIZE}"
    );
    let side = size as usize;
    let seed = noise::hash(seed, 0, 0);
    let mut mip0 = Array3::zeros((CHANNELS, side, side));
    let mut height = Array2::zeros((side, side));
    let centre = |texel: usize| (texel as f64 + 0.5) / f64::from(size);

    let rows: Vec<_> = mip0
        .axis_iter_mut(Axis(1))
        .zip(height.outer_iter_mut())
        .collect();
    rows.into_par_iter()
        .enumerate()
        .for_each(|(row, (mut codes, mut heights))| {
            for column in 0..side {
                let texel = surface::at(seed, centre(column), centre(row), size);
                for (channel, value) in texel.color.into_iter().enumerate() {
                    codes[[channel, column]] = code(value / 255.0);
                }
                codes[[6, column]] = code(texel.roughness);
                codes[[7, column]] = code(texel.height);
                heights[column] = texel.height.clamp(0.0, 1.0);
            }
        });
    let rows: Vec<_> = mip0.axis_iter_mut(Axis(1)).collect();
    rows.into_par_iter()
        .enumerate()
        .for_each(|(row, mut codes)| {
            for column in 0..side {
                for (channel, value) in shading::normal(&height, row, column)
                    .into_iter()
                    .enumerate()
                {
                    codes[[3 + channel, column]] = code(value * 0.5 + 0.5);
                }
                codes[[8, column]] = code(shading::occlusion(&height, row, column));
            }
        });

    let mut first_channel = 0;
    let maps = MAPS.map(|(name, channel_count, encoding)| {
        let file = format!("{name}.png");
        let map = Map {
            name: name.to_owned(),
            file,
            first_channel,
            channel_count,
            bit_depth: 8,
            encoding,
        };
        first_channel += channel_count;
        map
    });
    TextureSet {
        name: "brick wall".to_owned(),
        width: size,
        height: size,
        maps: maps.into(),
        texels: mip_chain(mip0),
        skipped: Vec::new(),
    }
}

/// The nearest 8-bit code, divided by 255.
fn code(value: f64) -> f32 {
    // Adding a half and cutting is exact here; the cast saturates.
    f32::from((value * 255.0 + 0.5) as u8) / 255.0
}

#[cfg(test)]
mod tests;
