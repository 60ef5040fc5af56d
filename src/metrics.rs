//! How far a decoded texture set is from the original, and what it costs.
//!
//! Two sets are compared as mip chains: one array `[channel, row, column]` per mip, mip 0 first,
//! values in 0..=1 (stored code / largest code). PSNR, SSIM and BPPC follow the evaluation
//! section of the CNTC paper (ECCV 2024). All sums are taken in f64 in a fixed order, so the
//! same inputs give the same bits whatever the number of threads.

use ndarray::{Array3, ArrayView2, ArrayView3, Axis};
use rayon::prelude::*;

/// Why two sets cannot be compared.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MetricsError {
    /// The two arrays of one mip differ in shape.
    #[error("mip {mip}: found shape {found:?}, allowed is the reference's {allowed:?}")]
    Shape {
        /// The mip.
        mip: usize,
        /// Shape of the array under test: channels, rows, columns.
        found: (usize, usize, usize),
        /// Shape of the reference.
        allowed: (usize, usize, usize),
    },
    /// A mip was asked for that one of the sets lacks.
    #[error("mips: found {found}, allowed are 0 to {} (both sets have that many)", allowed.saturating_sub(1))]
    Mip {
        /// The mip asked for.
        found: usize,
        /// Number of mips both sets have.
        allowed: usize,
    },
    /// A channel was asked for that the sets lack.
    #[error("channels: found {found}, allowed is less than {allowed}")]
    Channel {
        /// The channel asked for.
        found: usize,
        /// Number of channels of the sets.
        allowed: usize,
    },
    /// No texel was selected.
    #[error("selection: found no texel, allowed is at least one channel of one mip")]
    Empty,
}

/// Peak signal-to-noise ratio in dB over the selected channels and mips:
/// −10·log10(Σ squared error / number of values), peak 1. Every value weighs the same, so mip 0
/// has three quarters of the weight of a full chain. Equal sets give infinity.
///
/// # Errors
///
/// [`MetricsError`] when a selected channel or mip does not exist in both sets, shapes differ, or
/// nothing is selected.
pub fn psnr(
    reference: &[Array3<f32>],
    test: &[Array3<f32>],
    channels: &[usize],
    mips: &[usize],
) -> Result<f64, MetricsError> {
    let planes = select(reference, test, channels, mips)?;
    let errors: Vec<f64> = planes
        .par_iter()
        .map(|(a, b)| squared_error(*a, *b))
        .collect();
    let count: usize = planes.iter().map(|(a, _)| a.len()).sum();
    Ok(-10.0 * (errors.iter().sum::<f64>() / count as f64).log10())
}

fn squared_error(a: ArrayView2<'_, f32>, b: ArrayView2<'_, f32>) -> f64 {
    a.iter()
        .zip(b.iter())
        .map(|(&a, &b)| (f64::from(a) - f64::from(b)).powi(2))
        .sum()
}

