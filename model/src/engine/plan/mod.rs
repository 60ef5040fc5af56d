//! Plan: an asset's layers, packed for the kernels.

mod half;
mod integer;

pub(super) use half::{HalfLayer, HalfResult};
pub(super) use integer::{IntegerLayer, IntegerSums, Then};

use ntmu_isa::Asset;
use ntmu_isa::layer::Parameters;

/// One layer, ready to run.
#[derive(Clone, Debug)]
pub(super) enum PlannedLayer {
    Integer(Box<IntegerLayer>),
    Half(HalfLayer),
}

/// Packs every layer of an asset.
pub(super) fn layers(asset: &Asset) -> Vec<PlannedLayer> {
    let layers = asset.layers.iter().enumerate();
    layers
        .map(|(index, layer)| match &layer.parameters {
            Parameters::Integer(parameters) => {
                PlannedLayer::Integer(Box::new(IntegerLayer::new(asset, index, parameters)))
            }
            Parameters::Half(parameters) => {
                PlannedLayer::Half(HalfLayer::new(asset, index, parameters))
            }
        })
        .collect()
}
