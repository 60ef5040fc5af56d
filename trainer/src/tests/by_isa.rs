//! Decoding by isa's formulas alone: no model, and nothing of the trainer's own.

use ntmu_isa::Asset;
use ntmu_isa::accumulate::signed_range;
use ntmu_isa::activation::{Activation, gate, gate_argument, leak};
use ntmu_isa::embed::{corner_input, lerp_input, level_input, wave_input};
use ntmu_isa::half::{self, Half};
use ntmu_isa::layer::{HalfParameters, IntegerParameters, Parameters, integer_as_half};
use ntmu_isa::position::AxisPosition;
use ntmu_isa::profile::Profile;
use ntmu_isa::round::saturate;
use ntmu_isa::shape::{GridShape, LaneFormat, Sampling, Shape};

const PROFILE: Profile = Profile::NORMATIVE;

/// Where the latents of a texel's four corners start in a grid, and the texel's position in it.
pub(super) fn corners(
    shape: &Shape,
    grid: usize,
    x: u32,
    y: u32,
    mip: u8,
) -> ([usize; 4], [AxisPosition; 2]) {
    let GridShape {
        channels,
        scale_log2,
        ..
    } = shape.grids[grid];
    let level = shape.pyramid.level_of(mip);
    let as_mip = shape.pyramid.mip_in_level(mip);
    let [px, py] = [x, y].map(|t| AxisPosition::of(t, as_mip, scale_log2, shape.snap));
    let (w, h) = shape.level_size(grid, level);
    let xs = px.corners(w, shape.address_mode);
    let ys = py.corners(h, shape.address_mode);
    let base = shape.level_base(grid, level) as usize;
    let start = |i: usize, j: usize| {
        let cell = ys[j] as usize * w as usize + xs[i] as usize;
        base + cell * usize::from(channels)
    };
    let starts = [start(0, 0), start(1, 0), start(0, 1), start(1, 1)];
    (starts, [px, py])
}

/// The inputs of a texel.
pub(super) fn inputs(asset: &Asset, x: u32, y: u32, mip: u8) -> Vec<i16> {
    let shape = &asset.shape;
    let bits = shape.input_bits;
    let mut out = Vec::new();
    for (g, grid) in shape.grids.iter().enumerate() {
        let (corners, [px, py]) = corners(shape, g, x, y, mip);
        let cells = corners.map(|at| &asset.grids[g][at..at + usize::from(grid.channels)]);
        let format = grid.format;
        match grid.sampling {
            Sampling::Corners => out.extend(
                cells
                    .iter()
                    .copied()
                    .flatten()
                    .map(|&code| corner_input(format.value(code), format, bits, PROFILE.input)),
            ),
            Sampling::Interpolated => {
                let fractions = [px, py].map(|p| p.fraction(PROFILE.subtexel_bits));
                out.extend((0..usize::from(grid.channels)).map(|channel| {
                    let values = cells.map(|cell| format.value(cell[channel]));
                    lerp_input(values, fractions, format, bits, &PROFILE)
                }));
            }
        }
    }
    for octave in 0..shape.octaves {
        for texel in [x, y] {
            out.extend(
                [false, true]
                    .map(|quarter| wave_input(shape.wave, texel, mip, octave, quarter, bits)),
            );
        }
    }
    out.push(level_input(mip, shape.mip_count, bits));
    out.resize(shape.input_count() as usize, 0);
    out.into_iter().map(|v| v as i16).collect()
}

/// A register: integers, or halves by their bits.
type Register = Vec<i16>;

fn halves_of(register: &[i16], format: LaneFormat) -> Vec<Half> {
    let half = |&lane: &i16| match format {
        LaneFormat::Integer { bits, zero_point } => integer_as_half(lane, bits, zero_point),
        LaneFormat::Half => Half::from_bits(lane as u16),
    };
    register.iter().map(half).collect()
}

struct Place<'a> {
    asset: &'a Asset,
    layer: usize,
    /// The inputs, then what each layer gave.
    registers: &'a [Register],
}

