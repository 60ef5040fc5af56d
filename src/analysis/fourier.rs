//! Fourier: which frequencies the channels of a grid hold.
//!
//! The paper shows the transform of one channel of each grid ("Effect of interpolation in
//! grid-samplers"): that of grid 1, which is interpolated, is concentrated at low frequencies; that
//! of grid 0, whose corners are concatenated, has high ones as well.

use super::level::level_reals;
use super::spectrum::{Spectrum, SpectrumSummary};
use ndarray::{Array2, Axis};
use ntmu_isa::Asset;
use rayon::prelude::*;
use serde::Serialize;

/// What the paper expects of any asset.
pub const EXPECTED: &str = "grid 1 concentrates at low frequencies: a larger share of its energy lies below half of \
     Nyquist's frequency than of grid 0's";

/// One channel of a grid.
#[derive(Clone, Debug, PartialEq)]
pub struct ChannelSpectrum {
    /// The channel, from 0.
    pub channel: usize,
    /// The latents as reals, \[row, column\].
    pub latents: Array2<f64>,
    /// Their transform.
    pub spectrum: Spectrum,
}

/// The transforms of some channels of a grid.
#[derive(Clone, Debug, PartialEq)]
pub struct GridFourier {
    /// The grid, 0 or 1.
    pub grid: usize,
    /// The level of its pyramid.
    pub level: u8,
    /// The channels, in the order asked for.
    pub channels: Vec<ChannelSpectrum>,
    /// The mean of their powers.
    pub mean: Spectrum,
}

/// Why a grid has no such transform.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FourierError {
    /// The grid lacks the channel.
    #[error("channel of grid {grid}: found {found}; allowed: 0 to {}", .allowed - 1)]
    Channel {
        /// The grid.
        grid: usize,
        /// The channel asked for.
        found: usize,
        /// How many it has.
        allowed: usize,
    },
    /// The asset lacks the level, or the grid.
    #[error("level {found} of grid {grid}: allowed: levels 0 to {} of grids 0 and 1", .allowed - 1)]
    Level {
        /// The grid.
        grid: usize,
        /// The level asked for.
        found: u8,
        /// How many there are.
        allowed: u8,
    },
    /// No channel was asked for.
    #[error("channels of grid {grid}: found none; allowed: at least 1")]
    None {
        /// The grid.
        grid: usize,
    },
}

/// The transforms of channels of a level of a grid; of all of them without a list.
///
/// # Errors
/// When the asset has no such grid, level or channel.
pub fn fourier(
    asset: &Asset,
    grid: usize,
    level: u8,
    channels: Option<&[usize]>,
) -> Result<GridFourier, FourierError> {
    let reals = level_reals(asset, grid, level).ok_or(FourierError::Level {
        grid,
        found: level,
        allowed: asset.shape.level_count(),
    })?;
    let allowed = reals.len_of(Axis(0));
    let channels = channels.map_or_else(|| (0..allowed).collect(), <[usize]>::to_vec);
    if let Some(&found) = channels.iter().find(|&&channel| channel >= allowed) {
        return Err(FourierError::Channel {
            grid,
            found,
            allowed,
        });
    }
    let channels: Vec<ChannelSpectrum> = channels
        .into_par_iter()
        .map(|channel| {
            let latents = reals.index_axis(Axis(0), channel).to_owned();
            ChannelSpectrum {
                channel,
                spectrum: Spectrum::of(latents.view()),
                latents,
            }
        })
        .collect();
    let spectra: Vec<Spectrum> = channels.iter().map(|c| c.spectrum.clone()).collect();
    let mean = Spectrum::mean(&spectra).ok_or(FourierError::None { grid })?;
    Ok(GridFourier {
        grid,
        level,
        channels,
        mean,
    })
}

/// A grid's spectra in numbers.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FourierSummary {
    /// The grid, 0 or 1.
    pub grid: usize,
    /// The level of its pyramid.
    pub level: u8,
    /// Cells along x and y.
    pub size: (usize, usize),
    /// Of the mean power of the channels.
    pub mean: SpectrumSummary,
    /// Of each channel.
    pub channels: Vec<ChannelSummary>,
}

/// A channel's spectrum in numbers.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ChannelSummary {
    /// The channel, from 0.
    pub channel: usize,
    /// Its figures.
    #[serde(flatten)]
    pub summary: SpectrumSummary,
}

impl GridFourier {
    /// The spectra in numbers.
    #[must_use]
    pub fn summary(&self) -> FourierSummary {
        let (rows, columns) = self.mean.power().dim();
        let channels = self.channels.iter().map(|channel| ChannelSummary {
            channel: channel.channel,
            summary: channel.spectrum.summary(),
        });
        FourierSummary {
            grid: self.grid,
            level: self.level,
            size: (columns, rows),
            mean: self.mean.summary(),
            channels: channels.collect(),
        }
    }
}
