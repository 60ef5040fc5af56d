//! Conformance vectors of the asset under study.

use ntmu_conformance::emit::{self, Builder, VectorError};
use ntmu_conformance::vector::{Answer, TexelQuery};
use ntmu_conformance::{flag, stage};
use ntmu_isa::layout::Layout;
use ntmu_isa::{Asset, Program};
use ntmu_model::Request;
use ntmu_model::exec::Decoder;

/// Texels of each mip: a diagonal from the first texel to the last.
const TEXELS_PER_MIP: u32 = 4;

/// A vector file, as JSON, with texels of every mip of the asset and all their taps: what a driver
/// team needs to bring up a decoder on this very asset.
///
/// # Errors
/// Never, unless the asset's own decode contradicts the format of vectors.
pub fn vectors(asset: &Asset) -> Result<String, VectorError> {
    let about = "texels on the diagonal of every mip, with the values of every stage";
    let mut builder = Builder::new("texel", about);
    builder.asset("asset", "the asset under study", asset);
    let program = Program::compile(asset, Layout::LINEAR);
    let decoder = Decoder::new(asset, &program);
    for mip in 0..asset.shape.mip_count {
        for request in diagonal(asset, mip) {
            let taps = decoder.taps(request);
            let (x, y) = (request.x(), request.y());
            let query = TexelQuery {
                asset: "asset".to_owned(),
                x,
                y,
                mip,
            };
            let answer = Answer::Channels(taps.codes.clone());
            let comment = format!("({x}, {y}) of mip {mip}");
            builder.tapped(
                &comment,
                &[flag::PLAIN],
                query,
                answer,
                stage::from_model(&taps),
            );
        }
    }
    emit::to_json(&builder.build())
}

/// Texels from the first to the last of a mip, evenly; fewer where the mip is small.
fn diagonal(asset: &Asset, mip: u8) -> Vec<Request> {
    let (width, height) = asset.shape.mip_size(mip);
    let steps = (TEXELS_PER_MIP - 1).min(width.max(height) - 1);
    // A mip of one texel has no steps, and its only texel is at 0.
    let along = |size: u32, step: u32| ((size - 1) * step).checked_div(steps).unwrap_or(0);
    (0..=steps)
        .filter_map(|step| {
            Request::new(&asset.shape, along(width, step), along(height, step), mip).ok()
        })
        .collect()
}
