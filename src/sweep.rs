//! Sweep: what fewer bits cost in quality.
//!
//! Each point is the same trained asset with its latents and weights rounded to fewer bits, without
//! training it again: an upper bound on the loss, and the honest question to ask of an asset that
//! already exists.

use ntmu_isa::latent::LatentFormat;
use ntmu_isa::limits;
use ntmu_isa::rescale::MultiplierError;
use ntmu_isa::round::{Rounding, saturate};
use ntmu_isa::{Asset, AssetError};

/// Why an asset cannot be rounded to fewer bits.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SweepError {
    /// A width outside what the format allows, or above the asset's own.
    #[error("{what} bits: found {found}; allowed: {low}..={high}")]
    Width {
        /// `latent` or `weight`.
        what: &'static str,
        /// The width asked for.
        found: u8,
        /// The smallest allowed.
        low: u8,
        /// The asset's own.
        high: u8,
    },
    /// A row's scale would leave the range of a multiplier.
    #[error("layer {layer}: {source}")]
    Scale {
        /// The layer.
        layer: usize,
        /// The scale that cannot be expressed.
        source: MultiplierError,
    },
    /// The rounded parts do not make an asset.
    #[error(transparent)]
    Asset(#[from] AssetError),
}

/// The asset with both grids at `latent_bits` and the weights at `weight_bits`.
///
/// A latent keeps its real: `value' = value / 2^(B − B')`, ties up, saturated. A weight likewise,
/// and its row's multiplier grows by the same power of two, the bias shrinks by it.
///
/// # Errors
/// When a width is outside 1..=the asset's own (2.. for weights).
pub fn narrow(asset: &Asset, latent_bits: u8, weight_bits: u8) -> Result<Asset, SweepError> {
    let mut parts = asset.clone().into_parts();
    for (shape, codes) in parts.shape.grids.iter_mut().zip(&mut parts.grids) {
        let from = shape.format;
        let to = LatentFormat::new(latent_bits)
            .filter(|to| to.bits() <= from.bits())
            .ok_or(SweepError::Width {
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
    let (low, high) = (limits::WEIGHT_BITS.0, parts.weight_bits);
    if weight_bits < low || weight_bits > high {
        return Err(SweepError::Width {
            what: "weight",
            found: weight_bits,
            low,
            high,
        });
    }
    let shift = high - weight_bits;
    let largest = (1 << (weight_bits - 1)) - 1;
    for (index, layer) in parts.layers.iter_mut().enumerate() {
        for weight in &mut layer.weights {
            let rounded = Rounding::HalfUp.shift(i64::from(*weight), u32::from(shift));
            *weight = saturate(rounded, -largest - 1, largest) as i8;
        }
        for bias in &mut layer.bias {
            *bias = Rounding::HalfUp.shift(i64::from(*bias), u32::from(shift)) as i32;
        }
        for scale in &mut layer.scales {
            *scale = scale
                .times_power_of_two(shift)
                .map_err(|source| SweepError::Scale {
                    layer: index,
                    source,
                })?;
        }
    }
    parts.weight_bits = weight_bits;
    Ok(Asset::new(parts)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_asset_at_its_own_width_is_the_asset() {
        let asset = crate::built_in::asset().unwrap();
        let bits = asset.shape.grids[0].format.bits();
        assert_eq!(narrow(&asset, bits, asset.weight_bits), Ok(asset));
    }

    #[test]
    fn a_width_above_the_assets_own_is_refused() {
        let asset = crate::built_in::asset().unwrap();
        let above = asset.shape.grids[0].format.bits() + 1;
        assert!(matches!(
            narrow(&asset, above, 8),
            Err(SweepError::Width { what: "latent", .. })
        ));
        assert!(matches!(
            narrow(&asset, 1, 1),
            Err(SweepError::Width { what: "weight", .. })
        ));
    }
}
