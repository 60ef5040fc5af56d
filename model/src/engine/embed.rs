//! Embed: the inputs of the synthesizer, as the first layer reads them.
//!
//! The tables hold what does not depend on the texel; nothing here grows with the grids.

use super::kernel::Kernels;
use super::lane::{Fold, Lane};
use super::region::Region;
use crate::place::Place;
use ntmu_isa::Asset;
use ntmu_isa::embed::{
    MAX_OCTAVES, corner_input, lerp_input, level_at, level_input, wave_at, wave_input,
};
use ntmu_isa::filter::FilterRule;
use ntmu_isa::limits::{MAX_GRID_CHANNELS, MAX_LANES};
use ntmu_isa::position::{AxisPosition, PHASE_BITS};
use ntmu_isa::round::Rounding;
use ntmu_isa::shape::{GridShape, Sampling};

/// Texels after which the waves repeat.
const TILE_TEXELS: u32 = 8;

/// Wave inputs of the most octaves.
const MOST_WAVES: usize = 4 * MAX_OCTAVES as usize;

/// One axis of a grid at one texel: the cells of the two corners, and the phase.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Axis {
    cells: [u32; 2],
    phase: u16,
}

/// How four corners become an input.
#[derive(Clone, Copy, Debug)]
enum Lerp {
    /// One addition and one shift.
    Folded(Fold),
    /// By the rules of the specification.
    General,
}

/// The tables of an asset.
#[derive(Clone, Debug)]
pub(super) struct Embed<L> {
    /// Per grid, the input of every code.
    corners: [Box<[L; 256]>; 2],
    lerps: [Lerp; 2],
    /// Per mip, of the waves and the level, and where its latents lie.
    mips: Vec<MipTable<L>>,
    inputs: usize,
}

/// What a mip's texels share.
#[derive(Clone, Debug)]
struct MipTable<L> {
    /// \[y\]\[x\]\[wave\], both modulo [`TILE_TEXELS`].
    waves: [[[L; MOST_WAVES]; TILE_TEXELS as usize]; TILE_TEXELS as usize],
    level: L,
    grids: [Region; 2],
}

/// The positions of a run of columns or rows, per grid.
#[derive(Clone, Debug, Default)]
pub(super) struct Axes {
    grids: [Vec<Axis>; 2],
    first: u32,
}

/// The four cells of a grid around a place, and how far in it lies, in sixteenths.
#[derive(Clone, Copy)]
struct Corners<'a> {
    cells: [&'a [u8]; 4],
    phases: [u16; 2],
}

impl<L: Lane> Embed<L> {
    pub(super) fn new(asset: &Asset) -> Embed<L> {
        let shape = &asset.shape;
        let corners = [0, 1].map(|grid: usize| {
            let format = shape.grids[grid].format;
            Box::new(std::array::from_fn(|code| {
                let value = format.value(code as u8);
                L::of(corner_input(
                    value,
                    format,
                    shape.input_bits,
                    asset.profile.input,
                ))
            }))
        });
        Embed {
            corners,
            lerps: [0, 1].map(|grid| lerp::<L>(asset, grid)),
            mips: (0..shape.mip_count)
                .map(|mip| MipTable::new(asset, mip))
                .collect(),
            inputs: shape.input_count() as usize,
        }
    }

    /// The inputs of one texel, in order.
    pub(super) fn texel(
        &self,
        asset: &Asset,
        kernels: Kernels,
        (x, y, mip): (u32, u32, u8),
        lanes: &mut [L],
    ) {
        let mut rest = lanes;
        for grid in [0, 1] {
            let region = self.region(grid, mip);
            let axes =
                [(x, 0), (y, 1)].map(|(texel, along)| axis(asset, grid, region, texel, along));
            let (own, after) = rest.split_at_mut(grid_inputs(asset, grid));
            self.grid(
                asset,
                kernels,
                grid,
                corners(asset, grid, region, axes),
                own,
            );
            rest = after;
        }
        self.after_grids(asset, (x, y, mip), rest);
    }

