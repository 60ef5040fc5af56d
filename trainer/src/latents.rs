//! Latents: one grid's parameters, and what the synthesizer sees of them.

use crate::adam::{Moments, Rate};
use crate::kernel::{Vectorised, vectorised};
use crate::random::{Stream, half_unit_noise};
use ntmu_isa::latent::LatentFormat;
use ntmu_isa::shape::GridShape;
use rayon::prelude::*;

/// How a parameter becomes what the synthesizer sees.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Rounding {
    /// Plus uniform noise as wide as one code (Ballé et al. 2017), with this key.
    Noise(u32),
    /// To the nearest code, the gradient passing straight through.
    Nearest,
}

/// Latents of one task of the parallel update.
const BLOCK: usize = 1 << 14;

/// One grid, its levels one after the other, whole cells together, in units of its codes: a latent
/// is isa's value, not rounded.
#[derive(Clone, Debug)]
pub(crate) struct Latents {
    pub(crate) format: LatentFormat,
    pub(crate) values: Vec<f32>,
    pub(crate) moments: Moments,
    /// What the synthesizer sees.
    pub(crate) seen: Vec<f32>,
    /// The gradient of the step, in units of the inputs.
    pub(crate) gradient: Vec<f32>,
}

impl Latents {
    pub(crate) fn new(shape: GridShape, cells: usize) -> Latents {
        let len = cells * usize::from(shape.channels);
        Latents {
            format: shape.format,
            values: vec![0.0; len],
            moments: Moments::zero(len),
            seen: vec![0.0; len],
            gradient: vec![0.0; len],
        }
    }

    /// The smallest and the largest value.
    pub(crate) fn limits(&self) -> (f32, f32) {
        (
            self.format.min_value() as f32,
            self.format.max_value() as f32,
        )
    }

    /// Makes `seen` from the values.
    pub(crate) fn show(&mut self, rounding: Rounding) {
        let limits = self.limits();
        let blocks = self
            .values
            .par_chunks(BLOCK)
            .zip(self.seen.par_chunks_mut(BLOCK));
        blocks.enumerate().for_each(|(block, (values, seen))| {
            vectorised(Show {
                limits,
                rounding,
                first: (block * BLOCK) as u32,
                values,
                seen,
            });
        });
    }

    /// One update along the gradient, which is cleared. `unit` is one code in units of the
    /// inputs; `rate` is in codes.
    pub(crate) fn update(&mut self, rate: Rate, unit: f32) {
        let limits = self.limits();
        self.values
            .par_chunks_mut(BLOCK)
            .zip(self.gradient.par_chunks_mut(BLOCK))
            .zip(self.moments.first.par_chunks_mut(BLOCK))
            .zip(self.moments.second.par_chunks_mut(BLOCK))
            .for_each(|(((values, gradient), first), second)| {
                vectorised(Update {
                    rate,
                    unit,
                    limits,
                    values,
                    gradient,
                    first,
                    second,
                });
            });
    }

    /// The stored codes.
    pub(crate) fn codes(&self) -> Vec<u8> {
        self.values
            .iter()
            .map(|v| self.format.code((v + 0.5).floor() as i32))
            .collect()
    }

    /// Replaces the values by those of stored codes.
    pub(crate) fn take(&mut self, codes: &[u8]) {
        for (value, &code) in self.values.iter_mut().zip(codes) {
            *value = self.format.value(code) as f32;
        }
    }

    /// A small start around zero.
    pub(crate) fn scatter_start(&mut self, stream: Stream, first: u64) {
        let (low, high) = self.limits();
        let width = 0.25 * (high - low);
        for (index, value) in self.values.iter_mut().enumerate() {
            *value = (width * stream.signed(first + index as u64)).clamp(low, high);
        }
    }
}

struct Show<'a> {
    limits: (f32, f32),
    rounding: Rounding,
    first: u32,
    values: &'a [f32],
    seen: &'a mut [f32],
}

impl Vectorised for Show<'_> {
    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let (low, high) = self.limits;
        match self.rounding {
            Rounding::Noise(key) => {
                for (i, (seen, value)) in self.seen.iter_mut().zip(self.values).enumerate() {
                    *seen = value + half_unit_noise(key, self.first + i as u32);
                }
            }
            Rounding::Nearest => {
                for (seen, value) in self.seen.iter_mut().zip(self.values) {
                    *seen = (value + 0.5).floor().clamp(low, high);
                }
            }
        }
    }
}

struct Update<'a> {
    rate: Rate,
    unit: f32,
    limits: (f32, f32),
    values: &'a mut [f32],
    gradient: &'a mut [f32],
    first: &'a mut [f32],
    second: &'a mut [f32],
}

impl Vectorised for Update<'_> {
    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let (low, high) = self.limits;
        let moments = self.first.iter_mut().zip(self.second);
        for ((value, g), (m, v)) in self.values.iter_mut().zip(self.gradient).zip(moments) {
            let step = self.rate.advance(*g * self.unit, m, v);
            *value = (*value - step).clamp(low, high);
            *g = 0.0;
        }
    }
}
