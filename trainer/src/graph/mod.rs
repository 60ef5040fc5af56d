//! Graph: the steps in reals, with everything that they change or compare resident on a device.
//!
//! ```text
//! set ─► crops ─► encoder ─► cells ─► range, noise ─► corners ─► synthesizer ─► error
//!                    ▲                                   │             ▲           │
//!                    └──────── sums by cell ◄────────────┴─────────────┴───────────┘
//! ```
//!
//! The parts between the two networks are not left to automatic differentiation: the sums by cell
//! would be slow and in no fixed order (see [`sums`]), and the rules at the limits of latents and
//! outputs are this trainer's own. What is computed is what [`crate::crop`], [`crate::refine`] and
//! [`crate::tile`] compute, from the same texels and the same noise; the numbers differ by the
//! rounding of sums taken in another order. Parameters and moments come from and go to a [`Model`],
//! so that checkpoints, export and the stages in the decode's own numbers need not know of this.

mod crops;
mod flat;
mod places;
mod shared;
mod steps;
mod sums;
mod synthesizer;
#[cfg(test)]
mod tests;

use crate::adam::Rate;
use crate::crop::{self, Crops};
use crate::descent::Descent;
use crate::encoder::{Encoder, backward_from};
use crate::error::TrainError;
use crate::latents::Rounding;
use crate::model::{Ground, Model};
use crate::sampler::{Numbers, Texel, Window};
use burn_tensor::{Device, Tensor};
use crops::Construction;
use flat::{Flat, flat_gradient};
use shared::Shared;

/// What a graph trains beside the synthesizer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Subject {
    /// The encoder and its constructors, on crops.
    Encoder,
    /// Both grids or nothing, on the whole set.
    Latents,
}

enum Trained {
    Encoder(Box<OnCrops>),
    /// Cells × channels as one slice.
    Latents(Box<[Flat; 2]>),
}

struct OnCrops {
    encoder: Encoder,
    parameters: Flat,
    /// For crops of this shape, which seldom changes.
    constructions: Option<((usize, usize, usize), [Construction; 2])>,
}

/// What is drawn for a step.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Drawn<'a> {
    pub(crate) texels: &'a [Texel],
    /// What the synthesizer sees of each grid's latents.
    pub(crate) roundings: [Rounding; 2],
}

/// The state of a run on a device.
pub(crate) struct Graph {
    shared: Shared,
    trained: Trained,
}

impl Graph {
    /// Takes the state of `model` to the device.
    pub(crate) fn new(
        ground: &Ground<'_>,
        model: &Model,
        subject: Subject,
        device: &Device,
    ) -> Graph {
        let trained = match subject {
            Subject::Encoder => Trained::Encoder(Box::new(OnCrops {
                encoder: crop::encoder(ground, &crop::constructors(ground)),
                parameters: Flat::upload(&model.encoder, &model.encoder_moments, device),
                constructions: None,
            })),
            Subject::Latents => {
                let of = |g: usize| {
                    let latents = &model.latents[g];
                    Flat::upload(&latents.values, &latents.moments, device)
                };
                Trained::Latents(Box::new([of(0), of(1)]))
            }
        };
        Graph {
            shared: Shared::new(ground, model, device),
            trained,
        }
    }

    /// Brings the state back.
    pub(crate) fn write_to(&self, model: &mut Model) -> Result<(), TrainError> {
        let synthesizer = &self.shared.synthesizer;
        synthesizer.download(&mut model.parameters, &mut model.moments)?;
        match &self.trained {
            Trained::Encoder(on_crops) => {
                let (parameters, moments) = (&mut model.encoder, &mut model.encoder_moments);
                on_crops.parameters.download(parameters, moments)
            }
            Trained::Latents(grids) => {
                for (flat, latents) in grids.iter().zip(&mut model.latents) {
                    flat.download(&mut latents.values, &mut latents.moments)?;
                }
                Ok(())
            }
        }
    }

    /// The mean squared errors of the batches since the last call. Waits for the device.
    pub(crate) fn losses(&mut self) -> Result<Vec<f64>, TrainError> {
        self.shared.losses()
    }

