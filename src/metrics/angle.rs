//! The angle: degrees between two tangent-space normals.
//!
//! A normal is stored as (v + 1) / 2 in each component. Both are decoded, brought to length 1 and
//! compared; which way green points does not matter as long as both agree.

use super::error::MetricsError;
use super::mask::Mask;
use super::selection::{PlanePair, select};
use ndarray::Array3;
use rayon::prelude::*;
use serde::Serialize;

/// The angles between the normals of some texels.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AngleErrors {
    /// Degrees, 0 to 180, row by row.
    pub degrees: Vec<f64>,
    /// Texels where a vector has no direction, in the reference or in the test.
    pub undefined: u64,
}

/// What angles come to.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct AngleFigures {
    /// Degrees; none where no normal has a direction.
    pub mean: Option<f64>,
    /// The smallest angle that 95 of 100 do not exceed (nearest rank), in degrees.
    pub p95: Option<f64>,
    /// The largest, in degrees.
    pub worst: Option<f64>,
    /// Normals that were compared.
    pub vectors: u64,
    /// Texels left out because a vector of either set has length 0.
    pub undefined: u64,
}

impl AngleErrors {
    /// Adds the angles of other texels.
    pub fn append(&mut self, mut other: AngleErrors) {
        self.degrees.append(&mut other.degrees);
        self.undefined += other.undefined;
    }

    /// Mean, 95th percentile and worst.
    #[must_use]
    pub fn figures(mut self) -> AngleFigures {
        let count = self.degrees.len();
        let sum: f64 = self.degrees.iter().sum();
        // Rank ⌈0.95 · count⌉, from 1.
        let rank = (19 * count).div_ceil(20);
        let p95 = (count > 0).then(|| {
            let (_, at, _) = self
                .degrees
                .select_nth_unstable_by(rank - 1, f64::total_cmp);
            *at
        });
        AngleFigures {
            mean: (count > 0).then(|| sum / count as f64),
            p95,
            worst: self.degrees.iter().copied().reduce(f64::max),
            vectors: count as u64,
            undefined: self.undefined,
        }
    }
}

/// The angles of one mip. Two channels are x and y, and z is the root of 1 − x² − y², or 0 where
/// that is negative; three are x, y and z.
///
/// # Errors
///
/// As [`psnr_within`](super::psnr_within), and when there are not 2 or 3 channels.
pub fn angle_errors(
    reference: &[Array3<f32>],
    test: &[Array3<f32>],
    channels: &[usize],
    mip: usize,
    mask: Option<&Mask>,
) -> Result<AngleErrors, MetricsError> {
    if !(2..=3).contains(&channels.len()) {
        return Err(MetricsError::Normal {
            found: channels.len(),
        });
    }
    let planes = select(reference, test, channels, &[mip], mask)?;
    let rows = planes[0].reference.nrows();
    let rows: Vec<AngleErrors> = (0..rows)
        .into_par_iter()
        .map(|row| of_row(&planes, row))
        .collect();
    let mut all = AngleErrors::default();
    for row in rows {
        all.append(row);
    }
    Ok(all)
}

