//! SSIM: structural similarity, one channel at a time.

use super::error::MetricsError;
use super::mask::Mask;
use super::selection::select;
use ndarray::{Array3, ArrayView2};
use rayon::prelude::*;

/// Structural similarity over the selected channels and mips: the mean of [`ssim_plane`] weighted
/// by each mip's number of texels. 1 for equal sets.
///
/// # Errors
///
/// As [`psnr`](super::psnr).
pub fn ssim(
    reference: &[Array3<f32>],
    test: &[Array3<f32>],
    channels: &[usize],
    mips: &[usize],
) -> Result<f64, MetricsError> {
    ssim_within(reference, test, channels, mips, None)
}

/// [`ssim`] of the windows whose centre is in the mask; a mip weighs as many texels as it has
/// there. A mip of at least 11 × 11 without such a window does not count.
///
/// # Errors
///
/// As [`psnr_within`](super::psnr_within), also when no window counts.
pub fn ssim_within(
    reference: &[Array3<f32>],
    test: &[Array3<f32>],
    channels: &[usize],
    mips: &[usize],
    mask: Option<&Mask>,
) -> Result<f64, MetricsError> {
    let planes = select(reference, test, channels, mips, mask)?;
    let scores: Vec<(f64, usize)> = planes
        .par_iter()
        .map(|planes| {
            let (total, windows) = windows_total(planes.reference, planes.test, planes.mask);
            if windows == 0 {
                return (0.0, 0);
            }
            let texels = planes.count();
            (texels as f64 * (total / windows as f64), texels)
        })
        .collect();
    let count: usize = scores.iter().map(|(_, texels)| texels).sum();
    if count == 0 {
        return Err(MetricsError::Empty);
    }
    Ok(scores.iter().map(|(score, _)| score).sum::<f64>() / count as f64)
}

/// Side of the SSIM window, in texels.
const WINDOW: usize = 11;

/// SSIM of two single-channel images of one shape (at least 1 × 1), after Wang et al. 2004:
/// 11 × 11 Gaussian window with σ = 1.5 and sum 1, K1 = 0.01, K2 = 0.03, L = 1, mean over all
/// window positions.
///
/// The window lies inside the image everywhere ("valid" positions). An image with fewer than 11
/// rows or columns has no such position: there the window is centred on every texel, cut at the
/// border and its weights are scaled to sum 1 again.
#[must_use]
pub fn ssim_plane(a: ArrayView2<'_, f32>, b: ArrayView2<'_, f32>) -> f64 {
    let (total, count) = windows_total(a, b, None);
    total / count as f64
}

/// The sum of the similarity over the window positions whose centre counts, and how many those are.
fn windows_total(
    a: ArrayView2<'_, f32>,
    b: ArrayView2<'_, f32>,
    mask: Option<ArrayView2<'_, bool>>,
) -> (f64, usize) {
    const C1: f64 = 0.01 * 0.01;
    const C2: f64 = 0.03 * 0.03;
    let (height, width) = a.dim();
    let whole = height >= WINDOW && width >= WINDOW;
    let (rows, columns) = (windows(height, whole), windows(width, whole));
    // Weighted sums over the rows of one window, per column: a, b, a², b², ab.
    let mut moments = vec![[0.0_f64; 5]; width];
    let (mut total, mut count) = (0.0, 0);
    let margin = if whole { WINDOW / 2 } else { 0 };
    for (row, (top, weights)) in rows.iter().enumerate() {
        moments.fill([0.0; 5]);
        for (offset, &weight) in weights.iter().enumerate() {
            let texels = a.row(top + offset).into_iter().zip(b.row(top + offset));
            for (sums, (&a, &b)) in moments.iter_mut().zip(texels) {
                let (a, b) = (f64::from(a), f64::from(b));
                let terms = [a, b, a * a, b * b, a * b];
                for (sum, term) in sums.iter_mut().zip(terms) {
                    *sum += weight * term;
                }
            }
        }
        for (column, (left, weights)) in columns.iter().enumerate() {
            if mask.is_some_and(|mask| !mask[[row + margin, column + margin]]) {
                continue;
            }
            count += 1;
            let mut sums = [0.0; 5];
            for (moment, &weight) in moments[*left..].iter().zip(weights) {
                for (sum, term) in sums.iter_mut().zip(moment) {
                    *sum += weight * term;
                }
            }
            let [mean_a, mean_b, aa, bb, ab] = sums;
            let variances = (aa - mean_a * mean_a) + (bb - mean_b * mean_b);
            let covariance = ab - mean_a * mean_b;
            let luminance = (2.0 * mean_a * mean_b + C1) / (mean_a * mean_a + mean_b * mean_b + C1);
            total += luminance * ((2.0 * covariance + C2) / (variances + C2));
        }
    }
    (total, count)
}