/// Structural similarity over the selected channels and mips: the mean of [`ssim_plane`] weighted
/// by each mip's number of texels. 1 for equal sets.
///
/// # Errors
///
/// As [`psnr`].
pub fn ssim(
    reference: &[Array3<f32>],
    test: &[Array3<f32>],
    channels: &[usize],
    mips: &[usize],
) -> Result<f64, MetricsError> {
    let planes = select(reference, test, channels, mips)?;
    let scores: Vec<f64> = planes
        .par_iter()
        .map(|(a, b)| a.len() as f64 * ssim_plane(*a, *b))
        .collect();
    let count: usize = planes.iter().map(|(a, _)| a.len()).sum();
    Ok(scores.iter().sum::<f64>() / count as f64)
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
    const C1: f64 = 0.01 * 0.01;
    const C2: f64 = 0.03 * 0.03;
    let (height, width) = a.dim();
    let whole = height >= WINDOW && width >= WINDOW;
    let (rows, columns) = (windows(height, whole), windows(width, whole));
    // Weighted sums over the rows of one window, per column: a, b, a², b², ab.
    let mut moments = vec![[0.0_f64; 5]; width];
    let mut total = 0.0;
    for (top, weights) in &rows {
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
        for (left, weights) in &columns {
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
    total / (rows.len() * columns.len()) as f64
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

/// Bits per pixel per channel: (`grid_bits` + `parameter_bits`) / (`width` · `height` ·
/// `channels`), with the size of mip 0.
///
/// The paper does not say whether the texels of the other mips count. Mip 0 alone reproduces every
/// rate it prints (0.18, 0.39, 0.73 for 9 channels, 0.20, 0.44, 0.82 for 8, cut after two
/// digits); the whole chain gives 0.13, 0.29, 0.55. Bits of all mips are in the numerator all the
/// same: one pair of grids serves the chain.
#[must_use]
pub fn bppc(grid_bits: u64, parameter_bits: u64, width: u32, height: u32, channels: usize) -> f64 {
    (grid_bits + parameter_bits) as f64 / (f64::from(width) * f64::from(height) * channels as f64)
}

/// Largest absolute difference over the selected channels and mips, 0 to 1.
///
/// # Errors
///
/// As [`psnr`].
pub fn max_abs_difference(
    reference: &[Array3<f32>],
    test: &[Array3<f32>],
    channels: &[usize],
    mips: &[usize],
) -> Result<f64, MetricsError> {
    let planes = select(reference, test, channels, mips)?;
    let differences = planes.iter().flat_map(|(a, b)| a.iter().zip(b.iter()));
    Ok(differences
        .map(|(&a, &b)| (f64::from(a) - f64::from(b)).abs())
        .fold(0.0, f64::max))
}

/// How many values differ by 0, 1, … 255 codes after both are rounded to 8 bits
/// (round(255·v)): entry *d* counts the values whose codes are *d* apart.
///
/// # Errors
///
/// [`MetricsError::Shape`] when the shapes differ.
pub fn code_difference_histogram(
    reference: ArrayView3<'_, f32>,
    test: ArrayView3<'_, f32>,
) -> Result<[u64; 256], MetricsError> {
    if reference.dim() != test.dim() {
        return Err(MetricsError::Shape {
            mip: 0,
            found: test.dim(),
            allowed: reference.dim(),
        });
    }
    // The cast saturates, so values outside 0..=1 count as the nearest code.
    let code = |value: f32| (f64::from(value) * 255.0).round() as u8;
    let mut counts = [0; 256];
    for (&a, &b) in reference.iter().zip(test.iter()) {
        counts[usize::from(code(a).abs_diff(code(b)))] += 1;
    }
    Ok(counts)
}

type PlanePair<'a> = (ArrayView2<'a, f32>, ArrayView2<'a, f32>);

/// The selected planes of both sets, mips outermost.
fn select<'a>(
    reference: &'a [Array3<f32>],
    test: &'a [Array3<f32>],
    channels: &[usize],
    mips: &[usize],
) -> Result<Vec<PlanePair<'a>>, MetricsError> {
    let allowed = reference.len().min(test.len());
    let mut planes = Vec::with_capacity(channels.len() * mips.len());
    for &mip in mips {
        let (Some(a), Some(b)) = (reference.get(mip), test.get(mip)) else {
            return Err(MetricsError::Mip {
                found: mip,
                allowed,
            });
        };
        if a.dim() != b.dim() {
            return Err(MetricsError::Shape {
                mip,
                found: b.dim(),
                allowed: a.dim(),
            });
        }
        for &channel in channels {
            let allowed = a.len_of(Axis(0));
            if channel >= allowed {
                return Err(MetricsError::Channel {
                    found: channel,
                    allowed,
                });
            }
            planes.push((
                a.index_axis(Axis(0), channel),
                b.index_axis(Axis(0), channel),
            ));
        }
    }
    if planes.iter().all(|(a, _)| a.is_empty()) {
        return Err(MetricsError::Empty);
    }
    Ok(planes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::{Array2, array};

    #[test]
    fn psnr_of_a_known_error_is_exact() {
        // One of four values is off by 1/2: mean 1/16, so 40·log10(2) dB.
        let (a, b) = (
            array![[[0.0, 0.0], [0.0, 0.0]]],
            array![[[0.5, 0.0], [0.0, 0.0]]],
        );
        assert_eq!(psnr(&[a], &[b], &[0], &[0]), Ok(-10.0 * 0.0625_f64.log10()));
    }

    #[test]
    fn psnr_weighs_texels_and_only_those_selected() {
        // Mip 0 (4 texels) is right in channel 0, mip 1 (1 texel) off by 1: mean 1/5.
        let a = [Array3::zeros((2, 2, 2)), Array3::zeros((2, 1, 1))];
        let mut b = a.clone();
        b[0].index_axis_mut(Axis(0), 1).fill(0.5);
        b[1].fill(1.0);
        assert_eq!(psnr(&a, &b, &[0], &[0, 1]), Ok(-10.0 * 0.2_f64.log10()));
        assert_eq!(psnr(&a, &b, &[0], &[0]), Ok(f64::INFINITY));
        assert_eq!(psnr(&a, &b, &[1], &[0]), Ok(-10.0 * 0.25_f64.log10()));
        assert_eq!(max_abs_difference(&a, &b, &[0, 1], &[0]), Ok(0.5));
    }

    #[test]
    fn what_does_not_exist_is_refused() {
        let (a, b) = ([Array3::zeros((1, 2, 2))], [Array3::zeros((1, 2, 3))]);
        assert_eq!(
            psnr(&a, &a, &[1], &[0]),
            Err(MetricsError::Channel {
                found: 1,
                allowed: 1
            })
        );
        assert_eq!(
            psnr(&a, &a, &[0], &[1]),
            Err(MetricsError::Mip {
                found: 1,
                allowed: 1
            })
        );
        assert_eq!(psnr(&a, &a, &[], &[0]), Err(MetricsError::Empty));
        let shape = MetricsError::Shape {
            mip: 0,
            found: (1, 2, 3),
            allowed: (1, 2, 2),
        };
        assert_eq!(ssim(&a, &b, &[0], &[0]), Err(shape));
    }

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
    fn bppc_reproduces_the_rates_of_the_paper() {
        // Grids (N/2, N) at 4 bits and 1/8 resolution; MLP of 4·c0 + c1 + 12 + 1 inputs, four
        // residual blocks of two square layers, one output a channel, 16-bit parameters.
        let percent = |n: u64, hidden: u64, channels: u64| {
            let grid_bits = 4 * (n / 2 + n) * (2048 / 8) * (2048 / 8);
            let inputs = 4 * (n / 2) + n + 12 + 1;
            let parameters =
                (inputs + 1) * hidden + 8 * (hidden + 1) * hidden + (hidden + 1) * channels;
            let rate = bppc(grid_bits, 16 * parameters, 2048, 2048, channels as usize);
            (100.0 * rate).floor()
        };
        assert_eq!(
            [percent(16, 64, 9), percent(32, 128, 9), percent(64, 128, 9)],
            [18., 39., 73.]
        );
        assert_eq!(
            [percent(16, 64, 8), percent(32, 128, 8), percent(64, 128, 8)],
            [20., 44., 82.]
        );
    }

    #[test]
    fn code_differences_are_counted_after_rounding() {
        let a = array![[[0.0, 1.0, 100.4 / 255.0, 0.5]]];
        let b = array![[[1.0, 1.0, 101.4 / 255.0, 0.5]]];
        let counts = code_difference_histogram(a.view(), b.view()).unwrap();
        assert_eq!((counts[0], counts[1], counts[255]), (2, 1, 1));
        assert_eq!(counts.iter().sum::<u64>(), 4);
    }
}
