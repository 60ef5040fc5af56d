//! The inputs of the first layer: latents over all their codes, waves and level over all texels.
//!
//! Waves repeat every eight texels of mip 0, so all texels of a mip fall into at most 64 classes by
//! `x mod 8` and `y mod 8`; within a class waves and level are the same. Latents are independent of
//! each other and of the class: a texel's corners are four cells of a grid that may hold anything.
//!
//! Where a grid is concatenated and corners coincide along an axis (a grid of one cell, an edge that
//! clamps or mirrors, a stride as large as a grid that wraps), lanes are the same latent twice. Such
//! texels are classes of their own, unless a texel of the same class has four distinct cells, which
//! can hold everything that fewer can.

use super::range::Range;
use ntmu_isa::Asset;
use ntmu_isa::embed::{corner_input, level_input, wave_input};
use ntmu_isa::position::AxisPosition;
use ntmu_isa::shape::Sampling;
use ntmu_model::Request;

/// Texels after which the waves repeat.
const TILE: u32 = 8;

/// Texels with the same waves and level.
#[derive(Clone, Debug)]
pub(super) struct Class {
    /// One of them.
    pub(super) request: Request,
    /// The waves, then the level.
    pub(super) values: Vec<i64>,
    /// Which corners coincide.
    pub(super) merged: Merged,
}

/// Per grid and axis: the first and the second corner are the same cell. Never set for a grid that
/// is interpolated, whose lanes are one a channel.
pub(super) type Merged = [[bool; 2]; 2];

/// All inputs.
#[derive(Clone, Debug)]
pub(super) struct Inputs {
    /// The lanes of both grids.
    pub(super) latents: Vec<Range>,
    /// All classes of all mips.
    pub(super) classes: Vec<Class>,
    /// Zeros after the level.
    pub(super) padding: usize,
}

impl Inputs {
    pub(super) fn of(asset: &Asset) -> Inputs {
        let shape = &asset.shape;
        let mut latents = Vec::new();
        for grid in shape.grids {
            // An interpolation of equal corners is the corner, by every rule, and others lie between.
            let at = |value| {
                let rounding = asset.profile.input;
                i64::from(corner_input(value, grid.format, shape.input_bits, rounding))
            };
            let range = Range {
                low: at(grid.format.min_value()),
                high: at(grid.format.max_value()),
            };
            latents.extend(vec![range; usize::from(grid.input_count())]);
        }
        Inputs {
            latents,
            classes: classes(asset),
            padding: usize::from(shape.padding),
        }
    }

    /// Every lane of the grids by the latent that it holds: the first lane with that latent.
    pub(super) fn latent_of(asset: &Asset, merged: Merged) -> Vec<usize> {
        let mut latents = Vec::new();
        for (grid, sizes) in asset.shape.grids.iter().enumerate() {
            let (start, channels) = (latents.len(), usize::from(sizes.channels));
            let [is_x, is_y] = merged[grid];
            for lane in 0..usize::from(sizes.input_count()) {
                let (corner, channel) = (lane / channels, lane % channels);
                let right = if is_x { 0 } else { corner % 2 };
                let below = if is_y { 0 } else { corner / 2 };
                latents.push(start + (2 * below + right) * channels + channel);
            }
        }
        latents
    }

    /// Every lane over all classes.
    pub(super) fn lanes(&self) -> Vec<Range> {
        let mut lanes = self.latents.clone();
        let places = self.classes.first().map_or(0, |class| class.values.len());
        lanes.extend((0..places).filter_map(|place| {
            let values = self
                .classes
                .iter()
                .map(|class| Range::point(class.values[place]));
            values.reduce(Range::union)
        }));
        lanes.extend(vec![Range::point(0); self.padding]);
        lanes
    }
}

fn classes(asset: &Asset) -> Vec<Class> {
    let shape = &asset.shape;
    let mut classes = Vec::new();
    for mip in 0..shape.mip_count {
        let (width, height) = shape.mip_size(mip);
        let (rows, columns) = (places(asset, mip, height, 1), places(asset, mip, width, 0));
        for (y, x) in rows
            .iter()
            .flat_map(|y| columns.iter().map(move |x| (y, x)))
        {
            // Both coordinates come from the mip's own size.
            let Ok(request) = Request::new(shape, x.texel, y.texel, mip) else {
                continue;
            };
            classes.push(Class {
                request,
                values: values(asset, request),
                merged: [0, 1].map(|grid: usize| [x.merged[grid], y.merged[grid]]),
            });
        }
    }
    classes
}

/// A texel along an axis that stands for all with its remainder and these coinciding corners.
struct Place {
    texel: u32,
    /// Per grid.
    merged: [bool; 2],
}

/// For every remainder by eight that occurs: one texel whose corners are distinct in both grids, or
/// else one for each way in which they coincide.
fn places(asset: &Asset, mip: u8, size: u32, axis: usize) -> Vec<Place> {
    let shape = &asset.shape;
    let (level, mip) = (shape.pyramid.level_of(mip), shape.pyramid.mip_in_level(mip));
    let merged = |texel: u32| {
        [0, 1].map(|grid: usize| {
            let sizes = shape.grids[grid];
            let (columns, rows) = shape.level_size(grid, level);
            let cells = [columns, rows][axis];
            let position = AxisPosition::of(texel, mip, sizes.scale_log2, shape.snap);
            let [first, second] = position.corners(cells, shape.address_mode);
            sizes.sampling == Sampling::Corners && first == second
        })
    };
    let mut places: Vec<Place> = Vec::new();
    for remainder in 0..TILE.min(size) {
        let start = places.len();
        for texel in (remainder..size).step_by(TILE as usize) {
            let merged = merged(texel);
            if merged == [false; 2] {
                places.truncate(start);
                places.push(Place { texel, merged });
                break;
            }
            if places[start..].iter().all(|place| place.merged != merged) {
                places.push(Place { texel, merged });
            }
        }
    }
    places
}

fn values(asset: &Asset, request: Request) -> Vec<i64> {
    let shape = &asset.shape;
    let (mip, bits) = (request.mip(), shape.input_bits);
    let mut values = Vec::new();
    for octave in 0..shape.octaves {
        for texel in [request.x(), request.y()] {
            for quarter in [false, true] {
                let wave = wave_input(shape.wave, texel, mip, octave, quarter, bits);
                values.push(i64::from(wave));
            }
        }
    }
    values.push(i64::from(level_input(mip, shape.mip_count, bits)));
    values
}