    /// The inputs of any place, in order.
    pub(super) fn place(&self, asset: &Asset, place: &Place, lanes: &mut [L]) {
        let (shape, profile) = (&asset.shape, &asset.profile);
        let (bits, mip, phase_bits) = (place.bits(), place.mip(), profile.subtexel_bits);
        let mut rest = lanes;
        for (index, grid) in shape.grids.iter().enumerate() {
            let region = self.region(index, mip);
            let [width, height] = region.size;
            let axes = [(place.x(), width), (place.y(), height)].map(|(coordinate, size)| {
                let (scale, mip, snap) = (grid.scale_log2, region.mip, shape.snap);
                let at = AxisPosition::at(coordinate, bits, mip, scale, snap, phase_bits);
                let cells = at.corners(size, shape.address_mode);
                let phase = at.phase;
                Axis { cells, phase }
            });
            let (own, after) = rest.split_at_mut(grid_inputs(asset, index));
            let corners = corners(asset, index, region, axes);
            match grid.sampling {
                Sampling::Corners => self.concat(index, corners, own),
                Sampling::Interpolated => {
                    let fractions = corners.phases.map(u32::from);
                    general_lerp(asset, index, corners.cells, fractions, own);
                }
            }
            rest = after;
        }
        let mut waves = rest.iter_mut();
        for octave in 0..shape.octaves {
            for coordinate in [place.x(), place.y()] {
                for (quarter, lane) in [false, true].into_iter().zip(&mut waves) {
                    let input_bits = shape.input_bits;
                    let wave = wave_at(
                        shape.wave, coordinate, bits, mip, octave, quarter, input_bits,
                    );
                    *lane = L::of(wave);
                }
            }
        }
        let (lod, lod_bits) = (place.lod(), place.lod_bits());
        let level = level_at(lod, lod_bits, shape.mip_count, shape.input_bits);
        fill_end(&mut rest[usize::from(shape.wave_count())..], L::of(level));
    }

    /// The inputs of `count` texels of a row, from `x` on, as texels `at..` of a tile.
    pub(super) fn run(
        &self,
        asset: &Asset,
        kernels: Kernels,
        axes: (&Axes, &Axes),
        (x, y, mip): (u32, u32, u8),
        (at, count): (usize, usize),
        output: &mut [L::Group],
    ) {
        let regions = [0, 1].map(|grid| self.region(grid, mip));
        // Corners of grid 0 fill whole groups, which all texels of a cell share.
        let shared = match asset.shape.grids[0].sampling {
            Sampling::Corners => grid_inputs(asset, 0),
            Sampling::Interpolated => 0,
        };
        let groups = self.inputs.div_ceil(L::COUNT);
        let (first, rest) = output[..groups].split_at_mut(shared / L::COUNT);
        if shared > 0 {
            let mut lanes = [L::ZERO; 4 * MAX_GRID_CHANNELS as usize];
            let lanes = &mut lanes[..shared];
            for (from, length, positions) in runs(axes, 0, (x, y), count) {
                self.concat(0, corners(asset, 0, regions[0], positions), lanes);
                L::fill(first, at + from, length, lanes);
            }
        }
        let mut lanes = [L::ZERO; MAX_LANES as usize];
        let lanes = &mut lanes[..self.inputs - shared];
        let own = grid_inputs(asset, 0) - shared;
        let second = own..own + grid_inputs(asset, 1);
        let row = axes.1.at(0, y);
        for (from, length, positions) in runs(axes, 1, (x, y), count) {
            let mut around = corners(asset, 1, regions[1], positions);
            for texel in from..from + length {
                let column = x + texel as u32;
                if own > 0 {
                    let axes = [axes.0.at(0, column), row];
                    let corners = corners(asset, 0, regions[0], axes);
                    self.grid(asset, kernels, 0, corners, &mut lanes[..own]);
                }
                around.phases[0] = axes.0.at(1, column).phase;
                match asset.shape.grids[1].sampling {
                    // The corners are the same for the whole run.
                    Sampling::Corners if texel > from => {}
                    Sampling::Corners | Sampling::Interpolated => {
                        self.grid(asset, kernels, 1, around, &mut lanes[second.clone()]);
                    }
                }
                self.after_grids(asset, (column, y, mip), &mut lanes[second.end..]);
                L::put(rest, at + texel, lanes);
            }
        }
    }