impl Place<'_> {
    /// The skip path's source: its register and what that holds.
    fn source(&self) -> Option<(&Register, LaneFormat)> {
        let source = self.asset.skip_source(self.layer)?;
        Some((
            &self.registers[source + 1],
            self.asset.layers[source].output_format(),
        ))
    }

    fn is_last(&self) -> bool {
        self.layer + 1 == self.asset.layers.len()
    }

    fn integer(&self, p: &IntegerParameters, row: usize) -> i32 {
        let layer = &self.asset.layers[self.layer];
        let input = &self.registers[self.layer];
        let weights = p.row(row, layer.inputs);
        let accumulator = PROFILE.accumulator.dot(p.bias[row], weights, input);
        let (scale, requantize) = (p.scales[row], PROFILE.requantize);
        if self.is_last() {
            let (low, high) = self.asset.shape.outputs[row].range();
            return saturate(PROFILE.output.apply(accumulator, scale).into(), low, high);
        }
        let mut value = i64::from(match layer.activation {
            Activation::Identity => requantize.apply(accumulator, scale),
            Activation::Relu => requantize.apply(accumulator.max(0), scale),
            Activation::Leaky { shift } => {
                requantize.apply(leak(accumulator, shift, PROFILE.leak), scale)
            }
            Activation::HardGelu {
                scale: after,
                is_clamped,
            } => {
                let argument = gate_argument(accumulator, scale, requantize, is_clamped);
                requantize.apply(gate(argument), after)
            }
            Activation::Table => unreachable!("the trainer makes no tables"),
        });
        if let (Some(skip), Some((source, LaneFormat::Integer { zero_point, .. }))) =
            (layer.skip, self.source())
        {
            let distance = i32::from(source[row]) - i32::from(zero_point);
            value += i64::from(PROFILE.skip.apply(distance, skip.scale));
        }
        let (low, high) = signed_range(p.output_bits);
        saturate(value + i64::from(p.zero_point), low, high)
    }

    fn half(&self, p: &HalfParameters, row: usize) -> i32 {
        let layer = &self.asset.layers[self.layer];
        let input = halves_of(
            &self.registers[self.layer],
            self.asset.input_format(self.layer),
        );
        let sum = PROFILE
            .sum
            .dot(p.bias[row], p.row(row, layer.inputs), &input);
        let mut real = match layer.activation {
            Activation::Identity => sum,
            Activation::Relu => half::activation::relu(sum),
            Activation::Leaky { shift } => half::activation::leaky(sum, shift),
            Activation::HardGelu { is_clamped, .. } => half::activation::hard_gelu(sum, is_clamped),
            Activation::Table => unreachable!("an fp16 layer has no table"),
        };
        if let Some((source, _)) = self.source() {
            real += Half::from_bits(source[row] as u16).to_f32();
        }
        if self.is_last() {
            let (low, high) = self.asset.shape.outputs[row].range();
            return saturate(
                half::to_integer(real, high as u16, 0, PROFILE.convert),
                low,
                high,
            );
        }
        match p.quantize {
            None => i32::from(Half::round(real).bits()),
            Some(q) => {
                let (low, high) = signed_range(q.bits);
                let value = half::to_integer(real, 1, i32::from(q.exponent), PROFILE.convert);
                saturate(value + i64::from(q.zero_point), low, high)
            }
        }
    }
}

/// The codes of a texel.
pub(super) fn decode(asset: &Asset, x: u32, y: u32, mip: u8) -> Vec<i32> {
    let mut registers = vec![inputs(asset, x, y, mip)];
    let mut rows = Vec::new();
    for (index, layer) in asset.layers.iter().enumerate() {
        let place = Place {
            asset,
            layer: index,
            registers: &registers,
        };
        rows = (0..usize::from(layer.outputs))
            .map(|row| match &layer.parameters {
                Parameters::Integer(p) => place.integer(p, row),
                Parameters::Half(p) => place.half(p, row),
            })
            .collect();
        registers.push(rows.iter().map(|&v| v as i16).collect());
    }
    rows
}
