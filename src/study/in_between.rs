//! Between mips: what a level of detail between two mips costs, and how good each way is.
//!
//! The CNTC paper leaves it open how a texel between two mips is decoded. Each way is measured against the
//! source filtered properly: the mean of mip 0 over the square that a sample stands for.

use crate::decoded::real;
use ndarray::{Array3, ArrayView2, Axis};
use ntmu_isa::Asset;
use ntmu_isa::sampler::{Detail, MipBlend, MipFilter, Order, SampleRequest, Sampler, SamplerError};
use ntmu_model::engine::Engine;
use ntmu_model::sampler::Texture;
use rayon::prelude::*;
use serde::Serialize;

/// One way to decode between mips, at one level of detail.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct InBetween {
    /// The level of detail.
    pub lod: f64,
    /// The way: `source, trilinear`, `two decodes`, `one decode, fractional level`, `nearest mip`.
    pub way: &'static str,
    /// PSNR over all channels against the properly filtered source, in dB.
    pub psnr: f64,
    /// Runs of the synthesizer per sample, mean.
    pub decodes: f64,
}

/// Samples along an axis at most; they are spread over the whole mip.
const SAMPLES: usize = 48;

/// Quarters between two mips that are measured; 0 shows what the mips themselves give.
const QUARTERS: [u8; 4] = [0, 1, 2, 3];

/// Levels of detail that [`in_between`] measures.
#[must_use]
pub fn in_between_points(asset: &Asset) -> u64 {
    levels(asset).len() as u64
}

/// The levels below the last mip of at least eight texels: coarser ones have too few samples.
fn levels(asset: &Asset) -> Vec<f64> {
    let shape = &asset.shape;
    let mips = (0..shape.mip_count.saturating_sub(1)).filter(|&mip| {
        let (width, height) = shape.mip_size(mip + 1);
        width.min(height) >= 8
    });
    mips.flat_map(|mip| QUARTERS.map(|quarter| f64::from(mip) + f64::from(quarter) / 4.0))
        .collect()
}

/// Measures every way at every level of detail. `reference` is the source's chain. `after_level` is
/// called with the levels done.
///
/// # Errors
/// Never for the samplers that are used here.
pub fn in_between(
    asset: &Asset,
    reference: &[Array3<f32>],
    mut after_level: impl FnMut(u64),
) -> Result<Vec<InBetween>, SamplerError> {
    let engine = Engine::new(asset);
    let linear = Sampler::default();
    let ways = [
        ("two decodes", linear.clone()),
        (
            "two decodes, latents filtered",
            Sampler {
                order: Order::FilterThenDecode,
                ..linear.clone()
            },
        ),
        (
            "one decode, fractional level",
            Sampler {
                order: Order::FilterThenDecode,
                mip_blend: MipBlend::Level,
                ..linear.clone()
            },
        ),
        (
            "nearest mip",
            Sampler {
                mip_filter: MipFilter::Point,
                ..linear
            },
        ),
    ];
    let mut found = Vec::new();
    for (done, lod) in (1..).zip(levels(asset)) {
        let places = places(asset, lod);
        let truths: Vec<Vec<f64>> = places
            .par_iter()
            .map(|&place| truth(&reference[0], place, lod.exp2()))
            .collect();
        let plain = places.iter().map(|&place| trilinear(reference, place, lod));
        found.push(InBetween {
            lod,
            way: "source, trilinear",
            psnr: psnr(plain.zip(&truths)),
            decodes: 0.0,
        });
        for (way, sampler) in &ways {
            let texture = Texture::new(&engine, sampler.clone())?;
            let samples: Vec<_> = places
                .par_iter()
                .map(|place| {
                    texture.sample(&SampleRequest {
                        place: place.map(|at| (at as f32).to_bits()),
                        detail: Detail::Lod((lod as f32).to_bits()),
                        random: 0,
                    })
                })
                .collect();
            let decodes: u32 = samples.iter().map(|sample| sample.decodes).sum();
            let reals = samples.iter().map(|sample| {
                let codes = sample.codes.iter().zip(&asset.shape.outputs);
                codes
                    .map(|(&code, &format)| f64::from(real(code, format)))
                    .collect()
            });
            found.push(InBetween {
                lod,
                way,
                psnr: psnr(reals.zip(&truths)),
                decodes: f64::from(decodes) / samples.len() as f64,
            });
        }
        after_level(done);
    }
    Ok(found)
}