    fn region(&self, grid: usize, mip: u8) -> Region {
        self.mips[usize::from(mip)].grids[grid]
    }

    /// The inputs that a grid gives.
    #[inline]
    fn grid(
        &self,
        asset: &Asset,
        kernels: Kernels,
        grid: usize,
        corners: Corners<'_>,
        lanes: &mut [L],
    ) {
        let [x, y] = corners.phases;
        match (asset.shape.grids[grid].sampling, self.lerps[grid]) {
            (Sampling::Corners, _) => self.concat(grid, corners, lanes),
            (Sampling::Interpolated, Lerp::Folded(fold)) => {
                let weights = [(16 - x) * (16 - y), x * (16 - y), (16 - x) * y, x * y];
                L::interpolate(kernels, corners.cells, weights, fold, lanes);
            }
            (Sampling::Interpolated, Lerp::General) => {
                let bits = asset.profile.subtexel_bits - PHASE_BITS;
                let fractions = [x, y].map(|phase| u32::from(phase) << bits);
                general_lerp(asset, grid, corners.cells, fractions, lanes);
            }
        }
    }

    /// Four corners, one after the other.
    fn concat(&self, grid: usize, corners: Corners<'_>, lanes: &mut [L]) {
        let table = &self.corners[grid];
        let each = lanes.chunks_exact_mut(corners.cells[0].len());
        for (lanes, cell) in each.zip(corners.cells) {
            for (lane, &code) in lanes.iter_mut().zip(cell) {
                *lane = table[usize::from(code)];
            }
        }
    }

    /// The waves, the level and the padding of one texel.
    #[inline]
    fn after_grids(&self, asset: &Asset, (x, y, mip): (u32, u32, u8), lanes: &mut [L]) {
        let table = &self.mips[usize::from(mip)];
        let count = usize::from(asset.shape.wave_count());
        let [at_x, at_y] = [x, y].map(|texel| (texel % TILE_TEXELS) as usize);
        let (waves, end) = lanes.split_at_mut(count);
        waves.copy_from_slice(&table.waves[at_y][at_x][..count]);
        fill_end(end, table.level);
    }
}

/// The level and the padding.
fn fill_end<L: Lane>(end: &mut [L], level: L) {
    end.fill(L::ZERO);
    end[0] = level;
}

fn grid_inputs(asset: &Asset, grid: usize) -> usize {
    usize::from(asset.shape.grids[grid].input_count())
}

/// The latents of four cells as inputs, by the rules of the specification.
fn general_lerp<L: Lane>(
    asset: &Asset,
    grid: usize,
    cells: [&[u8]; 4],
    fractions: [u32; 2],
    lanes: &mut [L],
) {
    let (format, bits) = (asset.shape.grids[grid].format, asset.shape.input_bits);
    for (channel, lane) in lanes.iter_mut().enumerate() {
        let values = cells.map(|cell| format.value(cell[channel]));
        *lane = L::of(lerp_input(values, fractions, format, bits, &asset.profile));
    }
}

/// The runs of texels of a row that have the same corners in a grid: the first texel, how many, and
/// the positions of the first.
fn runs<'t>(
    (columns, rows): (&'t Axes, &'t Axes),
    grid: usize,
    (x, y): (u32, u32),
    count: usize,
) -> impl Iterator<Item = (usize, usize, [Axis; 2])> + 't {
    let row = rows.at(grid, y);
    let columns = &columns.grids[grid][(x - columns.first) as usize..][..count];
    let mut from = 0;
    columns
        .chunk_by(|a, b| a.cells == b.cells)
        .map(move |same| {
            let start = from;
            from += same.len();
            (start, same.len(), [same[0], row])
        })
}

