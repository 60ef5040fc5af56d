//! Fewer bits for latents and weights.

use super::PrecisionError;
use ntmu_isa::Asset;
use ntmu_isa::accumulate::signed_range;
use ntmu_isa::latent::LatentFormat;
use ntmu_isa::layer::{IntegerParameters, Parameters};
use ntmu_isa::limits;
use ntmu_isa::rescale::MultiplierError;
use ntmu_isa::round::{Rounding, saturate};

/// The asset with both grids at `latent_bits` at most, and the weights of its integer layers at
/// `weight_bits` at most.
///
/// A latent keeps its real: `value' = value / 2^(B − B')`, ties up, saturated. A weight likewise,
/// and its row's multiplier grows by the same power of two, the bias shrinks by it.
///
/// # Errors
/// When a width is outside 1..=the asset's own (2.. for weights).
pub fn narrow(asset: &Asset, latent_bits: u8, weight_bits: u8) -> Result<Asset, PrecisionError> {
    let mut parts = asset.clone().into_parts();
    for (shape, codes) in parts.shape.grids.iter_mut().zip(&mut parts.grids) {
        let from = shape.format;
        let to = LatentFormat::new(latent_bits)
            .filter(|to| to.bits() <= from.bits())
            .ok_or(PrecisionError::Width {
                what: "latent",
                found: latent_bits,
                low: 1,
                high: from.bits(),
            })?;
        let shift = u32::from(from.bits() - to.bits());
        for code in codes {
            let value = Rounding::HalfUp.shift(i64::from(from.value(*code)), shift);
            *code = to.code(value as i32);
        }
        shape.format = to;
    }
    let (low, high) = (limits::WEIGHT_BITS.0, super::weight_bits(asset));
    if high > 0 && (weight_bits < low || weight_bits > high) {
        return Err(PrecisionError::Width {
            what: "weight",
            found: weight_bits,
            low,
            high,
        });
    }
    for (index, layer) in parts.layers.iter_mut().enumerate() {
        if let Parameters::Integer(parameters) = &mut layer.parameters {
            narrow_weights(parameters, weight_bits).map_err(|source| PrecisionError::Scale {
                layer: index,
                source,
            })?;
        }
    }
    Ok(Asset::new(parts)?)
}

fn narrow_weights(parameters: &mut IntegerParameters, bits: u8) -> Result<(), MultiplierError> {
    let shift = parameters.weight_bits.saturating_sub(bits);
    let (low, high) = signed_range(parameters.weight_bits - shift);
    for weight in &mut parameters.weights {
        let rounded = Rounding::HalfUp.shift(i64::from(*weight), u32::from(shift));
        *weight = saturate(rounded, low, high) as i8;
    }
    for bias in &mut parameters.bias {
        *bias = Rounding::HalfUp.shift(i64::from(*bias), u32::from(shift)) as i32;
    }
    for scale in &mut parameters.scales {
        *scale = scale.times_power_of_two(shift)?;
    }
    parameters.weight_bits -= shift;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::precision::weight_bits;

    #[test]
    fn the_asset_at_its_own_width_is_the_asset() {
        let asset = crate::built_in::asset().unwrap();
        let bits = asset.shape.grids[0].format.bits();
        assert_eq!(narrow(&asset, bits, weight_bits(&asset)), Ok(asset));
    }

    #[test]
    fn a_width_above_the_assets_own_is_refused() {
        let asset = crate::built_in::asset().unwrap();
        let above = asset.shape.grids[0].format.bits() + 1;
        assert!(matches!(
            narrow(&asset, above, 8),
            Err(PrecisionError::Width { what: "latent", .. })
        ));
        assert!(matches!(
            narrow(&asset, 1, 1),
            Err(PrecisionError::Width { what: "weight", .. })
        ));
    }
}
