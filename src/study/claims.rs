//! The three claims about the model, at a sample of texels.

use ntmu_conformance::claims::{Findings, findings};
use ntmu_isa::Asset;
use ntmu_model::Request;

/// Texels at which the claims are tried; spread over the whole chain.
pub(super) const CLAIM_TEXELS: usize = 512;

/// Tries the claims at texels of every mip.
#[must_use]
pub fn try_claims(asset: &Asset) -> Findings {
    findings(asset, &sample(asset, CLAIM_TEXELS))
}

/// At most `count` texels of all mips, evenly spread.
pub(super) fn sample(asset: &Asset, count: usize) -> Vec<Request> {
    let requests: Vec<Request> = (0..asset.shape.mip_count)
        .flat_map(|mip| Request::blocks(&asset.shape, mip))
        .collect();
    let step = requests.len().div_ceil(count);
    requests.into_iter().step_by(step).collect()
}