    /// [`Model::encoder_step`] on the device; nothing happens in a graph without an encoder.
    pub(crate) fn crops_step(
        &mut self,
        ground: &Ground<'_>,
        crops: &Crops,
        drawn: Drawn<'_>,
        of_encoder: Rate,
        of_synthesizer: Descent,
    ) {
        match &mut self.trained {
            Trained::Encoder(on_crops) => {
                on_crops.step(
                    &mut self.shared,
                    ground,
                    crops,
                    drawn,
                    of_synthesizer,
                    of_encoder,
                );
            }
            Trained::Latents(_) => {}
        }
    }

    /// [`Model::step`] in reals on the device; nothing happens in a graph without latents. The
    /// latents have a rate each, in codes; without rates they stay.
    pub(crate) fn set_step(
        &mut self,
        ground: &Ground<'_>,
        drawn: Drawn<'_>,
        of_synthesizer: Descent,
        of_latents: Option<[Rate; 2]>,
    ) {
        let grids = match &mut self.trained {
            Trained::Encoder(_) => return,
            Trained::Latents(grids) => grids,
        };
        let shared = &mut self.shared;
        let embedding = ground.embedding(Numbers::Real);
        let seen = [0, 1].map(|g: usize| {
            let values = grids[g].values.clone();
            let channels = embedding.channels[g];
            let cells = values.dims()[0] / channels;
            shared.seen(g, values.reshape([cells, channels]), drawn.roundings[g])
        });
        let windows = Window::whole(&ground.positions);
        let way_back = shared.step(ground, &windows, drawn.texels, seen, of_synthesizer);
        let Some(rates) = of_latents else {
            return;
        };
        let of_cells = way_back.gradients();
        let units = embedding.latent_unit();
        for (g, (latents, gradient)) in grids.iter_mut().zip(of_cells).enumerate() {
            let len = gradient.shape().num_elements();
            latents.update(rates[g], gradient.reshape([len]) * units[g]);
            latents.values = shared.limited(g, latents.values.clone());
        }
    }
}

impl OnCrops {
    fn step(
        &mut self,
        shared: &mut Shared,
        ground: &Ground<'_>,
        crops: &Crops,
        drawn: Drawn<'_>,
        of_synthesizer: Descent,
        of_encoder: Rate,
    ) {
        let leaves: Vec<_> = self
            .encoder
            .places()
            .map(|(weights_at, sides, bias_at, outputs)| {
                let weights = self.parameters.leaf(weights_at, sides);
                (weights, self.parameters.leaf(bias_at, [outputs]))
            })
            .collect();
        let images = crops::images(ground, crops, &shared.texels);
        let outputs = self.encoder.run(&leaves, images);
        let shape = crops.shape();
        let windows = crops.windows(ground);
        let constructions = match self.constructions.take() {
            Some((of, constructions)) if of == shape => constructions,
            Some(_) | None => {
                let ways = crop::constructors(ground);
                [0, 1].map(|g| Construction::new(&ways[g], (g, shape), &windows, &shared.device))
            }
        };
        let bits = ground.embedding(Numbers::Real).bits;
        let reals = [0, 1].map(|g: usize| constructions[g].cells(outputs[g].clone().inner()));
        let seen = [0, 1].map(|g: usize| {
            let codes = (1_u32 << bits[g]) as f32;
            let values = shared.limited(g, reals[g].clone() * codes);
            shared.seen(g, values, drawn.roundings[g])
        });
        let way_back = shared.step(ground, &windows, drawn.texels, seen, of_synthesizer);
        let of_cells = way_back.gradients();
        let of_outputs = [0, 1].map(|g: usize| {
            // Beyond the range only a gradient that leads back counts.
            let (real, gradient) = (&reals[g], &of_cells[g]);
            let above = real.clone().greater_elem(0.5);
            let above = above.bool_and(gradient.clone().lower_elem(0.0));
            let below = real.clone().lower_elem(-0.5);
            let below = below.bool_and(gradient.clone().greater_elem(0.0));
            let gradient = gradient.clone().mask_fill(above.bool_or(below), 0.0);
            constructions[g].gradient(gradient, outputs[g].dims())
        });
        self.constructions = Some((shape, constructions));
        let mut gradients = backward_from(outputs, of_outputs);
        let parts = leaves.iter().flat_map(|(weights, bias)| {
            let weights = flat_gradient(weights, &mut gradients);
            [weights, flat_gradient(bias, &mut gradients)]
        });
        let gradient = Tensor::cat(parts.collect(), 0);
        self.parameters.update(of_encoder, gradient);
    }
}
