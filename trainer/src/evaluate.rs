//! Evaluation: the error over every texel of every mip.

use crate::batch::all_texels;
use crate::calibrate::forward;
use crate::config::TILE;
use crate::engine::View;
use crate::sampler::Texel;
use crate::tile::Workspace;
use crate::topology::Topology;
use ntmu_isa::shape::OutputFormat;
use rayon::prelude::*;

/// Tiles of one task.
const TILES: usize = 64;

/// Mean squared errors.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Errors {
    /// Sum of squared errors of each channel of each mip.
    sums: Vec<Vec<f64>>,
    /// Texels of each mip that are not masked out.
    counts: Vec<u64>,
}

impl Errors {
    /// Over all channels and mips: the paper's measure, every texel of the chain counting once.
    pub(crate) fn overall(&self) -> f64 {
        let channels = self.sums.first().map_or(1, Vec::len) as f64;
        let total: f64 = self.sums.iter().flatten().sum();
        total / (channels * self.counts.iter().sum::<u64>() as f64)
    }

    /// Of one channel of mip 0.
    pub(crate) fn channel(&self, channel: usize) -> f64 {
        self.sums[0][channel] / self.counts[0] as f64
    }

    /// Over the channels of one mip.
    pub(crate) fn mip(&self, mip: usize) -> f64 {
        let sums = &self.sums[mip];
        sums.iter().sum::<f64>() / (sums.len() as f64 * self.counts[mip] as f64)
    }
}

/// Decibels of a mean squared error against a peak of 1; infinite for no error.
pub(crate) fn decibels(mean_squared_error: f64) -> f64 {
    -10.0 * mean_squared_error.log10()
}

/// The error over every texel that is not masked out. With `stored`, what a network in reals puts
/// out is rounded to the codes of these formats, as in the numbers of the decode it is anyway.
pub(crate) fn evaluate(
    topology: &Topology,
    stored: Option<&[OutputFormat]>,
    view: View<'_>,
) -> Errors {
    let sizes = &view.texels.sizes;
    let channels = view.texels.channels;
    let mut texels: Vec<Texel> = all_texels(sizes).collect();
    texels.retain(|t| view.texels.is_covered(t.x, t.y, t.mip));
    let partial: Vec<Vec<f64>> = texels
        .par_chunks(TILE * TILES)
        .map_init(
            || Workspace::new(topology),
            |workspace, texels| {
                let mut sums = vec![0.0; channels * sizes.len()];
                for tile in texels.chunks(TILE) {
                    forward(view, workspace, tile);
                    add_errors(stored, view, workspace, tile, &mut sums);
                }
                sums
            },
        )
        .collect();
    let mut sums = vec![0.0; channels * sizes.len()];
    for part in partial {
        for (sum, part) in sums.iter_mut().zip(part) {
            *sum += part;
        }
    }
    Errors {
        sums: sums.chunks(channels).map(<[f64]>::to_vec).collect(),
        counts: (0..sizes.len() as u8)
            .map(|mip| view.texels.counted(mip))
            .collect(),
    }
}

fn add_errors(
    stored: Option<&[OutputFormat]>,
    view: View<'_>,
    workspace: &Workspace,
    tile: &[Texel],
    sums: &mut [f64],
) {
    let channels = view.texels.channels;
    let Some(last) = view.network.layers.last() else {
        return;
    };
    let rows = workspace.output().chunks_exact(last.shape.columns());
    for (row, texel) in rows.zip(tile) {
        let target = view.texels.texel(texel.x, texel.y, texel.mip);
        let sums = &mut sums[usize::from(texel.mip) * channels..];
        for (channel, (&out, &target)) in row.iter().zip(target).enumerate() {
            let mut real = (out / last.unit(channel)).clamp(view.network.low[channel], 1.0);
            if let Some(formats) = stored {
                let most = formats[channel].range().1 as f32;
                real = (real * most).round() / most;
            }
            sums[channel] += f64::from(real - target).powi(2);
        }
    }
}
