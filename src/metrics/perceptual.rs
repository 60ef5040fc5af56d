//! Perceptual: SSIMULACRA2 of sRGB colours.
//!
//! Version 2.1 of the metric (J. Sneyers, Cloudinary), through the `ssimulacra2` crate of rust-av:
//! 100 is equal, 90 hard to tell apart, 70 high, 50 medium, 30 low quality; there is no lowest score.

use ndarray::{ArrayView3, Axis};
use ssimulacra2::{ColorPrimaries, Rgb, TransferCharacteristic, compute_frame_ssimulacra2};

/// The least width and height of an image that is measured. The metric has weights for six scales,
/// each half of the one before, and its code stops at a scale narrower than 8 texels; with fewer
/// scales the weights of one go to another. ⌈113 / 2⁴⌉ is 8, ⌈112 / 2⁴⌉ is 7.
pub const LEAST_SIDE: usize = 113;

/// The score of an image of 3 channels, or of 1 that stands for all three; values are sRGB codes,
/// 0..=1, and clipped to that. `None` for other numbers of channels, shapes that differ, and
/// images with a side below [`LEAST_SIDE`].
#[must_use]
pub fn ssimulacra2(reference: ArrayView3<'_, f32>, test: ArrayView3<'_, f32>) -> Option<f64> {
    let (channels, rows, columns) = reference.dim();
    let measurable = (channels == 1 || channels == 3) && rows.min(columns) >= LEAST_SIDE;
    if !measurable || test.dim() != reference.dim() {
        return None;
    }
    compute_frame_ssimulacra2(colours(reference)?, colours(test)?).ok()
}

fn colours(image: ArrayView3<'_, f32>) -> Option<Rgb> {
    let (channels, rows, columns) = image.dim();
    let channel = |index: usize| image.index_axis_move(Axis(0), index.min(channels - 1));
    let [red, green, blue] = [channel(0), channel(1), channel(2)];
    let texels = red.iter().zip(green.iter()).zip(blue.iter());
    let data = texels.map(|((r, g), b)| [r, g, b].map(|code| code.clamp(0.0, 1.0)));
    Rgb::new(
        data.collect(),
        columns,
        rows,
        TransferCharacteristic::SRGB,
        ColorPrimaries::BT709,
    )
    .ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::{Array3, concatenate};

    fn image(rows: usize, columns: usize) -> Array3<f32> {
        Array3::from_shape_fn((3, rows, columns), |(c, y, x)| {
            ((3 * c + 7 * y + 5 * x + x * y) % 64) as f32 / 63.0
        })
    }

    #[test]
    fn equal_images_have_one_hundred_and_worse_ones_less() {
        let a = image(120, 130);
        assert_eq!(ssimulacra2(a.view(), a.view()), Some(100.0));
        let off = |most: f32| {
            let noise = |(c, y, x)| ((31 * c + 17 * y + 13 * x) % 11) as f32 / 10.0 - 0.5;
            let b = &a + &Array3::from_shape_fn(a.dim(), noise) * most;
            ssimulacra2(a.view(), b.view()).unwrap()
        };
        assert!(off(0.02) < 100.0);
        assert!(off(0.2) < off(0.02));
    }

    #[test]
    fn one_channel_is_grey() {
        let a = image(113, 113)
            .index_axis_move(Axis(0), 0)
            .insert_axis(Axis(0));
        let b = a.mapv(|v| v * 0.9);
        let three = |v: &Array3<f32>| concatenate![Axis(0), v.view(), v.view(), v.view()];
        assert_eq!(
            ssimulacra2(a.view(), b.view()),
            ssimulacra2(three(&a).view(), three(&b).view())
        );
    }

    #[test]
    fn what_is_too_small_or_no_colour_is_not_measured() {
        for (rows, columns) in [(112, 200), (200, 112), (1, 1)] {
            let small = image(rows, columns);
            assert_eq!(ssimulacra2(small.view(), small.view()), None);
        }
        let two = Array3::zeros((2, 120, 120));
        assert_eq!(ssimulacra2(two.view(), two.view()), None);
        assert_eq!(
            ssimulacra2(image(120, 120).view(), image(120, 121).view()),
            None
        );
    }
}
