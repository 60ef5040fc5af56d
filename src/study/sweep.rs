//! A small precision sweep: latent bits × weight bits.

use crate::decoded::Decoded;
use crate::metrics::{self, MetricsError};
use crate::precision::{self, PrecisionError, narrow};
use crate::quality;
use ndarray::Array3;
use ntmu_isa::Asset;
use serde::Serialize;

/// One point of the sweep.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SweepPoint {
    /// Bits of a latent in both grids.
    pub latent_bits: u8,
    /// Bits of a weight.
    pub weight_bits: u8,
    /// PSNR over all maps and mips against the source, in dB.
    pub psnr: f64,
    /// Bits per pixel and channel, parameters counted.
    pub bppc: f64,
}

/// Why a sweep ended.
#[derive(Debug, thiserror::Error)]
pub enum SweepStudyError {
    /// A point has no asset.
    #[error(transparent)]
    Narrow(#[from] PrecisionError),
    /// A point cannot be compared with the source.
    #[error(transparent)]
    Metrics(#[from] MetricsError),
}

/// Decodes the asset at up to four latent widths and up to three weight widths, from its own down,
/// and compares each with the source. `after_point` is called with the points done.
///
/// # Errors
/// When the source does not have the asset's shape.
pub fn sweep(
    asset: &Asset,
    reference: &[Array3<f32>],
    mut after_point: impl FnMut(u64),
) -> Result<Vec<SweepPoint>, SweepStudyError> {
    let channels: Vec<usize> = (0..asset.shape.outputs.len()).collect();
    let mips: Vec<usize> = (0..reference.len()).collect();
    let mut points = Vec::new();
    for (latent_bits, weight_bits) in widths(asset) {
        let narrowed = narrow(asset, latent_bits, weight_bits)?;
        let reals = Decoded::of(&narrowed, |_| ()).reals(&narrowed.shape);
        points.push(SweepPoint {
            latent_bits,
            weight_bits,
            psnr: metrics::psnr(reference, &reals, &channels, &mips)?,
            bppc: quality::bppc(&narrowed),
        });
        after_point(points.len() as u64);
    }
    Ok(points)
}

/// Points of [`sweep`].
#[must_use]
pub fn sweep_points(asset: &Asset) -> u64 {
    widths(asset).count() as u64
}

fn widths(asset: &Asset) -> impl Iterator<Item = (u8, u8)> + use<> {
    let widest = asset.shape.grids[0]
        .format
        .bits()
        .min(asset.shape.grids[1].format.bits());
    // An asset without integer layers has one width of weights: its own.
    let weights = precision::weight_bits(asset).max(2);
    let latent_widths = (1..=widest).rev().take(4);
    latent_widths.flat_map(move |latent| {
        (2..=weights)
            .rev()
            .step_by(2)
            .take(3)
            .map(move |weight| (latent, weight))
    })
}