impl Axes {
    /// The positions of texels `first..first + count` along an axis of a mip.
    pub(super) fn new(asset: &Asset, is_row: bool, (first, count): (u32, u32), mip: u8) -> Axes {
        let grids = [0, 1].map(|grid: usize| {
            let region = Region::new(asset, grid, mip);
            (first..first + count)
                .map(|texel| axis(asset, grid, region, texel, usize::from(is_row)))
                .collect()
        });
        Axes { grids, first }
    }

    fn at(&self, grid: usize, texel: u32) -> Axis {
        self.grids[grid][(texel - self.first) as usize]
    }
}

/// `along` is 0 for x and 1 for y.
fn axis(asset: &Asset, grid: usize, region: Region, texel: u32, along: usize) -> Axis {
    let shape = &asset.shape;
    let scale = shape.grids[grid].scale_log2;
    let position = AxisPosition::of(texel, region.mip, scale, shape.snap);
    Axis {
        cells: position.corners(region.size[along], shape.address_mode),
        phase: position.phase,
    }
}

/// The codes of the corners (0,0), (1,0), (0,1), (1,1).
fn corners(asset: &Asset, grid: usize, region: Region, [x, y]: [Axis; 2]) -> Corners<'_> {
    let channels = usize::from(asset.shape.grids[grid].channels);
    let codes = &asset.grids[grid];
    let cell = |(column, row): (u32, u32)| {
        let cell = row as usize * region.size[0] as usize + column as usize;
        let start = region.base + cell * channels;
        &codes[start..start + channels]
    };
    let ([left, right], [top, bottom]) = (x.cells, y.cells);
    let cells = [(left, top), (right, top), (left, bottom), (right, bottom)];
    Corners {
        cells: cells.map(cell),
        phases: [x.phase, y.phase],
    }
}

/// The interpolation of a grid at texel centres.
///
/// By the exact rule a sum of weights in 1/256 is scaled by 2^(input bits − 1 − latent bits − 8),
/// rounded once, and does not saturate: a latent is within ±1/2. Fractions with more bits than a
/// phase give the same sum times a power of two, and so the same input. The weights sum to 256, so
/// the codes' zero point leaves 256 times itself in the sum.
fn lerp<L: Lane>(asset: &Asset, grid: usize) -> Lerp {
    let GridShape { format, .. } = asset.shape.grids[grid];
    let drop = i32::from(format.bits()) + 9 - i32::from(asset.shape.input_bits);
    let (left, right) = (drop.min(0).unsigned_abs(), drop.max(0).unsigned_abs());
    let half = match (asset.profile.interpolate, asset.profile.input) {
        (FilterRule::Exact, Rounding::Floor) => 0,
        (FilterRule::Exact, Rounding::HalfUp) => (1 << right) >> 1,
        (FilterRule::Exact, Rounding::HalfEven | Rounding::HalfAway)
        | (FilterRule::Factored | FilterRule::Separable | FilterRule::AllOnes, _) => {
            return Lerp::General;
        }
    };
    let zero = 256 * i32::from(format.zero_point());
    Lerp::Folded(Fold {
        left,
        addend: half + (L::STORED << right) - (zero << left),
        right,
    })
}

impl<L: Lane> MipTable<L> {
    fn new(asset: &Asset, mip: u8) -> MipTable<L> {
        let shape = &asset.shape;
        let wave = |x: usize, y: usize, at: usize| {
            let texel = if at % 4 < 2 { x } else { y } as u32;
            let (octave, quarter) = ((at / 4) as u8, at % 2 == 1);
            L::of(wave_input(
                shape.wave,
                texel,
                mip,
                octave,
                quarter,
                shape.input_bits,
            ))
        };
        MipTable {
            waves: std::array::from_fn(|y| {
                std::array::from_fn(|x| std::array::from_fn(|at| wave(x, y, at)))
            }),
            level: L::of(level_input(mip, shape.mip_count, shape.input_bits)),
            grids: [0, 1].map(|grid| Region::new(asset, grid, mip)),
        }
    }
}
