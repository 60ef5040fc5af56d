//! Places: which rows of the grids and of the set the texels of a batch read, as tensors.

use super::flat::upload;
use super::sums::{Sums, indices};
use crate::choices::GridSampling;
use crate::config::TrainConfig;
use crate::model::Ground;
use crate::sampler::{Embedding, Texel, Window};
use burn_tensor::{Device, Int, Tensor};
use rayon::prelude::*;

/// 1 over the sum of a texel's four weights.
const PART: f32 = 1.0 / 256.0;

/// One grid's share of a batch.
struct GridPlaces {
    sampling: GridSampling,
    channels: usize,
    /// One code in units of the inputs.
    unit: f32,
    /// The cells of each texel's four corners.
    corners: Tensor<1, Int>,
    /// Their weights, texels × 4 × 1; none where the corners are not interpolated.
    weights: Option<Tensor<3>>,
    sums: Sums,
}

/// A batch on a device.
pub(crate) struct Places {
    texels: usize,
    grids: [GridPlaces; 2],
    /// Waves, level and padding of each texel.
    tail: Tensor<2>,
    /// The row of each texel among those of all mips.
    pub(crate) rows: Tensor<1, Int>,
}

/// Inputs that a grid gives a texel.
fn lanes(config: &TrainConfig, grid: usize) -> usize {
    let channels = usize::from(config.grids[grid].channels);
    match config.sampling[grid] {
        GridSampling::Corners => 4 * channels,
        GridSampling::Interpolated => channels,
    }
}

impl Places {
    /// The places of `texels` in grids of `cells` cells. `first_rows` says where each mip starts
    /// among the rows of all mips, `inputs` how many the padded first layer has.
    pub(crate) fn new(
        ground: &Ground<'_>,
        embedding: &Embedding,
        windows: &[Window],
        texels: &[Texel],
        cells: [usize; 2],
        (first_rows, inputs): (&[usize], usize),
        device: &Device,
    ) -> Places {
        let config = ground.config;
        let of_texels: Vec<_> = texels
            .par_iter()
            .map(|&texel| embedding.corners(&ground.positions, windows, texel))
            .collect();
        let units = embedding.latent_unit();
        let grids = [0, 1].map(|g: usize| {
            let channels = embedding.channels[g];
            let corners: Vec<i32> = of_texels
                .iter()
                .flat_map(|(corners, _)| corners[g].map(|at| (at / channels) as i32))
                .collect();
            let weights = match embedding.sampling[g] {
                GridSampling::Corners => None,
                GridSampling::Interpolated => {
                    let weights = of_texels.iter().flat_map(|(_, weights)| weights[g]);
                    let weights = weights.map(|w| w * PART).collect();
                    Some(upload(weights, [texels.len(), 4, 1], device))
                }
            };
            GridPlaces {
                sampling: embedding.sampling[g],
                channels,
                unit: units[g],
                sums: Sums::new(&corners, cells[g]),
                corners: indices(corners, device),
                weights,
            }
        });
        let before = lanes(config, 0) + lanes(config, 1);
        let width = inputs - before;
        let scale = 1.0 / (1_u32 << (embedding.input_bits - 1)) as f32;
        let mut tail = vec![0.0; texels.len() * width];
        tail.par_chunks_mut(width).zip(texels).for_each(|(row, t)| {
            let row = &mut row[..embedding.inputs - before];
            ground.positions.tail((t.x, t.y, t.mip), scale, row);
        });
        let row = |t: &Texel| {
            let mip = usize::from(t.mip);
            let (wide, _) = ground.texels.sizes[mip];
            (first_rows[mip] + t.y as usize * wide as usize + t.x as usize) as i32
        };
        Places {
            texels: texels.len(),
            grids,
            tail: upload(tail, [texels.len(), width], device),
            rows: indices(texels.iter().map(row).collect(), device),
        }
    }

    /// The padded inputs of every texel, from the latents of both grids in units of their codes
    /// (cells × channels).
    pub(crate) fn inputs(&self, seen: [Tensor<2>; 2]) -> Tensor<2> {
        let [s0, s1] = seen;
        let parts = vec![
            self.grids[0].inputs(s0, self.texels),
            self.grids[1].inputs(s1, self.texels),
            self.tail.clone(),
        ];
        Tensor::cat(parts, 1)
    }

    /// The gradients of both grids' cells from that of the inputs, in units of the inputs.
    pub(crate) fn gradients(&self, inputs: &Tensor<2>) -> [Tensor<2>; 2] {
        let mut at = 0;
        self.grids.each_ref().map(|grid| {
            let lanes = grid.lanes();
            let own = inputs.clone().narrow(1, at, lanes);
            at += lanes;
            grid.gradient(own, self.texels)
        })
    }
}

impl GridPlaces {
    fn lanes(&self) -> usize {
        match self.sampling {
            GridSampling::Corners => 4 * self.channels,
            GridSampling::Interpolated => self.channels,
        }
    }

    fn inputs(&self, seen: Tensor<2>, texels: usize) -> Tensor<2> {
        let corners = seen.select(0, self.corners.clone());
        let lanes = match &self.weights {
            None => corners.reshape([texels, 4 * self.channels]),
            Some(weights) => {
                let corners = corners.reshape([texels, 4, self.channels]);
                let sum = (corners * weights.clone()).sum_dim(1);
                sum.reshape([texels, self.channels])
            }
        };
        lanes * self.unit
    }

    fn gradient(&self, inputs: Tensor<2>, texels: usize) -> Tensor<2> {
        let rows = match &self.weights {
            None => inputs,
            Some(weights) => {
                let inputs = inputs.reshape([texels, 1, self.channels]);
                (inputs * weights.clone()).reshape([texels, 4 * self.channels])
            }
        };
        self.sums.of(rows.reshape([texels * 4, self.channels]))
    }
}
