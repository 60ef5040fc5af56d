//! The model against the real-number truth.

use crate::decoded::Decoded;
use ndarray::Axis;
use ntmu_conformance::bound::{typical, worst};
use ntmu_conformance::histogram::Histogram;
use ntmu_conformance::oracle::Oracle;
use ntmu_isa::Asset;
use ntmu_model::Request;
use rayon::prelude::*;
use serde::Serialize;

/// Texels whose rounding variances are propagated for the predicted error: they are spread evenly
/// over the chain, and their mean settles to two digits.
const TYPICAL_TEXELS: usize = 256;

/// How far the model's codes lie from the oracle's reals, in units of the output's last place.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OracleStudy {
    /// Codes compared.
    pub codes: u64,
    /// Per difference (model code − oracle rounded to a code): how many codes.
    pub histogram: Vec<(i64, u64)>,
    /// The largest |model − oracle|, the oracle not rounded.
    pub max: f64,
    /// The root of the mean square of model − oracle.
    pub rms: f64,
    /// What the rounding variances predict for that root.
    pub typical: f64,
    /// What interval propagation proves for the largest; loose after many layers.
    pub bound: f64,
}

impl OracleStudy {
    /// The largest difference is within the proven bound.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.max <= self.bound
    }
}

/// Runs the oracle on every texel of every mip. `after_mip` is called with the texels done.
#[must_use]
pub fn compare_with_oracle(
    asset: &Asset,
    decoded: &Decoded,
    mut after_mip: impl FnMut(u64),
) -> OracleStudy {
    let oracle = Oracle::new(asset);
    let mut histogram = Histogram::default();
    let mut done = 0;
    for (mip, codes) in (0..).zip(&decoded.mips) {
        let (_, height, width) = codes.dim();
        // One histogram a row, merged in order: the sums do not depend on the threads.
        let rows: Vec<Histogram> = (0..height)
            .into_par_iter()
            .map(|row| {
                let mut histogram = Histogram::default();
                let texels = codes.index_axis(Axis(1), row);
                for (column, texel) in texels.axis_iter(Axis(1)).enumerate() {
                    let request = Request::new(&asset.shape, column as u32, row as u32, mip);
                    // The codes have the chain's own shape, so the request exists.
                    if let Ok(request) = request {
                        let formats = &asset.shape.outputs;
                        histogram.record(request, formats, &texel.to_vec(), &oracle.texel(request));
                    }
                }
                histogram
            })
            .collect();
        for row in &rows {
            histogram.merge(row);
        }
        done += (height * width) as u64;
        after_mip(done);
    }
    let requests: Vec<Request> = (0..asset.shape.mip_count)
        .flat_map(|mip| Request::blocks(&asset.shape, mip))
        .collect();
    let step = requests.len().div_ceil(TYPICAL_TEXELS);
    let sample: Vec<Request> = requests.into_iter().step_by(step).collect();
    let typical = typical::rms(&oracle, &sample);
    let mean_square = typical.iter().map(|rms| rms * rms).sum::<f64>() / typical.len() as f64;
    OracleStudy {
        codes: histogram.samples,
        histogram: histogram
            .counts
            .iter()
            .map(|(&difference, &count)| (difference, count))
            .collect(),
        max: histogram.max,
        rms: histogram.rms(),
        typical: mean_square.sqrt(),
        bound: worst::asset(asset).into_iter().fold(0.0, f64::max),
    }
}
