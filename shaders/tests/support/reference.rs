//! Reference: one texel, straight from the specification.

use ntmu_isa::Asset;
use ntmu_isa::accumulate::signed_range;
use ntmu_isa::activation::{Activation, gate, gate_argument, leak, table_index};
use ntmu_isa::embed::{corner_input, lerp_input, level_input, wave_input};
use ntmu_isa::half::activation::{hard_gelu, leaky, relu};
use ntmu_isa::half::{Half, to_integer};
use ntmu_isa::layer::{
    HalfParameters, IntegerParameters, Layer, Parameters, Quantize, integer_as_half,
};
use ntmu_isa::position::AxisPosition;
use ntmu_isa::round::saturate;
use ntmu_isa::shape::{LaneFormat, OutputFormat, Sampling};
use ntmu_shaders::{GridTap, LayerTap, Taps};

/// The taps of one texel.
pub(crate) fn reference(asset: &Asset, request: (u32, u32, u8)) -> Taps {
    let grids = [0, 1].map(|index| grid(asset, index, request));
    let inputs = embed(asset, &grids, request);
    // The inputs, then the outputs of each layer.
    let mut vectors = vec![inputs.clone()];
    let mut layers = Vec::new();
    let mut codes = Vec::new();
    for (index, layer) in asset.layers.iter().enumerate() {
        let source = asset.skip_source(index).map(|source| {
            let (format, vector) = (asset.layers[source].output_format(), &vectors[source + 1]);
            (format, vector.as_slice())
        });
        let place = Place {
            asset,
            layer,
            format: asset.input_format(index),
            input: &vectors[index],
            source,
            is_last: index + 1 == asset.layers.len(),
        };
        let mut tap = match &layer.parameters {
            Parameters::Integer(integer) => place.integer(integer),
            Parameters::Half(half) => place.half(half),
        };
        if place.is_last {
            codes = place.codes(&tap.activated);
            tap.outputs.clear();
        }
        vectors.push(tap.outputs.clone());
        layers.push(tap);
    }
    Taps {
        request,
        grids,
        inputs,
        layers,
        codes,
    }
}

fn grid(asset: &Asset, index: usize, (x, y, mip): (u32, u32, u8)) -> GridTap {
    let shape = &asset.shape;
    let (level, mip) = (shape.pyramid.level_of(mip), shape.pyramid.mip_in_level(mip));
    let (width, height) = shape.level_size(index, level);
    let axis = |t| AxisPosition::of(t, mip, shape.grids[index].scale_log2, shape.snap);
    let columns = axis(x).corners(width, shape.address_mode);
    let rows = axis(y).corners(height, shape.address_mode);
    let codes = rows
        .iter()
        .flat_map(|&row| columns.map(|column| asset.cell(index, level, column, row)))
        .flatten()
        .copied()
        .collect();
    GridTap {
        x: axis(x),
        y: axis(y),
        columns,
        rows,
        codes,
    }
}

fn embed(asset: &Asset, grids: &[GridTap; 2], (x, y, mip): (u32, u32, u8)) -> Vec<i16> {
    let (shape, profile) = (&asset.shape, &asset.profile);
    let bits = shape.input_bits;
    let mut inputs: Vec<i32> = Vec::new();
    for (sizes, tap) in shape.grids.iter().zip(grids) {
        let format = sizes.format;
        match sizes.sampling {
            Sampling::Corners => inputs.extend(
                tap.codes
                    .iter()
                    .map(|&code| corner_input(format.value(code), format, bits, profile.input)),
            ),
            Sampling::Interpolated => {
                let channels = usize::from(sizes.channels);
                let fractions = [tap.x, tap.y].map(|axis| axis.fraction(profile.subtexel_bits));
                inputs.extend((0..channels).map(|channel| {
                    let values = [0, 1, 2, 3]
                        .map(|corner| format.value(tap.codes[corner * channels + channel]));
                    lerp_input(values, fractions, format, bits, profile)
                }));
            }
        }
    }
    for octave in 0..shape.octaves {
        for (texel, quarter) in [(x, false), (x, true), (y, false), (y, true)] {
            inputs.push(wave_input(shape.wave, texel, mip, octave, quarter, bits));
        }
    }
    inputs.push(level_input(mip, shape.mip_count, bits));
    inputs.resize(inputs.len() + usize::from(shape.padding), 0);
    inputs.into_iter().map(|value| value as i16).collect()
}

/// A layer and what it reads.
struct Place<'a> {
    asset: &'a Asset,
    layer: &'a Layer,
    format: LaneFormat,
    input: &'a [i16],
    source: Option<(LaneFormat, &'a [i16])>,
    is_last: bool,
}

