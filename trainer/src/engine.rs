//! Engine: one step's forward and backward pass over a batch, in parallel and in a fixed order.
//!
//! A batch is cut into [`CHUNKS`] chunks whatever the number of threads. Each chunk sums its own
//! gradients; the sums are added in chunk order. So the result is the same on one thread and on
//! sixty-four.

use crate::batch::Batch;
use crate::config::{CHUNKS, TILE};
use crate::kernel::{Vectorised, vectorised};
use crate::network::Network;
use crate::positions::Positions;
use crate::sampler::{Embedding, Texel, Window};
use crate::texels::Texels;
use crate::tile::Workspace;
use crate::topology::Topology;
use rayon::prelude::*;

/// Parameters whose gradients one task adds up.
const SUMMED_TOGETHER: usize = 4096;

/// What a pass reads.
#[derive(Clone, Copy)]
pub(crate) struct View<'a> {
    pub(crate) network: &'a Network,
    pub(crate) embedding: Embedding,
    pub(crate) positions: &'a Positions,
    pub(crate) windows: &'a [Window],
    /// The latents of both grids, in units of their codes.
    pub(crate) seen: [&'a [f32]; 2],
    pub(crate) texels: &'a Texels,
}

struct Chunk {
    workspace: Workspace,
    targets: Vec<f32>,
    gradient: Vec<f32>,
    error: f64,
}

/// The buffers that steps reuse.
pub(crate) struct Engine {
    chunks: Vec<Chunk>,
    pub(crate) batch: Batch,
    inputs: usize,
    /// The gradient of the parameters after a step.
    pub(crate) parameters: Vec<f32>,
}

impl Engine {
    pub(crate) fn new(topology: &Topology, batch: usize, channels: usize) -> Engine {
        let inputs = topology.layers.first().map_or(0, |l| l.rows());
        let chunk = || Chunk {
            workspace: Workspace::new(topology),
            targets: vec![0.0; TILE * channels],
            gradient: vec![0.0; topology.parameters],
            error: 0.0,
        };
        Engine {
            chunks: (0..CHUNKS).map(|_| chunk()).collect(),
            batch: Batch::new(batch, inputs),
            inputs,
            parameters: vec![0.0; topology.parameters],
        }
    }

    /// Forward and backward over the batch's texels. Leaves the gradient of the mean squared
    /// error in `self.parameters` and, texel by texel, in the batch; returns that error.
    pub(crate) fn step(&mut self, view: View<'_>) -> f64 {
        let Batch {
            texels,
            corners: [c0, c1],
            weights: [w0, w1],
            gradient,
        } = &mut self.batch;
        let len = texels.len().div_ceil(CHUNKS);
        let scale = 1.0 / (texels.len() * view.texels.channels) as f32;
        self.chunks
            .par_iter_mut()
            .zip(texels.par_chunks(len))
            .zip(c0.par_chunks_mut(len).zip(c1.par_chunks_mut(len)))
            .zip(w0.par_chunks_mut(len).zip(w1.par_chunks_mut(len)))
            .zip(gradient.par_chunks_mut(len * self.inputs))
            .for_each(|((((chunk, texels), (c0, c1)), (w0, w1)), gradient)| {
                Pass {
                    view,
                    scale,
                    chunk,
                    texels,
                    corners: [c0, c1],
                    weights: [w0, w1],
                    gradient,
                }
                .run();
            });
        let parts = self.parameters.par_chunks_mut(SUMMED_TOGETHER).enumerate();
        parts.for_each(|(part, sums)| {
            sums.fill(0.0);
            let start = part * SUMMED_TOGETHER;
            for chunk in &self.chunks {
                let gradient = &chunk.gradient[start..start + sums.len()];
                for (sum, g) in sums.iter_mut().zip(gradient) {
                    *sum += g;
                }
            }
        });
        self.chunks.iter().map(|c| c.error).sum::<f64>() * f64::from(scale)
    }

    /// Adds the batch's gradients to those of the latents, in units of the inputs.
    pub(crate) fn scatter(&self, embedding: Embedding, gradients: [&mut [f32]; 2]) {
        let [g0, g1] = gradients;
        let batch = &self.batch;
        rayon::join(
            || {
                vectorised(Scatter {
                    embedding,
                    batch,
                    inputs: self.inputs,
                    grid: 0,
                    gradient: g0,
                })
            },
            || {
                vectorised(Scatter {
                    embedding,
                    batch,
                    inputs: self.inputs,
                    grid: 1,
                    gradient: g1,
                })
            },
        );
    }
}

struct Pass<'a> {
    view: View<'a>,
    scale: f32,
    chunk: &'a mut Chunk,
    texels: &'a [Texel],
    corners: [&'a mut [[u32; 4]]; 2],
    weights: [&'a mut [[f32; 4]]; 2],
    gradient: &'a mut [f32],
}

impl Pass<'_> {
    fn run(self) {
        let Pass {
            view,
            scale,
            chunk,
            texels,
            corners: [c0, c1],
            weights: [w0, w1],
            gradient,
        } = self;
        let Chunk {
            workspace,
            targets,
            gradient: sum,
            error,
        } = chunk;
        sum.fill(0.0);
        *error = 0.0;
        let channels = view.texels.channels;
        let width = workspace.inputs.len() / TILE;
        let tiles = texels.chunks(TILE).zip(gradient.chunks_mut(TILE * width));
        let corners = c0.chunks_mut(TILE).zip(c1.chunks_mut(TILE));
        let weights = w0.chunks_mut(TILE).zip(w1.chunks_mut(TILE));
        for (((texels, gradient), (c0, c1)), (w0, w1)) in tiles.zip(corners).zip(weights) {
            vectorised(GatherTile {
                view,
                texels,
                inputs: &mut workspace.inputs,
                width,
            });
            for (i, (target, &texel)) in targets.chunks_exact_mut(channels).zip(texels).enumerate()
            {
                let (corners, lerp) = view.embedding.corners(view.positions, view.windows, texel);
                c0[i] = corners[0].map(|at| at as u32);
                c1[i] = corners[1].map(|at| at as u32);
                (w0[i], w1[i]) = (lerp[0], lerp[1]);
                view.texels.target(texel.x, texel.y, texel.mip, target);
            }
            workspace.forward(view.network);
            *error += workspace.compare(view.network, targets, &view.texels.weights, scale);
            workspace.backward(view.network, sum, gradient);
        }
    }
}

/// The inputs of a tile's texels.
pub(crate) struct GatherTile<'a> {
    pub(crate) view: View<'a>,
    pub(crate) texels: &'a [Texel],
    pub(crate) inputs: &'a mut [f32],
    /// Padded inputs.
    pub(crate) width: usize,
}

impl Vectorised for GatherTile<'_> {
    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let GatherTile {
            view,
            texels,
            inputs,
            width,
        } = self;
        for (row, &texel) in inputs.chunks_exact_mut(width).zip(texels) {
            view.embedding
                .gather(view.positions, view.windows, texel, view.seen, row);
        }
    }
}

struct Scatter<'a> {
    embedding: Embedding,
    batch: &'a Batch,
    inputs: usize,
    grid: usize,
    gradient: &'a mut [f32],
}

impl Vectorised for Scatter<'_> {
    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let Scatter {
            embedding,
            batch,
            inputs,
            grid,
            gradient,
        } = self;
        let rows = batch.gradient.chunks_exact(inputs);
        let corners = batch.corners[grid].iter().zip(&batch.weights[grid]);
        for (row, (corners, weights)) in rows.zip(corners) {
            embedding.scatter(grid, corners, weights, row, gradient);
        }
    }
}
