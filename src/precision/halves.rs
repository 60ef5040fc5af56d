//! The same network in fp16.
//!
//! An int8 network is trained with the saturation of its activations; in fp16 they go on. So an asset
//! converted this way may lose quality although its numbers are finer.

use super::PrecisionError;
use ntmu_isa::Asset;
use ntmu_isa::activation::Activation;
use ntmu_isa::half::Half;
use ntmu_isa::layer::{HalfParameters, Layer, Parameters, Skip};
use ntmu_isa::rescale::Multiplier;
use ntmu_isa::shape::{LaneFormat, OutputFormat};

/// The asset with every integer layer as an fp16 layer: the same real network, without the
/// roundings and the saturation of its activations.
///
/// An integer register's real is (value − zero point) / 2^(bits − 1) times a factor of the
/// register's own, chosen so that a skip path needs no scale and a hard GELU's output is its real.
///
/// # Errors
/// For an fp16 layer, a table, or a skip path into a hard GELU, whose scale is fixed.
pub fn in_halves(asset: &Asset) -> Result<Asset, PrecisionError> {
    let mut parts = asset.clone().into_parts();
    let mut registers = vec![Register::of(asset.shape.input_format(), 1.0)];
    for (index, layer) in asset.layers.iter().enumerate() {
        let before = registers[index];
        let refuse = |found| PrecisionError::Layer {
            layer: index,
            found,
            allowed: "integer layers without a table, hard GELUs without a skip path",
        };
        let Parameters::Integer(integers) = &layer.parameters else {
            return Err(refuse("fp16"));
        };
        let factor = match (layer.activation, layer.skip) {
            (Activation::Table, _) => return Err(refuse("a table")),
            (Activation::HardGelu { .. }, Some(_)) => {
                return Err(refuse("a skip path into a hard GELU"));
            }
            // The gate's product is 6·2^16 times its real.
            (Activation::HardGelu { scale, .. }, None) => {
                let unit = Register::of(layer.output_format(), 1.0).unit;
                1.0 / (6.0 * 65_536.0 * real(scale) * unit)
            }
            (_, None) => 1.0,
            (_, Some(skip)) => {
                let source = registers[index + 1 - usize::from(skip.span)];
                let unit = Register::of(layer.output_format(), 1.0).unit;
                source.unit / (real(skip.scale) * unit)
            }
        };
        let own = Register::of(layer.output_format(), factor);
        let rows = 0..usize::from(layer.outputs);
        let (mut weights, mut bias) = (Vec::new(), Vec::new());
        for row in rows {
            let to_real = row_factor(asset, index, row, own);
            let scale = real(integers.scales[row]) * to_real;
            let row_weights = integers.row(row, layer.inputs);
            let sum: f64 = row_weights.iter().map(|&w| f64::from(w)).sum();
            let offset = f64::from(integers.bias[row]) + before.zero_point * sum;
            bias.push(half(offset * scale));
            let each = row_weights.iter();
            weights.extend(each.map(|&w| half(f64::from(w) * scale / before.unit)));
        }
        let one = Multiplier::power_of_two(0);
        parts.layers[index] = Layer {
            parameters: Parameters::Half(HalfParameters {
                weights,
                bias,
                quantize: None,
            }),
            activation: match layer.activation {
                Activation::HardGelu { is_clamped, .. } => Activation::HardGelu {
                    scale: one,
                    is_clamped,
                },
                same @ (Activation::Identity
                | Activation::Relu
                | Activation::Leaky { .. }
                | Activation::Table) => same,
            },
            skip: layer.skip.map(|skip| Skip { scale: one, ..skip }),
            ..*layer
        };
        registers.push(own);
    }
    Ok(Asset::new(parts)?)
}

/// How an integer register's values become reals.
#[derive(Clone, Copy)]
struct Register {
    /// The real of one value.
    unit: f64,
    /// The value of the real zero.
    zero_point: f64,
}

impl Register {
    fn of(format: LaneFormat, factor: f64) -> Register {
        match format {
            LaneFormat::Integer { bits, zero_point } => Register {
                unit: factor * 2_f64.powi(1 - i32::from(bits)),
                zero_point: f64::from(zero_point),
            },
            LaneFormat::Half => Register {
                unit: factor,
                zero_point: 0.0,
            },
        }
    }
}

/// From a row's rescaled accumulator to its real.
fn row_factor(asset: &Asset, index: usize, row: usize, own: Register) -> f64 {
    if index + 1 == asset.layers.len() {
        let format = asset.shape.outputs[row];
        return match format {
            OutputFormat::Float16 => 1.0,
            OutputFormat::Unorm8 | OutputFormat::Unorm16 | OutputFormat::Snorm8 => {
                1.0 / f64::from(format.range().1)
            }
        };
    }
    match asset.layers[index].activation {
        // The argument of the gate has eight fractional bits.
        Activation::HardGelu { .. } => 1.0 / 256.0,
        Activation::Identity | Activation::Relu | Activation::Leaky { .. } | Activation::Table => {
            own.unit
        }
    }
}

fn real(scale: Multiplier) -> f64 {
    f64::from(scale.mantissa()) / 2_f64.powi(i32::from(scale.shift()))
}

fn half(real: f64) -> Half {
    Half::round(real as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::precision::with_activations;
    use ntmu_isa::Program;
    use ntmu_isa::layout::Layout;
    use ntmu_model::Request;
    use ntmu_model::exec::Decoder;

    #[test]
    fn where_nothing_saturates_halves_are_nearer_to_sixteen_bits_than_bytes_are() {
        let asset = crate::built_in::asset().unwrap();
        let finest = with_activations(&asset, 16).unwrap();
        let halves = in_halves(&asset).unwrap();
        let taps = |asset: &Asset, request| {
            let program = Program::compile(asset, Layout::LINEAR);
            Decoder::new(asset, &program).taps(request)
        };
        let distance = |a: &[i32], b: &[i32]| -> i64 {
            a.iter().zip(b).map(|(a, b)| i64::from(a - b).pow(2)).sum()
        };
        let (mut of_bytes, mut of_halves, mut texels) = (0, 0, 0);
        for request in Request::blocks(&asset.shape, 3) {
            let truth = taps(&finest, request);
            let mut lanes = truth.layers.iter().flat_map(|layer| &layer.outputs);
            if lanes.any(|&lane| lane == i16::MIN || lane == i16::MAX) {
                continue;
            }
            texels += 1;
            of_bytes += distance(&taps(&asset, request).codes, &truth.codes);
            of_halves += distance(&taps(&halves, request).codes, &truth.codes);
        }
        assert!(texels > 100, "{texels}");
        assert!(10 * of_halves < of_bytes, "{of_halves}, {of_bytes}");
    }

    #[test]
    fn what_is_in_halves_already_is_refused() {
        let asset = crate::built_in::asset().unwrap();
        let halves = in_halves(&asset).unwrap();
        assert!(matches!(
            in_halves(&halves),
            Err(PrecisionError::Layer {
                layer: 0,
                found: "fp16",
                ..
            })
        ));
    }
}
