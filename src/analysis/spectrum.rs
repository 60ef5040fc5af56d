//! The spectrum: the Fourier transform of one plane.
//!
//! Power is |F|² / (rows · columns)², so that all bins add up to the plane's mean square, and all
//! but the one of frequency 0 to its variance. Frequencies are shares of Nyquist's, half a cycle a
//! cell; the distance from 0 counts, so the corners reach √2.

use ndarray::{Array2, ArrayView2};
use rustfft::FftPlanner;
use rustfft::num_complex::Complex;
use serde::Serialize;

/// Bands from frequency 0 to Nyquist's.
const BANDS: f64 = 16.0;

/// The Fourier transform of a plane.
#[derive(Clone, Debug, PartialEq)]
pub struct Spectrum {
    /// \[row, column\], frequency 0 first, as the transform gives them.
    power: Array2<f64>,
}

/// Frequencies between two distances from 0.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Band {
    /// The lowest frequency, a share of Nyquist's.
    pub low: f64,
    /// The highest, not included.
    pub high: f64,
    /// Bins of the transform in it; the one of frequency 0 is in none.
    pub bins: usize,
    /// Mean power of those bins; none where there is none.
    pub mean_power: Option<f64>,
}

/// What a spectrum comes to.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SpectrumSummary {
    /// The plane's variance: the power at all frequencies but 0.
    pub variance: f64,
    /// The share of the variance below half of Nyquist's frequency; none where there is no variance.
    pub low_share: Option<f64>,
    /// The share that white noise has on average: that of the bins. π/16 = 0.196 of a large plane.
    pub white_noise_low_share: Option<f64>,
    /// The power by frequency, lowest first.
    pub bands: Vec<Band>,
}

impl Spectrum {
    /// The transform of a plane \[row, column\] of any size; an empty one has an empty spectrum.
    #[must_use]
    pub fn of(plane: ArrayView2<'_, f64>) -> Spectrum {
        let (rows, columns) = plane.dim();
        let mut values = plane.mapv(|re| Complex { re, im: 0.0 });
        let mut planner = FftPlanner::new();
        if !values.is_empty() {
            transform_rows(&mut values, &mut planner);
            let mut turned = values.t().as_standard_layout().into_owned();
            transform_rows(&mut turned, &mut planner);
            values = turned.reversed_axes();
        }
        let scale = 1.0 / (rows * columns) as f64;
        Spectrum {
            power: values.mapv(|value| (value * scale).norm_sqr()),
        }
    }

    /// The mean of spectra of planes of one size, of which there is at least one.
    #[must_use]
    pub fn mean(spectra: &[Spectrum]) -> Option<Spectrum> {
        let (first, others) = spectra.split_first()?;
        let mut power = first.power.clone();
        for other in others {
            if other.power.dim() != power.dim() {
                return None;
            }
            power += &other.power;
        }
        power /= spectra.len() as f64;
        Some(Spectrum { power })
    }

    /// Power by \[row, column\] of the transform, frequency 0 at 0, 0.
    #[must_use]
    pub fn power(&self) -> ArrayView2<'_, f64> {
        self.power.view()
    }

    /// Power with frequency 0 at row ⌊rows / 2⌋, column ⌊columns / 2⌋.
    #[must_use]
    pub fn centred(&self) -> Array2<f64> {
        let (rows, columns) = self.power.dim();
        Array2::from_shape_fn((rows, columns), |(row, column)| {
            let turn = |index: usize, count: usize| (index + count - count / 2) % count;
            self.power[[turn(row, rows), turn(column, columns)]]
        })
    }

    /// Distance of a bin from frequency 0, as a share of Nyquist's frequency.
    fn frequency(&self, (row, column): (usize, usize)) -> f64 {
        let along = |index: usize, count: usize| {
            let cycles = index.min(count - index);
            2.0 * cycles as f64 / count as f64
        };
        let (rows, columns) = self.power.dim();
        along(row, rows).hypot(along(column, columns))
    }

    /// Variance, share of the low frequencies, and bands.
    #[must_use]
    pub fn summary(&self) -> SpectrumSummary {
        let count = (BANDS * 2.0_f64.sqrt()).ceil() as usize;
        let mut bands = vec![(0_usize, 0.0_f64); count];
        let (mut variance, mut low, mut low_bins) = (0.0, 0.0, 0_usize);
        for (at, power) in self.power.indexed_iter().skip(1) {
            let frequency = self.frequency(at);
            let band = &mut bands[((frequency * BANDS) as usize).min(count - 1)];
            band.0 += 1;
            band.1 += power;
            variance += power;
            if frequency < 0.5 {
                low += power;
                low_bins += 1;
            }
        }
        let others = self.power.len().saturating_sub(1);
        let bands = bands.iter().enumerate().map(|(index, (bins, power))| Band {
            low: index as f64 / BANDS,
            high: (index + 1) as f64 / BANDS,
            bins: *bins,
            mean_power: (*bins > 0).then(|| power / *bins as f64),
        });
        SpectrumSummary {
            variance,
            low_share: (variance > 0.0).then(|| low / variance),
            white_noise_low_share: (others > 0).then(|| low_bins as f64 / others as f64),
            bands: bands.collect(),
        }
    }
}

