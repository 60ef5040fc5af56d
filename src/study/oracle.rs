//! The model against the real-number truth.

use serde::Serialize;

/// How far the model's codes lie from the oracle's reals, in units of the output's last place.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OracleStudy {
    /// Codes compared.
    pub codes: u64,
    /// Per difference (model code − oracle rounded to a code): how many codes.
    pub histogram: Vec<(i32, u64)>,
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