/// Places (u, v) at the centres of squares of 2^`lod` texels of mip 0, evenly chosen.
fn places(asset: &Asset, lod: f64) -> Vec<[f64; 2]> {
    let side = lod.exp2();
    let axis = |size: u32| -> Vec<f64> {
        let count = (f64::from(size) / side).floor() as usize;
        let step = count.div_ceil(SAMPLES).max(1);
        let squares = (0..count).step_by(step);
        squares
            .map(|i| (i as f64 + 0.5) * side / f64::from(size))
            .collect()
    };
    let (columns, rows) = (axis(asset.shape.width), axis(asset.shape.height));
    rows.iter()
        .flat_map(|&v| columns.iter().map(move |&u| [u, v]))
        .collect()
}

/// The mean of mip 0 over a square of `side` texels about a place, edges weighted by area.
fn truth(mip0: &Array3<f32>, [u, v]: [f64; 2], side: f64) -> Vec<f64> {
    let (_, height, width) = mip0.dim();
    let columns = cover(u * width as f64, side, width);
    let rows = cover(v * height as f64, side, height);
    mip0.outer_iter()
        .map(|channel| weighted(&channel, &rows, &columns))
        .collect()
}

/// The texels that an interval about `centre` covers, and how much of it each does.
fn cover(centre: f64, side: f64, size: usize) -> Vec<(usize, f64)> {
    let (low, high) = (centre - side / 2.0, centre + side / 2.0);
    let (first, last) = (low.floor().max(0.0) as usize, high.ceil() as usize);
    (first..last.min(size))
        .map(|i| {
            let inside = high.min(i as f64 + 1.0) - low.max(i as f64);
            (i, inside.max(0.0) / side)
        })
        .collect()
}

fn weighted(channel: &ArrayView2<'_, f32>, rows: &[(usize, f64)], columns: &[(usize, f64)]) -> f64 {
    rows.iter()
        .map(|&(row, of_row)| {
            let texels = channel.index_axis(Axis(0), row);
            let sum: f64 = columns
                .iter()
                .map(|&(column, weight)| weight * f64::from(texels[column]))
                .sum();
            of_row * sum
        })
        .sum()
}

/// What a texture unit gives on the uncompressed chain, in reals; wrapped.
fn trilinear(chain: &[Array3<f32>], [u, v]: [f64; 2], lod: f64) -> Vec<f64> {
    let mip = lod.floor() as usize;
    let far = lod - lod.floor();
    let bilinear = |mip: &Array3<f32>| -> Vec<f64> {
        let (_, height, width) = mip.dim();
        let axis = |at: f64, size: usize| {
            let s = at * size as f64 - 0.5;
            let wrapped = |i: f64| i.rem_euclid(size as f64) as usize;
            let fraction = s - s.floor();
            [
                (wrapped(s.floor()), 1.0 - fraction),
                (wrapped(s.floor() + 1.0), fraction),
            ]
        };
        let (columns, rows) = (axis(u, width), axis(v, height));
        mip.outer_iter()
            .map(|channel| weighted(&channel, &rows, &columns))
            .collect()
    };
    let near = bilinear(&chain[mip]);
    if far == 0.0 {
        return near;
    }
    let beyond = bilinear(&chain[mip + 1]);
    near.iter()
        .zip(beyond)
        .map(|(a, b)| a * (1.0 - far) + b * far)
        .collect()
}

fn psnr<'a>(pairs: impl Iterator<Item = (Vec<f64>, &'a Vec<f64>)>) -> f64 {
    let (mut sum, mut count) = (0.0, 0_u64);
    for (found, truth) in pairs {
        for (a, b) in found.iter().zip(truth) {
            sum += (a - b) * (a - b);
            count += 1;
        }
    }
    -10.0 * (sum / count as f64).log10()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_square_of_whole_texels_is_their_mean_and_weights_add_up_to_one() {
        let mip0 = Array3::from_shape_fn((1, 8, 8), |(_, y, x)| (x + 10 * y) as f32);
        // Columns 2 and 3, rows 4 and 5.
        assert_eq!(truth(&mip0, [3.0 / 8.0, 5.0 / 8.0], 2.0), [47.5]);
        for side in [1.0, 1.5, 2.0_f64.powf(1.25), 3.7] {
            let sum: f64 = cover(4.0, side, 8).iter().map(|(_, weight)| weight).sum();
            assert!((sum - 1.0).abs() < 1e-12, "{side}");
        }
    }

    #[test]
    fn at_a_whole_level_the_proper_filter_of_the_source_is_its_mip() {
        let source = crate::built_in::source();
        let asset = crate::built_in::asset().unwrap();
        for lod in [1.0, 2.0] {
            for place in places(&asset, lod) {
                let pairs = trilinear(&source.texels, place, lod);
                for (a, b) in pairs
                    .iter()
                    .zip(truth(&source.texels[0], place, 2_f64.powf(lod)))
                {
                    // Mips are means in f32.
                    assert!((a - b).abs() < 1e-5, "{place:?}");
                }
            }
        }
    }
}
