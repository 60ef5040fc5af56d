//! The difference: by how many codes values are off.

use super::error::MetricsError;
use super::selection::select;
use ndarray::{Array3, ArrayView3};

/// Largest absolute difference over the selected channels and mips, 0 to 1.
///
/// # Errors
///
/// As [`psnr`](super::psnr).
pub fn max_abs_difference(
    reference: &[Array3<f32>],
    test: &[Array3<f32>],
    channels: &[usize],
    mips: &[usize],
) -> Result<f64, MetricsError> {
    let planes = select(reference, test, channels, mips, None)?;
    let differences = planes
        .iter()
        .flat_map(|p| p.reference.iter().zip(p.test.iter()));
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

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::array;

    #[test]
    fn code_differences_are_counted_after_rounding() {
        let a = array![[[0.0, 1.0, 100.4 / 255.0, 0.5]]];
        let b = array![[[1.0, 1.0, 101.4 / 255.0, 0.5]]];
        let counts = code_difference_histogram(a.view(), b.view()).unwrap();
        assert_eq!((counts[0], counts[1], counts[255]), (2, 1, 1));
        assert_eq!(counts.iter().sum::<u64>(), 4);
    }
}