impl Place<'_> {
    fn integer(&self, parameters: &IntegerParameters) -> LayerTap {
        let (profile, layer) = (&self.asset.profile, self.layer);
        let accumulators: Vec<i32> = (0..usize::from(layer.outputs))
            .map(|row| {
                let weights = parameters.row(row, layer.inputs);
                let bias = parameters.bias[row];
                profile.accumulator.dot(bias, weights, self.input)
            })
            .collect();
        let activated: Vec<i32> = accumulators
            .iter()
            .zip(&parameters.scales)
            .map(|(&accumulator, &scale)| match layer.activation {
                Activation::Identity => accumulator,
                Activation::Relu => accumulator.max(0),
                Activation::Leaky { shift } => leak(accumulator, shift, profile.leak),
                Activation::HardGelu { is_clamped, .. } => {
                    let requantizer = profile.requantize;
                    gate(gate_argument(accumulator, scale, requantizer, is_clamped))
                }
                Activation::Table => {
                    let index = table_index(accumulator, scale, profile.requantize);
                    i32::from(parameters.table[index])
                }
            })
            .collect();
        let (low, high) = signed_range(parameters.output_bits);
        let outputs = activated.iter().enumerate().map(|(row, &value)| {
            let scaled = match layer.activation {
                Activation::Table => value,
                Activation::HardGelu { scale, .. } => profile.requantize.apply(value, scale),
                Activation::Identity | Activation::Relu | Activation::Leaky { .. } => {
                    profile.requantize.apply(value, parameters.scales[row])
                }
            };
            let sum = i64::from(scaled) + i64::from(self.integer_skip(row));
            saturate(sum + i64::from(parameters.zero_point), low, high) as i16
        });
        LayerTap {
            outputs: outputs.collect(),
            accumulators,
            activated,
        }
    }

    fn integer_skip(&self, row: usize) -> i32 {
        let (Some(skip), Some((format, source))) = (self.layer.skip, self.source) else {
            return 0;
        };
        let LaneFormat::Integer { zero_point, .. } = format else {
            panic!("an integer layer with a skip path from halves");
        };
        let profile = &self.asset.profile;
        let real = i32::from(source[row]) - i32::from(zero_point);
        let (low, high) = signed_range(profile.residual_bits);
        profile.skip.apply(real, skip.scale).clamp(low, high)
    }

    fn half(&self, parameters: &HalfParameters) -> LayerTap {
        let (profile, layer) = (&self.asset.profile, self.layer);
        let inputs: Vec<Half> = self
            .input
            .iter()
            .map(|&value| match self.format {
                LaneFormat::Integer { bits, zero_point } => {
                    integer_as_half(value, bits, zero_point)
                }
                LaneFormat::Half => Half::from_bits(value as u16),
            })
            .collect();
        let sums: Vec<f32> = (0..usize::from(layer.outputs))
            .map(|row| {
                let weights = parameters.row(row, layer.inputs);
                profile.sum.dot(parameters.bias[row], weights, &inputs)
            })
            .collect();
        let activated: Vec<f32> = sums
            .iter()
            .map(|&sum| match layer.activation {
                Activation::Identity => sum,
                Activation::Relu => relu(sum),
                Activation::Leaky { shift } => leaky(sum, shift),
                Activation::HardGelu { is_clamped, .. } => hard_gelu(sum, is_clamped),
                Activation::Table => panic!("a table in an fp16 layer"),
            })
            .collect();
        let outputs = activated.iter().enumerate().map(|(row, &value)| {
            let sum = match self.source {
                None => value,
                Some((_, source)) => value + Half::from_bits(source[row] as u16).to_f32(),
            };
            match parameters.quantize {
                None => Half::round(sum).bits() as i16,
                Some(Quantize {
                    bits,
                    exponent,
                    zero_point,
                }) => {
                    let integer = to_integer(sum, 1, exponent.into(), profile.convert);
                    let (low, high) = signed_range(bits);
                    saturate(integer + i64::from(zero_point), low, high) as i16
                }
            }
        });
        LayerTap {
            outputs: outputs.collect(),
            accumulators: words(&sums),
            activated: words(&activated),
        }
    }

    /// The channel codes of the last layer's sums.
    fn codes(&self, sums: &[i32]) -> Vec<i32> {
        let profile = &self.asset.profile;
        let formats = self.asset.shape.outputs.iter();
        let code = |(row, (&format, &sum)): (usize, (&OutputFormat, &i32))| {
            let (low, high) = format.range();
            match (&self.layer.parameters, format) {
                (Parameters::Integer(integer), OutputFormat::Float16) => {
                    let scale = integer.scales[row];
                    let product = i128::from(sum) * i128::from(scale.mantissa());
                    Half::from_fixed(product, scale.shift().into())
                        .bits()
                        .into()
                }
                (
                    Parameters::Integer(integer),
                    OutputFormat::Unorm8 | OutputFormat::Unorm16 | OutputFormat::Snorm8,
                ) => profile
                    .output
                    .apply(sum, integer.scales[row])
                    .clamp(low, high),
                (Parameters::Half(_), OutputFormat::Float16) => {
                    Half::round(f32::from_bits(sum as u32)).bits().into()
                }
                (
                    Parameters::Half(_),
                    OutputFormat::Unorm8 | OutputFormat::Unorm16 | OutputFormat::Snorm8,
                ) => {
                    let sum = f32::from_bits(sum as u32);
                    saturate(to_integer(sum, high as u16, 0, profile.convert), low, high)
                }
            }
        };
        formats.zip(sums).enumerate().map(code).collect()
    }
}

fn words(sums: &[f32]) -> Vec<i32> {
    sums.iter().map(|sum| sum.to_bits() as i32).collect()
}
