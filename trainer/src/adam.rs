//! Adam (Kingma and Ba 2015) on flat slices.

use crate::kernel::{Vectorised, vectorised};
use std::ops::Range;

/// Decay of the first moment.
pub(crate) const BETA1: f32 = 0.9;
/// Decay of the second moment.
pub(crate) const BETA2: f32 = 0.99;
/// Added to the root of the second moment. The gradients of latents are around 1e-7, far below
/// the customary 1e-8 once squared and averaged, hence the value of Müller et al. 2022.
pub(crate) const EPSILON: f32 = 1e-15;

/// The moments of a slice of parameters.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Moments {
    pub(crate) first: Vec<f32>,
    pub(crate) second: Vec<f32>,
}

/// What every element of a step shares.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rate {
    /// Learning rate over the bias correction of the first moment.
    pub(crate) step: f32,
    /// One over the root of the bias correction of the second moment.
    pub(crate) root: f32,
}

impl Rate {
    /// The rate at the `count`-th update, counted from 1.
    pub(crate) fn new(learning_rate: f64, count: u64) -> Rate {
        let count = i32::try_from(count).unwrap_or(i32::MAX);
        let first = 1.0 - f64::from(BETA1).powi(count);
        let second = 1.0 - f64::from(BETA2).powi(count);
        Rate {
            step: (learning_rate / first) as f32,
            root: (1.0 / second.sqrt()) as f32,
        }
    }

    /// One element: the moments advance, and what to subtract from the parameter comes back.
    #[inline(always)]
    pub(crate) fn advance(self, gradient: f32, first: &mut f32, second: &mut f32) -> f32 {
        *first = BETA1 * *first + (1.0 - BETA1) * gradient;
        *second = BETA2 * *second + (1.0 - BETA2) * (gradient * gradient);
        self.step * *first / (second.sqrt() * self.root + EPSILON)
    }
}

impl Moments {
    pub(crate) fn zero(len: usize) -> Moments {
        Moments {
            first: vec![0.0; len],
            second: vec![0.0; len],
        }
    }

    /// One update of `parameters` along `gradient`.
    pub(crate) fn update(&mut self, rate: Rate, parameters: &mut [f32], gradient: &[f32]) {
        self.update_part(0..parameters.len(), rate, parameters, gradient);
    }

    /// The same of a part of them.
    pub(crate) fn update_part(
        &mut self,
        part: Range<usize>,
        rate: Rate,
        parameters: &mut [f32],
        gradient: &[f32],
    ) {
        vectorised(Update {
            rate,
            parameters: &mut parameters[part.clone()],
            gradient: &gradient[part.clone()],
            first: &mut self.first[part.clone()],
            second: &mut self.second[part],
        });
    }
}

struct Update<'a> {
    rate: Rate,
    parameters: &'a mut [f32],
    gradient: &'a [f32],
    first: &'a mut [f32],
    second: &'a mut [f32],
}

impl Vectorised for Update<'_> {
    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let moments = self.first.iter_mut().zip(self.second);
        for ((p, &g), (m, v)) in self.parameters.iter_mut().zip(self.gradient).zip(moments) {
            *p -= self.rate.advance(g, m, v);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_update_has_the_size_of_the_learning_rate() {
        let mut moments = Moments::zero(3);
        let mut parameters = [1.0, 1.0, 1.0];
        moments.update(Rate::new(0.25, 1), &mut parameters, &[1e-7, -3.0, 0.0]);
        // Bias correction makes the ratio of the moments ±1; f32 rounds a few parts in 10^7.
        assert!((parameters[0] - 0.75).abs() < 1e-6 && (parameters[1] - 1.25).abs() < 1e-6);
        assert_eq!(parameters[2], 1.0);
    }

    #[test]
    fn adam_finds_the_minimum_of_a_parabola() {
        let mut moments = Moments::zero(1);
        let mut x = [3.0_f32];
        for step in 1..=2000 {
            let gradient = [2.0 * (x[0] - 1.0)];
            let rate = 0.05 * (1.0 - f64::from(step) / 2000.0);
            moments.update(Rate::new(rate, step as u64), &mut x, &gradient);
        }
        assert!((x[0] - 1.0).abs() < 1e-3, "{}", x[0]);
    }
}
