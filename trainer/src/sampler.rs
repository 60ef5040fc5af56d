//! Sampler: from grids and a texel to the synthesizer's inputs, and the way back for gradients.

use crate::positions::Positions;
use ntmu_isa::embed::{ACTIVATION_RANGE, INPUT_FRACTION_BITS};
use ntmu_isa::position::PHASE_BITS;

/// A texel of a batch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Texel {
    pub(crate) x: u32,
    pub(crate) y: u32,
    pub(crate) mip: u8,
    /// Which [`Window`] holds its cells.
    pub(crate) window: u16,
}

/// The part of the grids that is in memory: all of them, or those of one crop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Window {
    /// The first cell of each grid along x and y.
    pub(crate) origin: [[u32; 2]; 2],
    /// Cells of each grid along x and y.
    pub(crate) size: [[u32; 2]; 2],
    /// Cells after which each grid repeats along x and y.
    pub(crate) period: [[u32; 2]; 2],
    /// Where its cells start in each buffer.
    pub(crate) base: [usize; 2],
}

impl Window {
    /// The window that holds everything.
    pub(crate) fn whole(positions: &Positions) -> Window {
        Window {
            origin: [[0; 2]; 2],
            size: positions.grid_sizes.map(|(w, h)| [w, h]),
            period: positions.grid_sizes.map(|(w, h)| [w, h]),
            base: [0; 2],
        }
    }
}

/// Whether inputs are reals or the integers of the decode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Numbers {
    /// Reals; nothing is rounded.
    Real,
    /// Integers of isa's embedding, in units of 1/128, held in floats.
    Integer,
}

/// How latents become inputs.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Embedding {
    pub(crate) numbers: Numbers,
    pub(crate) channels: [usize; 2],
    /// Bits of each grid's latents.
    pub(crate) bits: [u8; 2],
    pub(crate) inputs: usize,
}

const ONE: f32 = (1 << PHASE_BITS) as f32;

impl Embedding {
    /// One unit of a latent of each grid, in units of an input.
    pub(crate) fn latent_unit(&self) -> [f32; 2] {
        let input = match self.numbers {
            Numbers::Real => 1.0,
            Numbers::Integer => f32::from(1_u8 << INPUT_FRACTION_BITS),
        };
        self.bits.map(|bits| input / (1_u32 << bits) as f32)
    }

    /// The cells of a texel's four corners in each grid, in the order of
    /// [`ntmu_isa::position::corner_weights`], as offsets of latents; and those weights, in 1/256.
    #[inline(always)]
    pub(crate) fn corners(
        &self,
        positions: &Positions,
        windows: &[Window],
        texel: Texel,
    ) -> ([[usize; 4]; 2], [f32; 4]) {
        let x = positions.axis(0, texel.x, texel.mip);
        let y = positions.axis(1, texel.y, texel.mip);
        let window = &windows[usize::from(texel.window)];
        let mut out = [[0; 4]; 2];
        for g in 0..2 {
            let [width, height] = window.period[g];
            let [ox, oy] = window.origin[g];
            let [w, h] = window.size[g];
            let xs = x.cells[g].map(|cell| local(cell, ox, w, width) as usize);
            let ys = y.cells[g].map(|cell| local(cell, oy, h, height) as usize);
            for (corner, out) in out[g].iter_mut().enumerate() {
                let cell = window.base[g] + ys[corner >> 1] * w as usize + xs[corner & 1];
                *out = cell * self.channels[g];
            }
        }
        let (wx, wy) = (f32::from(x.phase[1]), f32::from(y.phase[1]));
        (
            out,
            [
                (ONE - wx) * (ONE - wy),
                wx * (ONE - wy),
                (ONE - wx) * wy,
                wx * wy,
            ],
        )
    }

    /// Writes the inputs of a texel: corners of grid 0, grid 1 interpolated, waves, level.
    ///
    /// `seen` holds the latents in units of their codes, whole cells together.
    #[inline(always)]
    pub(crate) fn gather(
        &self,
        positions: &Positions,
        windows: &[Window],
        texel: Texel,
        seen: [&[f32]; 2],
        row: &mut [f32],
    ) {
        let (corners, weights) = self.corners(positions, windows, texel);
        let [c0, c1] = self.channels;
        let [unit0, unit1] = self.latent_unit();
        let (concatenated, rest) = row.split_at_mut(4 * c0);
        for (out, &at) in concatenated.chunks_exact_mut(c0).zip(&corners[0]) {
            for (out, &latent) in out.iter_mut().zip(&seen[0][at..at + c0]) {
                *out = self.round(latent * unit0);
            }
        }
        let (interpolated, tail) = rest.split_at_mut(c1);
        let [a, b, c, d] = corners[1].map(|at| &seen[1][at..at + c1]);
        let unit = unit1 / (ONE * ONE);
        for (i, out) in interpolated.iter_mut().enumerate() {
            // Products and sums of integers below 2^15: exact in any order.
            let sum = weights[0] * a[i] + weights[1] * b[i] + weights[2] * c[i] + weights[3] * d[i];
            *out = self.round(sum * unit);
        }
        let scale = match self.numbers {
            Numbers::Real => 1.0 / f32::from(1_u8 << INPUT_FRACTION_BITS),
            Numbers::Integer => 1.0,
        };
        positions.tail(
            (texel.x, texel.y, texel.mip),
            scale,
            &mut tail[..self.inputs - 4 * c0 - c1],
        );
    }

    /// isa's rounding of an input (ties up) and its saturation, where inputs are integers.
    #[inline(always)]
    fn round(&self, value: f32) -> f32 {
        match self.numbers {
            Numbers::Real => value,
            Numbers::Integer => (value + 0.5)
                .floor()
                .clamp(ACTIVATION_RANGE.0 as f32, ACTIVATION_RANGE.1 as f32),
        }
    }

    /// Adds the gradient of a texel's inputs to the gradient of grid 0's latents, in units of the
    /// latents' codes up to the factor [`Embedding::latent_unit`].
    #[inline(always)]
    pub(crate) fn scatter_corners(&self, corners: &[u32; 4], row: &[f32], gradient: &mut [f32]) {
        let c0 = self.channels[0];
        for (d, &at) in row.chunks_exact(c0).zip(corners) {
            let at = at as usize;
            for (g, d) in gradient[at..at + c0].iter_mut().zip(d) {
                *g += d;
            }
        }
    }

    /// The same for grid 1.
    #[inline(always)]
    pub(crate) fn scatter_interpolated(
        &self,
        corners: &[u32; 4],
        weights: &[f32; 4],
        row: &[f32],
        gradient: &mut [f32],
    ) {
        let [c0, c1] = self.channels;
        let row = &row[4 * c0..4 * c0 + c1];
        for (&weight, &at) in weights.iter().zip(corners) {
            let (weight, at) = (weight / (ONE * ONE), at as usize);
            for (g, d) in gradient[at..at + c1].iter_mut().zip(row) {
                *g += weight * d;
            }
        }
    }
}

/// A cell of the whole grid as a cell of a window. A cell outside the window becomes its nearest
/// edge, counted around the grid: the window's own way of clamping.
#[inline(always)]
const fn local(cell: u32, origin: u32, size: u32, cells: u32) -> u32 {
    let inside = if cell >= origin {
        cell - origin
    } else {
        cell + cells - origin
    };
    if inside < size {
        inside
    } else if inside - size < cells - inside {
        size - 1
    } else {
        0
    }
}