fn of_row(planes: &[PlanePair<'_>], row: usize) -> AngleErrors {
    let mut errors = AngleErrors::default();
    for column in 0..planes[0].reference.ncols() {
        let at = [row, column];
        if planes[0].mask.is_some_and(|mask| !mask[at]) {
            continue;
        }
        let a = normal(planes.iter().map(|plane| plane.reference[at]));
        let b = normal(planes.iter().map(|plane| plane.test[at]));
        match degrees_between(a, b) {
            Some(degrees) => errors.degrees.push(degrees),
            None => errors.undefined += 1,
        }
    }
    errors
}

/// The vector of stored components, not brought to length 1; z is made where it is missing.
fn normal(stored: impl Iterator<Item = f32>) -> [f64; 3] {
    let mut vector = [f64::NAN; 3];
    for (component, stored) in vector.iter_mut().zip(stored) {
        *component = 2.0 * f64::from(stored) - 1.0;
    }
    let [x, y, z] = vector;
    if z.is_nan() {
        vector[2] = (1.0 - x * x - y * y).max(0.0).sqrt();
    }
    vector
}

/// None where one has no direction. The arc tangent keeps small angles exact, where the arc cosine
/// of a number near 1 would lose half its digits; lengths cancel.
fn degrees_between(a: [f64; 3], b: [f64; 3]) -> Option<f64> {
    let dot = |p: [f64; 3], q: [f64; 3]| p[0] * q[0] + p[1] * q[1] + p[2] * q[2];
    if dot(a, a) == 0.0 || dot(b, b) == 0.0 {
        return None;
    }
    let cross = [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ];
    Some(dot(cross, cross).sqrt().atan2(dot(a, b)).to_degrees())
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array2;

    /// One row of normals, stored.
    fn row(normals: &[[f32; 3]], channels: usize) -> [Array3<f32>; 1] {
        let stored = |(c, _, x): (usize, usize, usize)| (normals[x][c] + 1.0) / 2.0;
        [Array3::from_shape_fn((channels, 1, normals.len()), stored)]
    }

    fn figures(a: &[[f32; 3]], b: &[[f32; 3]], channels: &[usize]) -> AngleFigures {
        let (a, b) = (row(a, channels.len()), row(b, channels.len()));
        angle_errors(&a, &b, channels, 0, None).unwrap().figures()
    }

    #[test]
    fn right_angles_and_opposites_are_exact_and_lengths_do_not_matter() {
        let up = [0.0, 0.0, 1.0];
        for (other, degrees) in [
            (up, 0.0),
            ([0.0, 0.0, 0.25], 0.0),
            ([0.5, 0.0, 0.0], 90.0),
            ([0.0, -1.0, 0.0], 90.0),
            ([0.5, 0.0, 0.5], 45.0),
            ([0.0, 0.0, -0.5], 180.0),
        ] {
            let found = figures(&[up], &[other], &[0, 1, 2]);
            assert_eq!(found.mean, Some(degrees), "{other:?}");
            assert_eq!((found.vectors, found.undefined), (1, 0));
        }
    }

    #[test]
    fn z_of_two_channels_completes_the_unit_vector() {
        // 3-4-5: z = 0.6 beside y = 0.8 and the other way round; 0.8 as f32 is off by 1e-8.
        let found = figures(&[[0.0, 0.8, 0.0]], &[[0.0, 0.0, 0.0]], &[0, 1]);
        let expected = f64::to_degrees((0.8_f64).asin());
        assert!((found.mean.unwrap() - expected).abs() < 60.0 * 4.0 * f64::from(f32::EPSILON));
        // Longer than 1 in x and y: z is 0.
        let found = figures(&[[1.0, 1.0, 0.0]], &[[1.0, -1.0, 0.0]], &[0, 1]);
        assert_eq!(found.mean, Some(90.0));
    }

    #[test]
    fn a_vector_without_direction_is_counted_and_left_out() {
        let (up, none) = ([0.0, 0.0, 1.0], [0.0, 0.0, 0.0]);
        let found = figures(&[up, none, up, none], &[up, up, none, none], &[0, 1, 2]);
        assert_eq!((found.vectors, found.undefined), (1, 3));
        assert_eq!(found.worst, Some(0.0));
        let found = figures(&[none], &[up], &[0, 1, 2]);
        assert_eq!((found.mean, found.p95, found.worst), (None, None, None));
    }

    #[test]
    fn the_percentile_is_the_nearest_rank() {
        for (count, rank) in [(1, 1), (19, 19), (20, 19), (21, 20), (100, 95), (101, 96)] {
            let degrees = (1..=count).rev().map(f64::from).collect();
            let errors = AngleErrors {
                degrees,
                undefined: 0,
            };
            let figures = errors.figures();
            assert_eq!(figures.p95, Some(f64::from(rank)), "of {count}");
            assert_eq!(figures.worst, Some(f64::from(count)));
            assert_eq!(figures.mean, Some((f64::from(count) + 1.0) / 2.0));
        }
    }

    #[test]
    fn only_texels_in_the_mask_are_compared() {
        let (up, aside) = ([0.0, 0.0, 1.0], [1.0, 0.0, 0.0]);
        let (a, b) = (row(&[up, up], 3), row(&[up, aside], 3));
        let mask = Mask::new(vec![
            Array2::from_shape_vec((1, 2), vec![true, false]).unwrap(),
        ]);
        let found = angle_errors(&a, &b, &[0, 1, 2], 0, Some(&mask)).unwrap();
        assert_eq!(found.degrees, [0.0]);
        assert_eq!(
            angle_errors(&a, &b, &[0], 0, None),
            Err(MetricsError::Normal { found: 1 })
        );
    }
}