/// Every row in place; rows lie one after the other.
fn transform_rows(values: &mut Array2<Complex<f64>>, planner: &mut FftPlanner<f64>) {
    let columns = values.ncols();
    let plan = planner.plan_fft_forward(columns);
    // A buffer of several transforms is a row after the other.
    if let Some(rows) = values.as_slice_mut() {
        plan.process(rows);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// A transform's error is at most some log2(bins) roundings, ten or so a butterfly, of the
    /// root of the mean square, which is at most 1 here; the input has two more.
    fn bound(bins: usize) -> f64 {
        (20.0 * (bins as f64).log2() + 4.0) * f64::EPSILON
    }

    #[test]
    fn a_cosine_has_its_power_in_its_own_two_bins() {
        for (rows, columns, ky, kx) in [(16, 24, 2, 3), (9, 7, 4, 1), (32, 32, 0, 5), (1, 13, 0, 6)]
        {
            let wave = |(y, x): (usize, usize)| {
                let turn = (ky * y) as f64 / rows as f64 + (kx * x) as f64 / columns as f64;
                (TAU * turn).cos()
            };
            let found = Spectrum::of(Array2::from_shape_fn((rows, columns), wave).view());
            let own = [(ky, kx), ((rows - ky) % rows, (columns - kx) % columns)];
            // The argument of the cosine has some 60 · TAU / 2 ulps of error where it is large.
            let bound = bound(rows * columns) + 400.0 * f64::EPSILON;
            for (at, power) in found.power().indexed_iter() {
                let expected = if own.contains(&at) { 0.25 } else { 0.0 };
                assert!((power - expected).abs() < bound, "{at:?}: {power}");
            }
        }
    }

    #[test]
    fn powers_add_up_to_the_mean_square_at_every_size() {
        for rows in 1..18 {
            for columns in [1, 2, 3, 8, 13] {
                let plane = Array2::from_shape_fn((rows, columns), |(y, x)| {
                    ((7 * y + 3 * x + x * y) % 16) as f64 / 16.0 - 0.5
                });
                let spectrum = Spectrum::of(plane.view());
                let mean_square = plane.iter().map(|v| v * v).sum::<f64>() / plane.len() as f64;
                let bound = bound(plane.len()) * 2.0;
                assert!((spectrum.power().sum() - mean_square).abs() < bound);
                let variance = mean_square - plane.mean().unwrap().powi(2);
                assert!((spectrum.summary().variance - variance).abs() < bound);
            }
        }
    }

    #[test]
    fn every_bin_but_that_of_the_mean_is_in_one_band() {
        for (rows, columns) in [(1, 1), (1, 2), (5, 8), (64, 48)] {
            let plane = Array2::from_shape_fn((rows, columns), |(y, x)| ((x ^ y) % 5) as f64);
            let summary = Spectrum::of(plane.view()).summary();
            let bins: usize = summary.bands.iter().map(|band| band.bins).sum();
            assert_eq!(bins, rows * columns - 1);
        }
    }

    #[test]
    fn the_share_of_low_frequencies_is_that_of_the_waves_below_half_of_nyquist() {
        // Two cosines of equal power: 3/16 and 7/16 cycles a cell, that is 3/8 and 7/8 of Nyquist.
        let plane = Array2::from_shape_fn((16, 16), |(_, x)| {
            (TAU * 3.0 * x as f64 / 16.0).cos() + (TAU * 7.0 * x as f64 / 16.0).cos()
        });
        let summary = Spectrum::of(plane.view()).summary();
        assert!(
            (summary.low_share.unwrap() - 0.5).abs() < 2.0 * (bound(256) + 400.0 * f64::EPSILON)
        );
        let fullest = |from: usize| summary.bands[from].mean_power.unwrap() > 0.01;
        assert!(fullest(6) && fullest(14) && !fullest(5) && !fullest(13));
        assert_eq!(
            Spectrum::of(Array2::ones((4, 4)).view())
                .summary()
                .low_share,
            None
        );
    }

    #[test]
    fn white_noise_has_the_share_of_a_circle() {
        let share = Spectrum::of(Array2::zeros((256, 256)).view()).summary();
        // The circle's area, ± bins on its rim: 2π · 64 of 65,536.
        let rim = TAU * 64.0 / 65_536.0;
        let found = share.white_noise_low_share.unwrap();
        assert!((found - std::f64::consts::PI / 16.0).abs() < rim);
    }

    #[test]
    fn frequency_zero_is_in_the_middle_of_the_centred_power() {
        for (rows, columns) in [(4, 6), (5, 7), (1, 1), (1, 2)] {
            let spectrum = Spectrum::of(Array2::ones((rows, columns)).view());
            let centred = spectrum.centred();
            assert!(centred[[rows / 2, columns / 2]] > 0.99);
            assert_eq!(centred.len(), rows * columns);
        }
    }
}
