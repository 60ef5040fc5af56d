//! Naive: the specification evaluated on wide integers, for one texel.
//!
//! The second opinion on every bit. It reads an asset's data and computes with `i128` alone, by the
//! definitions: quotients with remainders in place of shifts, fp16 and f32 numbers as integers times
//! powers of two with every rounding written out, sums without a width that are then checked against
//! theirs. It calls no arithmetic of `isa` or `model`, uses no float and is not meant to be fast.
//! Where the model differs from it in any tap of any texel, one of them is wrong.
//!
//! It also says where an accumulator, or an fp16 sum, went beyond its width: there the profile's
//! choice is definition, and nothing is claimed of the distance to the real network.

pub mod float;
mod layer;
pub mod number;

use crate::stage::{GridPart, LayerPart, Stage, Taps};
use float::Number;
use ntmu_isa::Asset;
use ntmu_isa::embed::Wave;
use ntmu_isa::half::Half;
use ntmu_isa::layer::Parameters;
use ntmu_isa::position::{AddressMode, CornerSnap};
use ntmu_isa::round::Rounding;
use ntmu_isa::shape::{LaneFormat, Sampling};
use ntmu_model::Request;
use number::{divide, input, power};
use serde::{Deserialize, Serialize};

/// A row of a layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Place {
    /// From 0.
    pub layer: usize,
    /// From 0.
    pub row: usize,
}

/// A sum that its profile's width does not hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Overflow {
    /// An integer accumulator, which then wraps or saturates.
    Accumulator {
        /// Where.
        place: Place,
        /// After which product, from 0.
        step: usize,
    },
    /// An fp16 sum of a fused order, which then saturates at ±65504.
    Half {
        /// Where.
        place: Place,
        /// After which product, from 0.
        step: usize,
    },
}

/// One texel, decoded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Decoded {
    /// Every stage, as the model's taps have them.
    pub taps: Taps,
    /// The channel codes.
    pub codes: Vec<i32>,
    /// Sums that went beyond their width.
    pub overflows: Vec<Overflow>,
}

/// Decodes a texel.
#[must_use]
pub fn texel(asset: &Asset, request: Request) -> Decoded {
    let mut run = Run {
        asset,
        request,
        taps: Taps::new(),
        overflows: Vec::new(),
    };
    let mut registers = vec![run.inputs()];
    let mut codes = Vec::new();
    for index in 0..asset.layers.len() {
        let made = run.layer(index, &registers);
        if index + 1 == asset.layers.len() {
            codes = made;
        } else {
            registers.push(made);
        }
    }
    let wide = codes.iter().map(|&code| code as i64).collect();
    run.taps.insert(Stage::Channels, wide);
    Decoded {
        codes: codes.iter().map(|&code| code as i32).collect(),
        taps: run.taps,
        overflows: run.overflows,
    }
}

struct Run<'a> {
    asset: &'a Asset,
    request: Request,
    taps: Taps,
    overflows: Vec<Overflow>,
}

/// One axis of the corners around a texel.
struct Axis {
    first: i128,
    stride: i128,
    phase: i128,
    cells: [i128; 2],
}

