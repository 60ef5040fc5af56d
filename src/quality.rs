//! Quality: PSNR and SSIM per map, per mip and overall, and what they cost in bits.

use crate::metrics::{self, MetricsError};
use ndarray::Array3;
use ntmu_isa::Asset;
use serde::Serialize;
use std::ops::Range;

/// One pair of figures. `null` in JSON stands for the infinite PSNR of equal images.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Figures {
    /// In dB, peak 1; see [`metrics::psnr`].
    pub psnr: f64,
    /// 0 to 1; see [`metrics::ssim`].
    pub ssim: f64,
}

/// The figures of one map.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MapQuality {
    /// The map's name.
    pub map: String,
    /// Per mip, mip 0 first.
    pub mips: Vec<Figures>,
    /// Over the whole chain.
    pub overall: Figures,
}

/// The figures of a texture set.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Quality {
    /// Per map, in channel order.
    pub maps: Vec<MapQuality>,
    /// All channels, per mip.
    pub mips: Vec<Figures>,
    /// All channels of the whole chain: the paper's definition.
    pub overall: Figures,
}

impl Quality {
    /// Compares `test` with `reference`; both are chains of \[channel, row, column\], 0..=1.
    ///
    /// # Errors
    /// When the two do not have the same shape.
    pub fn measure(
        reference: &[Array3<f32>],
        test: &[Array3<f32>],
        maps: &[(String, Range<usize>)],
    ) -> Result<Quality, MetricsError> {
        let mip_count = reference.len().max(test.len());
        let figures = |channels: &[usize], mips: &[usize]| {
            Ok(Figures {
                psnr: metrics::psnr(reference, test, channels, mips)?,
                ssim: metrics::ssim(reference, test, channels, mips)?,
            })
        };
        let per_mip = |channels: &[usize]| {
            (0..mip_count)
                .map(|mip| figures(channels, &[mip]))
                .collect::<Result<Vec<_>, _>>()
        };
        let all_mips: Vec<usize> = (0..mip_count).collect();
        let maps_measured = maps
            .iter()
            .map(|(name, channels)| {
                let channels: Vec<usize> = channels.clone().collect();
                Ok(MapQuality {
                    map: name.clone(),
                    mips: per_mip(&channels)?,
                    overall: figures(&channels, &all_mips)?,
                })
            })
            .collect::<Result<_, MetricsError>>()?;
        let all: Vec<usize> = maps
            .iter()
            .flat_map(|(_, channels)| channels.clone())
            .collect();
        Ok(Quality {
            maps: maps_measured,
            mips: per_mip(&all)?,
            overall: figures(&all, &all_mips)?,
        })
    }
}

/// The maps of an asset with their channels.
#[must_use]
pub fn maps_of(asset: &Asset) -> Vec<(String, Range<usize>)> {
    asset
        .metadata
        .maps
        .iter()
        .map(|map| {
            let first = usize::from(map.first_channel);
            (
                map.name.clone(),
                first..first + usize::from(map.channel_count),
            )
        })
        .collect()
}

/// Bits per pixel and channel of an asset, parameters counted; see [`metrics::bppc`].
#[must_use]
pub fn bppc(asset: &Asset) -> f64 {
    let shape = &asset.shape;
    let channels = shape.outputs.len();
    metrics::bppc(
        asset.grid_bits(),
        asset.parameter_bits(),
        shape.width,
        shape.height,
        channels,
    )
}
