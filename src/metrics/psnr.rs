//! PSNR: squared error against the peak, in dB.

use super::error::MetricsError;
use super::mask::Mask;
use super::selection::{PlanePair, select};
use ndarray::Array3;
use rayon::prelude::*;

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
    psnr_within(reference, test, channels, mips, None)
}

/// [`psnr`] of the texels in the mask.
///
/// # Errors
///
/// As [`psnr`], and when the mask does not fit the sets or leaves nothing.
pub fn psnr_within(
    reference: &[Array3<f32>],
    test: &[Array3<f32>],
    channels: &[usize],
    mips: &[usize],
    mask: Option<&Mask>,
) -> Result<f64, MetricsError> {
    let planes = select(reference, test, channels, mips, mask)?;
    let errors: Vec<f64> = planes.par_iter().map(squared_error).collect();
    let count: usize = planes.iter().map(PlanePair::count).sum();
    Ok(-10.0 * (errors.iter().sum::<f64>() / count as f64).log10())
}

fn squared_error(planes: &PlanePair<'_>) -> f64 {
    let texels = planes.reference.iter().zip(planes.test.iter());
    let error = |(a, b): (&f32, &f32)| (f64::from(*a) - f64::from(*b)).powi(2);
    match planes.mask {
        None => texels.map(error).sum(),
        Some(mask) => {
            let counted = texels.zip(mask.iter()).filter(|(_, counts)| **counts);
            counted.map(|(texel, _)| error(texel)).sum()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::{max_abs_difference, ssim};
    use ndarray::{Array2, Axis, array};

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
    fn a_mask_leaves_the_texels_in_it() {
        let (a, b) = (
            [array![[[0.0, 0.0], [0.0, 0.0]]]],
            [array![[[0.5, 1.0], [0.0, 1.0]]]],
        );
        let mask = Mask::new(vec![array![[true, false], [true, false]]]);
        let within = |mask: &Mask| psnr_within(&a, &b, &[0], &[0], Some(mask));
        assert_eq!(within(&mask), Ok(-10.0 * 0.125_f64.log10()));
        let all = Mask::new(vec![Array2::from_elem((2, 2), true)]);
        assert_eq!(within(&all), psnr(&a, &b, &[0], &[0]));
        let none = Mask::new(vec![Array2::from_elem((2, 2), false)]);
        assert_eq!(within(&none), Err(MetricsError::Empty));
        assert_eq!(
            within(&Mask::new(vec![])),
            Err(MetricsError::MaskMips {
                found: 0,
                allowed: 1
            })
        );
        assert_eq!(
            within(&Mask::new(vec![array![[true]]])),
            Err(MetricsError::MaskShape {
                mip: 0,
                found: (1, 1),
                allowed: (2, 2)
            })
        );
    }
}
