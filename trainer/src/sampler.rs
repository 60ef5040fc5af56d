//! Sampler: from grids and a texel to the synthesizer's inputs, and the way back for gradients.

use crate::choices::GridSampling;
use crate::positions::Positions;
use ntmu_isa::embed::input_range;
use ntmu_isa::position::PHASE_BITS;

/// A texel of a batch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Texel {
    pub(crate) x: u32,
    pub(crate) y: u32,
    pub(crate) mip: u8,
    /// Which crop holds its cells: the first of as many [`Window`]s as there are levels, over that
    /// number.
    pub(crate) window: u16,
}

/// The part of one level of the grids that is in memory: all of it, or that of one crop.
///
/// Windows lie in a slice crop after crop, the levels of a crop together.
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
    /// The windows that hold everything, one for each level.
    pub(crate) fn whole(positions: &Positions) -> Vec<Window> {
        let of_level = |level: usize| {
            let levels = [0, 1].map(|g: usize| positions.levels[g][level]);
            Window {
                origin: [[0; 2]; 2],
                size: levels.map(|l| l.size),
                period: levels.map(|l| l.size),
                base: levels.map(|l| l.base),
            }
        };
        (0..positions.level_count()).map(of_level).collect()
    }

    /// Cells of a grid in it.
    pub(crate) const fn cells(&self, grid: usize) -> usize {
        self.size[grid][0] as usize * self.size[grid][1] as usize
    }
}

/// Whether inputs are reals or the integers of the decode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Numbers {
    /// Reals; nothing is rounded.
    Real,
    /// Integers of isa's embedding, held in floats.
    Integer,
}

/// How latents become inputs.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Embedding {
    pub(crate) numbers: Numbers,
    pub(crate) channels: [usize; 2],
    pub(crate) sampling: [GridSampling; 2],
    /// Bits of each grid's latents.
    pub(crate) bits: [u8; 2],
    /// Bits of an input.
    pub(crate) input_bits: u8,
    pub(crate) inputs: usize,
}

const ONE: f32 = (1 << PHASE_BITS) as f32;

impl Embedding {
    /// One unit of a latent of each grid, in units of an input.
    pub(crate) fn latent_unit(&self) -> [f32; 2] {
        let input = match self.numbers {
            Numbers::Real => 1.0,
            Numbers::Integer => self.one(),
        };
        self.bits.map(|bits| input / (1_u32 << bits) as f32)
    }

    /// The real 1 in units of an integer input.
    const fn one(&self) -> f32 {
        (1_u32 << (self.input_bits - 1)) as f32
    }

    /// Where the inputs of a grid lie among all of them.
    fn lanes(&self, grid: usize) -> std::ops::Range<usize> {
        let count = |g: usize| match self.sampling[g] {
            GridSampling::Corners => 4 * self.channels[g],
            GridSampling::Interpolated => self.channels[g],
        };
        let start = if grid == 0 { 0 } else { count(0) };
        start..start + count(grid)
    }

    /// The cells of a texel's four corners in each grid, in the order of
    /// [`ntmu_isa::filter::FilterRule::weights`], as offsets of latents; and those weights, in
    /// 1/256.
    #[inline(always)]
    pub(crate) fn corners(
        &self,
        positions: &Positions,
        windows: &[Window],
        texel: Texel,
    ) -> ([[usize; 4]; 2], [[f32; 4]; 2]) {
        let x = positions.axis(0, texel.x, texel.mip);
        let y = positions.axis(1, texel.y, texel.mip);
        let level = positions.level_of(texel.mip);
        let window = &windows[usize::from(texel.window) * positions.level_count() + level];
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
        let weights = [0, 1].map(|g: usize| {
            let (wx, wy) = (f32::from(x.phase[g]), f32::from(y.phase[g]));
            [
                (ONE - wx) * (ONE - wy),
                wx * (ONE - wy),
                (ONE - wx) * wy,
                wx * wy,
            ]
        });
        (out, weights)
    }

    /// Writes the inputs of a texel: grid 0, grid 1, waves, level, zeros.
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
        let units = self.latent_unit();
        for g in 0..2 {
            let (channels, unit) = (self.channels[g], units[g]);
            let row = &mut row[self.lanes(g)];
            let cells = corners[g].map(|at| &seen[g][at..at + channels]);
            match self.sampling[g] {
                GridSampling::Corners => {
                    for (out, cell) in row.chunks_exact_mut(channels).zip(cells) {
                        for (out, &latent) in out.iter_mut().zip(cell) {
                            *out = self.round(latent * unit);
                        }
                    }
                }
                GridSampling::Interpolated => {
                    let ([a, b, c, d], w, unit) = (cells, weights[g], unit / (ONE * ONE));
                    for (i, out) in row.iter_mut().enumerate() {
                        // Products and sums of integers below 2^15: exact in any order.
                        let sum = w[0] * a[i] + w[1] * b[i] + w[2] * c[i] + w[3] * d[i];
                        *out = self.round(sum * unit);
                    }
                }
            }
        }
        let scale = match self.numbers {
            Numbers::Real => 1.0 / self.one(),
            Numbers::Integer => 1.0,
        };
        positions.tail(
            (texel.x, texel.y, texel.mip),
            scale,
            &mut row[self.lanes(1).end..self.inputs],
        );
    }

    /// isa's rounding of an input (ties up) and its saturation, where inputs are integers.
    #[inline(always)]
    fn round(&self, value: f32) -> f32 {
        match self.numbers {
            Numbers::Real => value,
            Numbers::Integer => {
                let (low, high) = input_range(self.input_bits);
                (value + 0.5).floor().clamp(low as f32, high as f32)
            }
        }
    }

    /// Adds the gradient of a texel's inputs to that of a grid's latents, in units of the latents'
    /// codes up to the factor [`Embedding::latent_unit`].
    #[inline(always)]
    pub(crate) fn scatter(
        &self,
        grid: usize,
        corners: &[u32; 4],
        weights: &[f32; 4],
        row: &[f32],
        gradient: &mut [f32],
    ) {
        let channels = self.channels[grid];
        let row = &row[self.lanes(grid)];
        match self.sampling[grid] {
            GridSampling::Corners => {
                for (d, &at) in row.chunks_exact(channels).zip(corners) {
                    let at = at as usize;
                    for (g, d) in gradient[at..at + channels].iter_mut().zip(d) {
                        *g += d;
                    }
                }
            }
            GridSampling::Interpolated => {
                for (&weight, &at) in weights.iter().zip(corners) {
                    let (weight, at) = (weight / (ONE * ONE), at as usize);
                    for (g, d) in gradient[at..at + channels].iter_mut().zip(row) {
                        *g += weight * d;
                    }
                }
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