/// First texel and weights of every window position along an axis of `size` texels.
fn windows(size: usize, whole: bool) -> Vec<(usize, Vec<f64>)> {
    const RADIUS: usize = WINDOW / 2;
    let gauss = |offset: usize| {
        let distance = offset as f64 - RADIUS as f64;
        (-distance * distance / (2.0 * 1.5 * 1.5)).exp()
    };
    let centres = if whole {
        RADIUS..size - RADIUS
    } else {
        0..size
    };
    centres
        .map(|centre| {
            let first = centre.saturating_sub(RADIUS);
            let last = (centre + RADIUS).min(size - 1);
            let weights: Vec<f64> = (first..=last)
                .map(|texel| gauss(texel + RADIUS - centre))
                .collect();
            let sum: f64 = weights.iter().sum();
            (first, weights.iter().map(|weight| weight / sum).collect())
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::{Array2, Axis, Slice};

    #[test]
    fn ssim_of_equal_images_is_one() {
        for size in [(16, 20), (4, 4), (1, 1), (30, 3)] {
            let image = Array2::from_shape_fn(size, |(y, x)| ((7 * y + 3 * x) % 11) as f32 / 10.0);
            assert_eq!(ssim_plane(image.view(), image.view()), 1.0);
        }
    }

    #[test]
    fn ssim_of_two_constants_is_the_luminance_term() {
        // No variance: (2·a·b + C1) / (a² + b² + C1), up to the rounding of weights that sum to 1.
        let expected = (2.0 * 0.25 * 0.75 + 1e-4) / (0.0625 + 0.5625 + 1e-4);
        for size in [(11, 11), (40, 13), (4, 4)] {
            let (a, b) = (Array2::from_elem(size, 0.25), Array2::from_elem(size, 0.75));
            let found = ssim_plane(a.view(), b.view());
            // Each moment is off by at most 22 roundings; divided by C2 at worst.
            assert!(
                (found - expected).abs() < 44.0 * f64::EPSILON / 9e-4,
                "{found} {expected}"
            );
        }
    }

    #[test]
    fn ssim_of_one_window_matches_the_definition() {
        // 11 × 11 has one valid position; the definition is summed here in two dimensions.
        let a = Array2::from_shape_fn((11, 11), |(y, x)| ((5 * y + 3 * x) % 7) as f32 / 8.0);
        let b = Array2::from_shape_fn((11, 11), |(y, x)| ((2 * y + 3 * x) % 5) as f32 / 4.0);
        let weight = |(y, x): (usize, usize)| {
            let (y, x) = (y as f64 - 5.0, x as f64 - 5.0);
            (-(y * y + x * x) / 4.5).exp()
        };
        let norm: f64 = a.indexed_iter().map(|(at, _)| weight(at)).sum();
        let mean = |f: &dyn Fn(usize, usize) -> f64| -> f64 {
            a.indexed_iter()
                .map(|((y, x), _)| weight((y, x)) / norm * f(y, x))
                .sum()
        };
        let (va, vb) = (|y, x| f64::from(a[[y, x]]), |y, x| f64::from(b[[y, x]]));
        let (ma, mb) = (mean(&va), mean(&vb));
        let saa = mean(&|y, x| (va(y, x) - ma).powi(2));
        let sbb = mean(&|y, x| (vb(y, x) - mb).powi(2));
        let sab = mean(&|y, x| (va(y, x) - ma) * (vb(y, x) - mb));
        let expected = (2.0 * ma * mb + 1e-4) * (2.0 * sab + 9e-4)
            / ((ma * ma + mb * mb + 1e-4) * (saa + sbb + 9e-4));
        let found = ssim_plane(a.view(), b.view());
        // 121 roundings a sum, and every denominator here is above 0.01.
        assert!((found - expected).abs() < 4.0 * 121.0 * f64::EPSILON / 0.01);
    }

    #[test]
    fn a_window_is_cut_at_the_border_of_a_small_image() {
        let two = windows(2, false);
        let side = (-1.0_f64 / 4.5).exp();
        assert_eq!(two[0], (0, vec![1.0 / (1.0 + side), side / (1.0 + side)]));
        assert_eq!(two[1], (0, vec![side / (side + 1.0), 1.0 / (side + 1.0)]));
        assert_eq!(windows(11, true).len(), 1);
        assert_eq!(windows(64, true).len(), 54);
    }

    #[test]
    fn ssim_over_mips_is_weighted_by_texels() {
        let a = [
            Array3::from_elem((1, 12, 12), 0.5),
            Array3::from_elem((1, 6, 6), 0.5),
        ];
        let b = [a[0].clone(), Array3::zeros((1, 6, 6))];
        let small = ssim(&a, &b, &[0], &[1]).unwrap();
        assert_eq!(
            ssim(&a, &b, &[0], &[0, 1]),
            Ok((144.0 + 36.0 * small) / 180.0)
        );
    }

    #[test]
    fn a_mask_leaves_the_windows_that_are_centred_in_it() {
        // The right half differs by so much that its windows would pull the mean down.
        let a = Array3::from_shape_fn((1, 16, 40), |(_, y, x)| ((3 * y + 5 * x) % 7) as f32 / 7.0);
        let mut b = a.clone();
        b.slice_axis_mut(Axis(2), Slice::from(20..)).fill(0.0);
        let columns = |last: usize| {
            let plane = Array2::from_shape_fn((16, 40), |(_, x)| x < last);
            Mask::new(vec![plane])
        };
        let (a, b) = ([a], [b]);
        let within = |mask: &Mask| ssim_within(&a, &b, &[0], &[0], Some(mask));
        // A window centred at column 14 reaches column 19.
        assert_eq!(within(&columns(15)), Ok(1.0));
        assert!(within(&columns(16)).unwrap() < 1.0);
        let whole = ssim(&a, &b, &[0], &[0]);
        assert_eq!(within(&columns(40)), whole);
        assert_eq!(
            within(&columns(5)),
            Err(MetricsError::Empty),
            "no window is centred there"
        );
    }
}
