//! The part of a step that every stage shares: from what the synthesizer sees of the latents to the
//! gradient of that, with the synthesizer's own update on the way.

use super::flat::{Flat, download, upload};
use super::places::Places;
use super::synthesizer::Leaves;
use crate::batch::all_texels;
use crate::descent::Descent;
use crate::error::TrainError;
use crate::latents::Rounding;
use crate::model::{Ground, Model};
use crate::random::half_unit_noise;
use crate::sampler::{Numbers, Texel, Window};
use burn_tensor::{Device, Tensor};
use rayon::prelude::*;

/// Set, synthesizer and losses on a device.
pub(crate) struct Shared {
    pub(crate) device: Device,
    /// Every texel of every mip × channels.
    pub(crate) texels: Tensor<2>,
    /// Where each mip starts among them.
    first_rows: Vec<usize>,
    /// 1 for the texels that count, 0 for those that are masked out; none where all count.
    covered: Option<Tensor<2>>,
    /// How much each channel's squared error counts; none where all count alike.
    weights: Option<Tensor<2>>,
    /// The smallest real of each channel.
    low: Tensor<2>,
    /// The smallest and the largest value of each grid's latents.
    limits: [(f32, f32); 2],
    /// 0 for the parameters of constant channels, 1 for all others; none where all are 1.
    moves: Option<Tensor<1>>,
    pub(crate) synthesizer: Flat,
    /// Losses that nobody has read.
    losses: Vec<Tensor<1>>,
}

impl Shared {
    pub(crate) fn new(ground: &Ground<'_>, model: &Model, device: &Device) -> Shared {
        let channels = ground.texels.channels;
        let mut first_rows = Vec::new();
        let mut rows = 0;
        for mip in ground.texels.mips() {
            first_rows.push(rows);
            rows += mip.len() / channels;
        }
        let masked = |mip: usize| ground.texels.covered(mip as u8).is_some();
        let covered = (0..ground.texels.sizes.len()).any(masked).then(|| {
            let covered = all_texels(&ground.texels.sizes)
                .map(|t| f32::from(u8::from(ground.texels.is_covered(t.x, t.y, t.mip))));
            upload(covered.collect(), [rows, 1], device)
        });
        let weights = &ground.texels.weights;
        let weights = weights.iter().any(|&w| w != 1.0).then_some(weights);
        let mut moves = vec![1.0; model.parameters.len()];
        ground.hold_constants(&mut moves);
        let moves = moves.contains(&0.0).then_some(moves);
        Shared {
            texels: upload(ground.texels.mips().concat(), [rows, channels], device),
            first_rows,
            covered,
            weights: weights.map(|w| upload(w.clone(), [1, channels], device)),
            low: upload(ground.low.clone(), [1, channels], device),
            limits: [0, 1].map(|g: usize| {
                let format = model.latents[g].format;
                (format.min_value() as f32, format.max_value() as f32)
            }),
            moves: moves.map(|m| upload(m, [model.parameters.len()], device)),
            synthesizer: Flat::upload(&model.parameters, &model.moments, device),
            losses: Vec::new(),
            device: device.clone(),
        }
    }

    /// The mean squared errors of the batches since the last call. Waits for the device.
    pub(crate) fn losses(&mut self) -> Result<Vec<f64>, TrainError> {
        if self.losses.is_empty() {
            return Ok(Vec::new());
        }
        let losses = download(Tensor::cat(std::mem::take(&mut self.losses), 0))?;
        Ok(losses.into_iter().map(f64::from).collect())
    }

    /// Latents limited to the range of grid `grid`.
    pub(crate) fn limited<const D: usize>(&self, grid: usize, values: Tensor<D>) -> Tensor<D> {
        let (low, high) = self.limits[grid];
        values.clamp(low, high)
    }

    /// What the synthesizer sees of latents (cells × channels, in codes, within their range). The
    /// noise is made by the processor: it is a hash in 32-bit integers, which few tensor backends
    /// have, and it is the same on all of them.
    pub(crate) fn seen(&self, grid: usize, values: Tensor<2>, rounding: Rounding) -> Tensor<2> {
        match rounding {
            Rounding::Noise(key) => {
                let sides = values.dims();
                let mut noise = vec![0.0; sides[0] * sides[1]];
                noise.par_iter_mut().enumerate().for_each(|(at, noise)| {
                    *noise = half_unit_noise(key, at as u32);
                });
                values + upload(noise, sides, &self.device)
            }
            Rounding::Nearest => self.limited(grid, (values + 0.5).floor()),
        }
    }

    /// Forward and backward over a batch and the update of the synthesizer. The loss is kept for
    /// [`Shared::losses`].
    pub(crate) fn step(
        &mut self,
        ground: &Ground<'_>,
        windows: &[Window],
        texels: &[Texel],
        seen: [Tensor<2>; 2],
        descent: Descent,
    ) -> WayBack {
        let topology = &ground.topology;
        let embedding = ground.embedding(Numbers::Real);
        let cells = seen.each_ref().map(|s| s.dims()[0]);
        let padded = topology.layers.first().map_or(0, |l| l.rows());
        let sizes = (self.first_rows.as_slice(), padded);
        let places = Places::new(
            ground,
            &embedding,
            windows,
            texels,
            cells,
            sizes,
            &self.device,
        );
        let inputs = places.inputs(seen).autodiff().require_grad();
        let leaves = Leaves::of(topology, &self.synthesizer);
        let out = leaves.forward(topology, inputs.clone());
        // As in `Workspace::compare`: limited, but the gradient passes the limit.
        let channels = ground.texels.channels;
        let scale = 1.0 / (texels.len() * channels) as f32;
        let targets = self.texels.clone().select(0, places.rows.clone());
        let real = out.clone().inner().narrow(1, 0, channels);
        let low = self.low.clone().expand(real.dims());
        let mut error = real.max_pair(low).clamp_max(1.0) - targets;
        if let Some(covered) = &self.covered {
            error = error * covered.clone().select(0, places.rows.clone());
        }
        let weighted = match &self.weights {
            Some(weights) => error.clone() * weights.clone(),
            None => error.clone(),
        };
        self.losses.push((weighted.clone() * error).sum() * scale);
        // The scalar product with a constant has that constant as its gradient.
        let mut gradients = (out.narrow(1, 0, channels) * (weighted * (2.0 * scale)))
            .sum()
            .backward();
        let mut gradient = leaves.gradient(&mut gradients);
        if let Some(moves) = &self.moves {
            gradient = gradient * moves.clone();
        }
        self.synthesizer.descend(topology, descent, gradient);
        let of_inputs = inputs.grad_remove(&mut gradients);
        WayBack {
            of_inputs: of_inputs.unwrap_or_else(|| inputs.inner().zeros_like()),
            places,
        }
    }
}

/// What is left of a step when the synthesizer has taken its share.
pub(crate) struct WayBack {
    places: Places,
    of_inputs: Tensor<2>,
}

impl WayBack {
    /// The gradients of both grids' cells, in units of the inputs.
    pub(crate) fn gradients(&self) -> [Tensor<2>; 2] {
        self.places.gradients(&self.of_inputs)
    }
}
