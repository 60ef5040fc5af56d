//! Positions: every texel's corners, phases and waves, tabulated from isa's formulas.
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
    /// The two corners, as cells, of each grid.
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

/// The tables of a set.
#[derive(Debug)]
pub(crate) struct Positions {
    /// Along x and along y, for each mip.
    axes: [Vec<AxisTable>; 2],
    /// The level input of each mip.
    levels: Vec<f32>,
    waves_per_axis: usize,
    /// Cells of each grid along x and y.
    pub(crate) grid_sizes: [(u32, u32); 2],
}

impl Positions {
    pub(crate) fn new(shape: &Shape) -> Positions {
        let mips = 0..shape.mip_count;
        let grid_sizes = [shape.grid_size(0), shape.grid_size(1)];
        let table = |texels: u32, mip: u8, cells: [u32; 2]| AxisTable {
            entries: (0..texels)
                .map(|texel| entry(shape, texel, mip, cells))
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
        let [(w0, h0), (w1, h1)] = grid_sizes;
        Positions {
            axes: [
                mips.clone()
                    .map(|m| table(shape.mip_size(m).0, m, [w0, w1]))
                    .collect(),
                mips.clone()
                    .map(|m| table(shape.mip_size(m).1, m, [h0, h1]))
                    .collect(),
            ],
            levels: mips
                .map(|m| level_input(m, shape.mip_count, shape.input_bits) as f32)
                .collect(),
            waves_per_axis: 2 * usize::from(shape.octaves),
            grid_sizes,
        }
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
        rest[0] = self.levels[mip] * scale;
    }
}

fn entry(shape: &Shape, texel: u32, mip: u8, cells: [u32; 2]) -> AxisEntry {
    let snap: CornerSnap = shape.snap;
    let of = |g: usize| AxisPosition::of(texel, mip, shape.grids[g].scale_log2, snap);
    let positions = [of(0), of(1)];
    AxisEntry {
        cells: [0, 1].map(|g: usize| positions[g].corners(cells[g], shape.address_mode)),
        // Sixteenths at texel centres, so below 16.
        phase: positions.map(|p| p.phase as u8),
    }
}
