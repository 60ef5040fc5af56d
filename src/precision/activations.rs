//! Other widths for inputs and activations.

use super::PrecisionError;
use ntmu_isa::accumulate::signed_range;
use ntmu_isa::activation::Activation;
use ntmu_isa::layer::{IntegerParameters, Parameters};
use ntmu_isa::rescale::{Multiplier, MultiplierError};
use ntmu_isa::round::{Rounding, saturate};
use ntmu_isa::shape::LaneFormat;
use ntmu_isa::{Asset, limits};

/// The asset with inputs and activations of `bits` bits, each with its old range: the multipliers
/// that make a value grow by 2^(bits − old), those that read it shrink by it, zero points and biases
/// follow, ties up.
///
/// # Errors
/// When the width is outside 4..=16, when a multiplier or a bias leaves its range, or for an fp16
/// layer.
pub fn with_activations(asset: &Asset, bits: u8) -> Result<Asset, PrecisionError> {
    let (low, high) = limits::LANE_BITS;
    if bits < low || bits > high {
        return Err(PrecisionError::Width {
            what: "activation",
            found: bits,
            low,
            high,
        });
    }
    let mut parts = asset.clone().into_parts();
    parts.shape.input_bits = bits;
    let last = parts.layers.len() - 1;
    let mut before = Step::of(asset.shape.input_format(), bits);
    for (index, layer) in parts.layers.iter_mut().enumerate() {
        let at = |source| PrecisionError::Scale {
            layer: index,
            source,
        };
        let inputs = layer.inputs;
        let Parameters::Integer(parameters) = &mut layer.parameters else {
            return Err(PrecisionError::Layer {
                layer: index,
                found: "fp16",
                allowed: "integer layers",
            });
        };
        reread(parameters, inputs, before);
        if index == last {
            for scale in &mut parameters.scales {
                *scale = grown(*scale, -before.log2).map_err(at)?;
            }
            break;
        }
        let own = Step::of(
            LaneFormat::Integer {
                bits: parameters.output_bits,
                zero_point: parameters.zero_point,
            },
            bits,
        );
        // Where the activation has a scale of its own, that scale makes the output.
        let growth = match &mut layer.activation {
            Activation::Identity | Activation::Relu | Activation::Leaky { .. } => own.log2,
            Activation::HardGelu { scale, .. } => {
                *scale = grown(*scale, own.log2).map_err(at)?;
                0
            }
            Activation::Table => {
                let (low, high) = (i32::from(i16::MIN), i32::from(i16::MAX));
                for entry in &mut parameters.table {
                    *entry = saturate(own.scaled(i64::from(*entry)), low, high) as i16;
                }
                0
            }
        };
        for scale in &mut parameters.scales {
            *scale = grown(*scale, growth - before.log2).map_err(at)?;
        }
        parameters.output_bits = bits;
        parameters.zero_point = own.zero_points.1 as i16;
        before = own;
    }
    Ok(Asset::new(parts)?)
}

/// From one width to another.
#[derive(Clone, Copy)]
struct Step {
    /// log2 of the values that stand for one old value.
    log2: i32,
    /// The old and the new zero point.
    zero_points: (i64, i64),
}

impl Step {
    fn of(format: LaneFormat, bits: u8) -> Step {
        let (old_bits, zero_point) = match format {
            LaneFormat::Integer { bits, zero_point } => (bits, i64::from(zero_point)),
            LaneFormat::Half => (bits, 0),
        };
        let mut step = Step {
            log2: i32::from(bits) - i32::from(old_bits),
            zero_points: (zero_point, 0),
        };
        let (low, high) = signed_range(bits);
        step.zero_points.1 = i64::from(saturate(step.scaled(zero_point), low, high));
        step
    }

    /// An old value in new values.
    fn scaled(self, value: i64) -> i64 {
        if self.log2 >= 0 {
            value << self.log2
        } else {
            Rounding::HalfUp.shift(value, self.log2.unsigned_abs())
        }
    }
}

/// The biases for inputs that have taken a step: less what the old zero point gave, in the new
/// unit, with what the new one gives.
fn reread(parameters: &mut IntegerParameters, inputs: u16, before: Step) {
    for row in 0..parameters.bias.len() {
        let weights = parameters.row(row, inputs);
        let sum: i64 = weights.iter().map(|&w| i64::from(w)).sum();
        let (old, new) = before.zero_points;
        let bias = i64::from(parameters.bias[row]) + old * sum;
        // A bias that no longer fits is refused with the asset.
        let bias = before.scaled(bias) - new * sum;
        parameters.bias[row] = saturate(bias, i32::MIN, i32::MAX);
    }
}

/// A multiplier times 2^`log2`.
fn grown(scale: Multiplier, log2: i32) -> Result<Multiplier, MultiplierError> {
    let shift = i32::from(scale.shift()) - log2;
    match u8::try_from(shift) {
        Ok(shift) => Multiplier::new(scale.mantissa(), shift),
        Err(_) => Err(MultiplierError {
            mantissa: i64::from(scale.mantissa()),
            shift: i64::from(shift),
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::decoded::Decoded;

    #[test]
    fn the_asset_at_its_own_width_is_the_asset() {
        let asset = crate::built_in::asset().unwrap();
        assert_eq!(with_activations(&asset, 8), Ok(asset));
    }

    #[test]
    fn a_width_that_no_register_has_is_refused() {
        let asset = crate::built_in::asset().unwrap();
        for bits in [0, 3, 17] {
            assert!(matches!(
                with_activations(&asset, bits),
                Err(PrecisionError::Width {
                    what: "activation",
                    ..
                })
            ));
        }
    }

    #[test]
    fn more_bits_come_closer_to_the_sixteen_bit_network() {
        let asset = crate::built_in::asset().unwrap();
        let last_mips = |asset: &Asset| {
            let mips = 3..asset.shape.mip_count;
            mips.map(|mip| Decoded::of_mip(asset, mip))
                .collect::<Vec<_>>()
        };
        let finest = last_mips(&with_activations(&asset, 16).unwrap());
        let distance = |bits| {
            let codes = last_mips(&with_activations(&asset, bits).unwrap());
            let pairs = codes.iter().zip(&finest);
            pairs
                .flat_map(|(a, b)| a.mips[0].iter().zip(&b.mips[0]))
                .map(|(a, b)| i64::from(a - b).pow(2))
                .sum::<i64>()
        };
        let distances = [4, 6, 8, 12].map(distance);
        assert!(distances.is_sorted_by(|a, b| a > b), "{distances:?}");
    }
}
