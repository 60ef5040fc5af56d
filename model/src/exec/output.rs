//! Output: accumulators become channel codes.

use ntmu_isa::Asset;
use ntmu_isa::layer::Layer;
use ntmu_isa::round::saturate;

pub(super) fn emit(asset: &Asset, layer: &Layer, accumulators: &[i32], codes: &mut [i32]) {
    let requantizer = asset.profile.output;
    let rows = accumulators
        .iter()
        .zip(&layer.scales)
        .zip(&asset.shape.outputs);
    for (code, ((&accumulator, &scale), format)) in codes.iter_mut().zip(rows) {
        let (low, high) = format.range();
        *code = saturate(i64::from(requantizer.apply(accumulator, scale)), low, high);
    }
}
