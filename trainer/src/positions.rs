//! Positions: every texel's level, corners, phases and waves, tabulated from isa's formulas.
//!
//! The decode computes them anew for each texel; a step needs them a hundred thousand times, so
//! they are made once for each axis of each mip. The tables hold what isa's functions returned
//! and nothing else, which is why the trainer cannot disagree with the unit about a position.

use ntmu_isa::embed::{level_input, wave_input};
use ntmu_isa::position::{AxisPosition, CornerSnap};
use ntmu_isa::shape::Shape;

/// One axis of a texel: its corners in both grids.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct AxisEntry {
    /// The two corners in each grid, as cells of the level that serves the mip.
    pub(crate) cells: [[u32; 2]; 2],
    /// The weight of the second corner in each grid, in sixteenths.
    pub(crate) phase: [u8; 2],
}

/// One axis of one mip.
#[derive(Debug)]
struct AxisTable {
    entries: Vec<AxisEntry>,
    /// `2·octaves` waves for each texel, octave by octave, phase 0 then a quarter, as inputs.
    waves: Vec<f32>,
}

/// One level of one grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Level {
    /// Cells along x and y.
    pub(crate) size: [u32; 2],
    /// Cells of the levels before it.
    pub(crate) base: usize,
}

impl Level {
    pub(crate) const fn cells(&self) -> usize {
        self.size[0] as usize * self.size[1] as usize
    }
}

/// The tables of a set.
#[derive(Debug)]
pub(crate) struct Positions {
    /// Along x and along y, for each mip.
    axes: [Vec<AxisTable>; 2],
    /// The level input of each mip.
    level_inputs: Vec<f32>,
    waves_per_axis: usize,
    /// The level of the grids that serves each mip.
    served_by: Vec<u8>,
    mips_under: Vec<u8>,
    /// The levels of each grid, level 0 first.
    pub(crate) levels: [Vec<Level>; 2],
}

impl Positions {
    pub(crate) fn new(shape: &Shape) -> Positions {
        let mips = 0..shape.mip_count;
        let levels = [0, 1].map(|g: usize| -> Vec<Level> {
            let mut base = 0;
            let levels = (0..shape.level_count()).map(|level| {
                let (width, height) = shape.level_size(g, level);
                let size = [width, height];
                let level = Level { size, base };
                base += level.cells();
                level
            });
            levels.collect()
        });
        let table = |axis: usize, texels: u32, mip: u8| AxisTable {
            entries: (0..texels)
                .map(|texel| entry(shape, axis, texel, mip))
                .collect(),
            waves: (0..texels)
                .flat_map(|texel| {
                    (0..shape.octaves).flat_map(move |octave| {
                        [false, true].map(|quarter| {
                            let (wave, bits) = (shape.wave, shape.input_bits);
                            wave_input(wave, texel, mip, octave, quarter, bits) as f32
                        })
                    })
                })
                .collect(),
        };
        Positions {
            axes: [
                mips.clone()
                    .map(|m| table(0, shape.mip_size(m).0, m))
                    .collect(),
                mips.clone()
                    .map(|m| table(1, shape.mip_size(m).1, m))
                    .collect(),
            ],
            level_inputs: mips
                .clone()
                .map(|m| level_input(m, shape.mip_count, shape.input_bits) as f32)
                .collect(),
            waves_per_axis: 2 * usize::from(shape.octaves),
            served_by: mips.map(|m| shape.pyramid.level_of(m)).collect(),
            mips_under: (0..shape.level_count())
                .map(|level| shape.pyramid.reduction_log2(level))
                .collect(),
            levels,
        }
    }

    /// The level of the grids that serves a mip.
    #[inline(always)]
    pub(crate) fn level_of(&self, mip: u8) -> usize {
        usize::from(self.served_by[usize::from(mip)])
    }

    /// The mip under level `level` as mip 0 is under level 0. A chain may end before it.
    pub(crate) fn mip_under(&self, level: usize) -> u8 {
        self.mips_under[level]
    }

    /// Levels of each grid.
    #[inline(always)]
    pub(crate) const fn level_count(&self) -> usize {
        self.levels[0].len()
    }

    /// Cells of all levels of a grid.
    pub(crate) fn cells(&self, grid: usize) -> usize {
        self.levels[grid].iter().map(Level::cells).sum()
    }

    /// The corners of texel `texel` of mip `mip` along x (0) or y (1).
    #[inline(always)]
    pub(crate) fn axis(&self, axis: usize, texel: u32, mip: u8) -> AxisEntry {
        self.axes[axis][usize::from(mip)].entries[texel as usize]
    }

    /// Writes the waves and the level of a texel, times `scale`: octave by octave, x then y,
    /// phase 0 then a quarter, then the level, then zeros.
    #[inline(always)]
    pub(crate) fn tail(&self, (x, y, mip): (u32, u32, u8), scale: f32, out: &mut [f32]) {
        let per_axis = self.waves_per_axis;
        let mip = usize::from(mip);
        let [of_x, of_y] = [(0, x), (1, y)].map(|(axis, texel): (usize, u32)| {
            let waves = &self.axes[axis][mip].waves;
            &waves[texel as usize * per_axis..(texel as usize + 1) * per_axis]
        });
        let (waves, rest) = out.split_at_mut(2 * per_axis);
        for ((out, x), y) in waves
            .chunks_exact_mut(4)
            .zip(of_x.chunks_exact(2))
            .zip(of_y.chunks_exact(2))
        {
            out[0] = x[0] * scale;
            out[1] = x[1] * scale;
            out[2] = y[0] * scale;
            out[3] = y[1] * scale;
        }
        rest.fill(0.0);
        rest[0] = self.level_inputs[mip] * scale;
    }
}

fn entry(shape: &Shape, axis: usize, texel: u32, mip: u8) -> AxisEntry {
    let snap: CornerSnap = shape.snap;
    let level = shape.pyramid.level_of(mip);
    let as_mip = shape.pyramid.mip_in_level(mip);
    let of = |g: usize| AxisPosition::of(texel, as_mip, shape.grids[g].scale_log2, snap);
    let positions = [of(0), of(1)];
    AxisEntry {
        cells: [0, 1].map(|g: usize| {
            let (width, height) = shape.level_size(g, level);
            positions[g].corners([width, height][axis], shape.address_mode)
        }),
        // Sixteenths at texel centres, so below 16.
        phase: positions.map(|p| p.phase as u8),
    }
}