impl Run<'_> {
    fn tap(&mut self, stage: Stage, values: &[i128]) {
        // All that is tapped fits 32 bits, signed or not.
        let values = values.iter().map(|&value| value as i64).collect();
        self.taps.insert(stage, values);
    }

    fn inputs(&mut self) -> Vec<i128> {
        let (shape, profile) = (&self.asset.shape, &self.asset.profile);
        let bits = shape.input_bits;
        let mut lanes = Vec::new();
        for grid in [0, 1] {
            let (codes, phases) = self.corners(grid);
            let sizes = shape.grids[grid];
            let channels = usize::from(sizes.channels);
            let latent_bits = sizes.format.bits();
            let zero_point = power(u32::from(latent_bits) - 1) - 1;
            let latent = |at: usize| codes[at] - zero_point;
            match sizes.sampling {
                Sampling::Corners => lanes.extend((0..codes.len()).map(|at| {
                    let one = power(u32::from(latent_bits));
                    input(latent(at), one, bits, profile.input)
                })),
                Sampling::Interpolated => lanes.extend((0..channels).map(|channel| {
                    let corners = [0, 1, 2, 3].map(|corner| latent(corner * channels + channel));
                    number::interpolate(profile, corners, phases, latent_bits, bits)
                })),
            }
        }
        let mip = u32::from(self.request.mip());
        for octave in 0..u32::from(shape.octaves) {
            for texel in [self.request.x(), self.request.y()] {
                for quarter in [0, 4] {
                    // Sixteenths of a period, of which a tile of eight texels has 2^octave.
                    let place = (2 * i128::from(texel) + 1) * power(mip + octave) + quarter;
                    let f = place.rem_euclid(16);
                    // The real wave in sixteenths.
                    let wave = match shape.wave {
                        Wave::Triangle => 4 * (f - 8).abs() - 16,
                        Wave::Saw => 2 * f - 16,
                    };
                    lanes.push(input(wave, 16, bits, Rounding::HalfUp));
                }
            }
        }
        let last = i128::from(shape.mip_count) - 1;
        let largest = power(u32::from(bits) - 1) - 1;
        let level = largest * i128::from(mip);
        lanes.push(if last == 0 {
            0
        } else {
            divide(level, last, Rounding::HalfUp)
        });
        lanes.extend(vec![0; usize::from(shape.padding)]);
        self.tap(Stage::Inputs, &lanes);
        lanes
    }

    /// The codes of a grid's four corners, one corner after the other, and the phases.
    fn corners(&mut self, grid: usize) -> (Vec<i128>, [i128; 2]) {
        let shape = &self.asset.shape;
        let sizes = shape.grids[grid];
        let mip = u32::from(self.request.mip());
        let (first, each) = (shape.pyramid.first(), shape.pyramid.each());
        let (first, each) = (u32::from(first), u32::from(each));
        let level = match mip.checked_sub(first) {
            Some(beyond) if each > 0 => 1 + beyond / each,
            Some(_) | None => 0,
        };
        // A level is a grid of its own scale.
        let scale = |level| u32::from(sizes.scale_log2) + level * each;
        let cells_of = |level| {
            [shape.width, shape.height].map(|texels| {
                let cell = power(scale(level));
                (i128::from(texels) + cell - 1) / cell
            })
        };
        let before: i128 = (0..level)
            .map(|level| cells_of(level).iter().product::<i128>())
            .sum();
        let cells = cells_of(level);
        let [x, y] = [(self.request.x(), cells[0]), (self.request.y(), cells[1])]
            .map(|(texel, cells)| self.axis(texel, scale(level), cells));
        let corners = [(0, 0), (1, 0), (0, 1), (1, 1)]
            .map(|(right, below): (usize, usize)| (x.cells[right], y.cells[below]));
        let channels = usize::from(sizes.channels);
        let codes: Vec<i128> = corners
            .iter()
            .flat_map(|(column, row)| {
                let cell = (before + row * cells[0] + column) as usize;
                &self.asset.grids[grid][cell * channels..(cell + 1) * channels]
            })
            .map(|&code| i128::from(code))
            .collect();
        let part = |part| Stage::Grid(grid as u8, part);
        let position = [x.first, x.stride, x.phase, y.first, y.stride, y.phase];
        self.tap(part(GridPart::Position), &position);
        let flat: Vec<i128> = corners.iter().flat_map(|&(c, r)| [c, r]).collect();
        self.tap(part(GridPart::Cells), &flat);
        self.tap(part(GridPart::Codes), &codes);
        (codes, [x.phase, y.phase])
    }

    fn axis(&self, texel: u32, scale: u32, cells: i128) -> Axis {
        let shape = &self.asset.shape;
        let mip = u32::from(self.request.mip());
        // g = (texel + ½)·2^mip / 2^scale − ½ in cells, as a fraction.
        let numerator = (2 * i128::from(texel) + 1) * power(mip) - power(scale);
        let denominator = power(scale + 1);
        let stride = power(mip.saturating_sub(scale));
        let below = numerator.div_euclid(denominator);
        let first = match shape.snap {
            CornerSnap::Cell => below,
            CornerSnap::Stride => below.div_euclid(stride) * stride,
        };
        let inside = numerator - first * denominator;
        let resolve = |cell: i128| match shape.address_mode {
            AddressMode::Wrap => cell.rem_euclid(cells),
            AddressMode::Clamp => cell.clamp(0, cells - 1),
            AddressMode::Mirror => {
                let inside = cell.rem_euclid(2 * cells);
                inside.min(2 * cells - 1 - inside)
            }
        };
        Axis {
            first,
            stride,
            phase: (16 * inside).div_euclid(denominator * stride),
            cells: [resolve(first), resolve(first + stride)],
        }
    }

    /// What a layer writes to its register, or the codes of the last one.
    fn layer(&mut self, index: usize, registers: &[Vec<i128>]) -> Vec<i128> {
        let asset = self.asset;
        match &asset.layers[index].parameters {
            Parameters::Integer(_) => self.integer_layer(index, registers),
            Parameters::Half(_) => self.half_layer(index, registers),
        }
    }

    fn integer_layer(&mut self, index: usize, registers: &[Vec<i128>]) -> Vec<i128> {
        let (asset, profile) = (self.asset, &self.asset.profile);
        let layer = &asset.layers[index];
        let Some(p) = layer.integer() else {
            return Vec::new();
        };
        let rows = 0..usize::from(layer.outputs);
        let inputs = usize::from(layer.inputs);
        let mut accumulators = Vec::new();
        for row in rows.clone() {
            let weights = &p.weights[row * inputs..(row + 1) * inputs];
            let place = Place { layer: index, row };
            let sum = layer::accumulate(
                profile,
                p.bias[row],
                weights,
                &registers[index],
                place,
                &mut self.overflows,
            );
            accumulators.push(sum);
        }
        let activated: Vec<i128> = rows
            .clone()
            .map(|row| layer::activate(profile, layer, p, row, accumulators[row]))
            .collect();
        self.sums(index, &accumulators, &activated);
        if index + 1 == asset.layers.len() {
            let formats = &asset.shape.outputs;
            return rows
                .map(|row| layer::code(profile, formats[row], p.scales[row], activated[row]))
                .collect();
        }
        let outputs: Vec<i128> = rows
            .map(|row| {
                let from = asset.skip_source(index).map(|from| {
                    registers[from + 1][row] - zero_point(asset.layers[from].output_format())
                });
                layer::output(profile, layer, p, (row, activated[row]), from)
            })
            .collect();
        self.tap(Stage::Layer(index as u8, LayerPart::Outputs), &outputs);
        outputs
    }

    fn half_layer(&mut self, index: usize, registers: &[Vec<i128>]) -> Vec<i128> {
        let (asset, profile) = (self.asset, &self.asset.profile);
        let layer = &asset.layers[index];
        let Some(p) = layer.half() else {
            return Vec::new();
        };
        let format = asset.input_format(index);
        let input: Vec<Number> = registers[index].iter().map(|&v| read(v, format)).collect();
        let rows = 0..usize::from(layer.outputs);
        let mut sums = Vec::new();
        for row in rows.clone() {
            let weights = &p.weights[row * input.len()..(row + 1) * input.len()];
            let products: Vec<Number> = weights
                .iter()
                .zip(&input)
                .map(|(&weight, &x)| Number::from_half(weight).times(x))
                .collect();
            let place = Place { layer: index, row };
            let bias = Number::from_half(p.bias[row]);
            sums.push(layer::sum(
                profile,
                bias,
                &products,
                place,
                &mut self.overflows,
            ));
        }
        let activated: Vec<Number> = sums
            .iter()
            .map(|&sum| layer::activate_half(layer, sum))
            .collect();
        let bits = |numbers: &[Number]| -> Vec<i128> {
            let bits = numbers.iter().map(|n| i128::from(n.single_bits()));
            bits.map(|bits| number::wrapped(bits, 32)).collect()
        };
        self.sums(index, &bits(&sums), &bits(&activated));
        if index + 1 == asset.layers.len() {
            let formats = asset.shape.outputs.iter();
            return formats
                .zip(&activated)
                .map(|(&format, &sum)| layer::code_half(profile, format, sum))
                .collect();
        }
        let outputs: Vec<i128> = rows
            .map(|row| {
                let from = asset.skip_source(index);
                let from = from.map(|from| read(registers[from + 1][row], LaneFormat::Half));
                layer::output_half(profile, p, activated[row], from)
            })
            .collect();
        self.tap(Stage::Layer(index as u8, LayerPart::Outputs), &outputs);
        outputs
    }

    fn sums(&mut self, index: usize, accumulators: &[i128], activated: &[i128]) {
        let part = |part| Stage::Layer(index as u8, part);
        self.tap(part(LayerPart::Accumulators), accumulators);
        self.tap(part(LayerPart::Activated), activated);
    }
}

fn zero_point(format: LaneFormat) -> i128 {
    match format {
        LaneFormat::Integer { zero_point, .. } => i128::from(zero_point),
        LaneFormat::Half => 0,
    }
}

/// A lane as an fp16 layer reads it.
fn read(value: i128, format: LaneFormat) -> Number {
    match format {
        LaneFormat::Half => Number::from_half(Half::from_bits(value.rem_euclid(65_536) as u16)),
        LaneFormat::Integer { bits, zero_point } => {
            let mut real = Number::integer(value - i128::from(zero_point));
            real.exponent = 1 - i32::from(bits);
            real.to_half().0
        }
    }
}
