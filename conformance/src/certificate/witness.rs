//! Witness: latents and a texel that reach what a certificate says of the first layer.

use super::Certificate;
use super::inputs::{Class, Inputs};
use super::range::Range;
use ntmu_isa::Asset;
use ntmu_isa::layer::IntegerParameters;
use ntmu_isa::position::AxisPosition;
use ntmu_isa::shape::Sampling;
use ntmu_model::Request;

/// An input of a layer that brings an accumulator to its certified extreme.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Extreme {
    /// The row.
    pub row: usize,
    /// The input, one value a lane.
    pub input: Vec<i64>,
    /// After so many products: 0 is the bias alone.
    pub steps: usize,
    /// The accumulator there.
    pub sum: i64,
}

impl Extreme {
    fn bits(&self) -> u8 {
        Range::point(self.sum).bits()
    }
}

/// An asset with other grids, and a texel at which the first layer reaches its extreme.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Witness {
    /// The same synthesizer and shape.
    pub asset: Asset,
    /// The texel.
    pub request: Request,
    /// What it reaches; `input` is what the texel's latents, waves and level give.
    pub extreme: Extreme,
}

/// A row and what comes to it.
struct Reach<'a> {
    row: usize,
    bias: i32,
    weights: &'a [i8],
    lanes: &'a [Range],
    /// Per lane, the first lane that holds the same latent.
    latent_of: &'a [usize],
}

impl Reach<'_> {
    /// The prefix of the row's sum that needs the most bits, and the ends of the lanes that give it.
    fn extreme(&self) -> Extreme {
        let bias = i64::from(self.bias);
        // The bias alone, and every prefix at its largest and at its smallest.
        let (mut best, mut steps, mut is_high) = (bias, 0, true);
        let size = |sum: i64| sum.max(!sum);
        for high in [true, false] {
            let mut held = vec![0_i64; self.lanes.len()];
            let mut sum = bias;
            for step in 0..self.weights.len() {
                let latent = self.latent_of[step];
                let before = held[latent];
                held[latent] += i64::from(self.weights[step]);
                let lane = self.lanes[step];
                sum +=
                    held[latent] * end(held[latent], lane, high) - before * end(before, lane, high);
                if size(sum) > size(best) {
                    (best, steps, is_high) = (sum, step + 1, high);
                }
            }
        }
        let mut held = vec![0_i64; self.lanes.len()];
        for step in 0..steps {
            held[self.latent_of[step]] += i64::from(self.weights[step]);
        }
        let lanes = self.lanes.iter().zip(self.latent_of);
        Extreme {
            row: self.row,
            input: lanes
                .map(|(&lane, &latent)| end(held[latent], lane, is_high))
                .collect(),
            steps,
            sum: best,
        }
    }
}

/// The end of a lane that moves a sum up or down, by its weight.
fn end(weight: i64, lane: Range, is_high: bool) -> i64 {
    if (weight > 0) == is_high {
        lane.high
    } else {
        lane.low
    }
}

impl Certificate {
    /// For an integer layer after the first: an input within the ranges of the register that it
    /// reads that brings an accumulator to the certified width. It need not be one that the layers
    /// before can give: the ranges are intervals.
    #[must_use]
    pub fn extreme(&self, asset: &Asset, layer: usize) -> Option<Extreme> {
        let register = &self.layers.get(layer.checked_sub(1)?)?.outputs;
        let lanes: Vec<Range> = register.iter().map(|lane| lane.integers()).collect();
        let parameters = asset.layers.get(layer)?.integer()?;
        // Lanes are taken as independent.
        let latent_of: Vec<usize> = (0..lanes.len()).collect();
        let inputs = asset.layers[layer].inputs;
        let rows = parameters.bias.iter().enumerate();
        rows.map(|(row, &bias)| {
            let reach = Reach {
                row,
                bias,
                weights: parameters.row(row, inputs),
                lanes: &lanes,
                latent_of: &latent_of,
            };
            reach.extreme()
        })
        .max_by_key(Extreme::bits)
    }
}

/// Latents and a texel at which the first layer needs all the bits that its certificate says.
///
/// None where the first layer is an fp16 layer.
#[must_use]
pub fn witness(asset: &Asset) -> Option<Witness> {
    let layer = asset.layers.first()?;
    let parameters = layer.integer()?;
    let inputs = Inputs::of(asset);
    let (class, extreme) = most(asset, &inputs, parameters)?;
    let is_high = {
        let lanes = inputs.latents.iter().zip(&extreme.input);
        lanes
            .map(|(lane, &value)| value == lane.high)
            .collect::<Vec<_>>()
    };
    let mut parts = asset.clone().into_parts();
    let mut lane = 0;
    for grid in 0..2 {
        let sizes = parts.shape.grids[grid];
        let channels = usize::from(sizes.channels);
        let request = class.request;
        let pyramid = asset.shape.pyramid;
        let (level, mip) = (
            pyramid.level_of(request.mip()),
            pyramid.mip_in_level(request.mip()),
        );
        let (columns, rows) = asset.shape.level_size(grid, level);
        let base = asset.shape.level_base(grid, level) as usize;
        let axis = |texel, cells| {
            let position = AxisPosition::of(texel, mip, sizes.scale_log2, asset.shape.snap);
            position.corners(cells, asset.shape.address_mode)
        };
        let (x, y) = (axis(request.x(), columns), axis(request.y(), rows));
        let code = |lane: usize| {
            if is_high[lane] {
                sizes.format.max_code()
            } else {
                0
            }
        };
        match sizes.sampling {
            Sampling::Corners => {
                for (right, below) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                    let cell = y[below] as usize * columns as usize + x[right] as usize;
                    for channel in 0..channels {
                        parts.grids[grid][base + cell * channels + channel] = code(lane);
                        lane += 1;
                    }
                }
            }
            Sampling::Interpolated => {
                // Equal corners, wherever they are.
                for (at, latent) in parts.grids[grid].iter_mut().enumerate() {
                    *latent = code(lane + at % channels);
                }
                lane += channels;
            }
        }
    }
    let request = class.request;
    Some(Witness {
        asset: Asset::new(parts).ok()?,
        request,
        extreme,
    })
}

/// The class of texels and the row that need the most bits.
fn most<'i>(
    asset: &Asset,
    inputs: &'i Inputs,
    parameters: &IntegerParameters,
) -> Option<(&'i Class, Extreme)> {
    let width = asset.layers.first()?.inputs;
    let of_class = |class: &'i Class| {
        let places = class.values.iter().map(|&value| Range::point(value));
        let padding = vec![Range::point(0); inputs.padding];
        let lanes: Vec<Range> = inputs
            .latents
            .iter()
            .copied()
            .chain(places)
            .chain(padding)
            .collect();
        let mut latent_of = Inputs::latent_of(asset, class.merged);
        latent_of.extend(latent_of.len()..lanes.len());
        let rows = parameters.bias.iter().enumerate();
        let extremes = rows.map(|(row, &bias)| {
            let reach = Reach {
                row,
                bias,
                weights: parameters.row(row, width),
                lanes: &lanes,
                latent_of: &latent_of,
            };
            reach.extreme()
        });
        Some((class, extremes.max_by_key(Extreme::bits)?))
    };
    let classes = inputs.classes.iter().filter_map(of_class);
    classes.max_by_key(|(_, extreme)| extreme.bits())
}
