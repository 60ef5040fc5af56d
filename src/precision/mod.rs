//! Precision: an existing asset in other numbers.
//!
//! The asset is rounded, not trained again, so its loss is an upper bound on what the numbers cost.
//! Each function gives an asset that a unit can decode, or says why there is none.

mod activations;
mod halves;
mod narrow;

pub use activations::with_activations;
pub use halves::in_halves;
pub use narrow::narrow;

use ntmu_isa::layer::{Layer, Parameters};
use ntmu_isa::rescale::MultiplierError;
use ntmu_isa::shape::LaneFormat;
use ntmu_isa::{Asset, AssetError};

/// Why an asset has no equal in other numbers.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PrecisionError {
    /// A width outside what the format allows, or above the asset's own.
    #[error("{what} bits: found {found}; allowed: {low}..={high}")]
    Width {
        /// `latent`, `weight` or `activation`.
        what: &'static str,
        /// The width asked for.
        found: u8,
        /// The smallest allowed.
        low: u8,
        /// The largest allowed: the format's, or the asset's own.
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
    /// A layer whose arithmetic has no equal in the other numbers.
    #[error("layer {layer}: found {found}; allowed: {allowed}")]
    Layer {
        /// The layer.
        layer: usize,
        /// What it has.
        found: &'static str,
        /// What can be converted.
        allowed: &'static str,
    },
    /// The rounded parts do not make an asset.
    #[error(transparent)]
    Asset(#[from] AssetError),
}

/// What a layer of an asset multiplies: `w8a8` for weights and activations of eight bits, `fp16`.
#[must_use]
pub fn of_layer(asset: &Asset, layer: usize) -> String {
    match (&asset.layers[layer].parameters, asset.input_format(layer)) {
        (Parameters::Integer(p), LaneFormat::Integer { bits, .. }) => {
            format!("w{}a{bits}", p.weight_bits)
        }
        (Parameters::Half(_), _) | (_, LaneFormat::Half) => "fp16".to_owned(),
    }
}

/// What the layers of an asset multiply, each once, in the order of the layers.
#[must_use]
pub fn of_asset(asset: &Asset) -> String {
    let mut found: Vec<String> = Vec::new();
    for precision in (0..asset.layers.len()).map(|layer| of_layer(asset, layer)) {
        if !found.contains(&precision) {
            found.push(precision);
        }
    }
    found.join(" ")
}

/// The most bits that a weight of an integer layer has; 0 where no layer is one.
#[must_use]
pub fn weight_bits(asset: &Asset) -> u8 {
    let integers = asset.layers.iter().filter_map(Layer::integer);
    integers.map(|p| p.weight_bits).max().unwrap_or(0)
}
