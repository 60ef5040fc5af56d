//! The steps of a schedule's stages on a device: the same draws as on the processor.

use super::{Drawn, Graph, Subject};
use crate::adam::Rate;
use crate::batch::draw_texel;
use crate::crop::Crops;
use crate::latents::Rounding;
use crate::model::Ground;
use crate::random::{Purpose, Stream};
use crate::refine::{Rates, stream_step};
use crate::sampler::Texel;
use crate::schedule::Stage;

impl Subject {
    /// What a stage in reals trains.
    pub(crate) const fn of(stage: Stage) -> Subject {
        match stage {
            Stage::Encoder => Subject::Encoder,
            Stage::Refine | Stage::Integer => Subject::Latents,
        }
    }
}

impl Graph {
    /// The step `step` of `stage`, counted from 0, on `batch` texels, with learning rates for the
    /// encoder and for what the stages on the whole set train. Its loss waits in
    /// [`Graph::losses`].
    pub(crate) fn step(
        &mut self,
        ground: &Ground<'_>,
        (stage, step, batch): (Stage, u64, usize),
        (encoder, rates): (f64, Rates),
    ) {
        let config = ground.config;
        let at = match stage {
            Stage::Encoder => step,
            Stage::Refine | Stage::Integer => stream_step(stage, step),
        };
        let stream = Stream::new(config.seed, Purpose::Batch, at);
        let noise = Stream::new(config.seed, Purpose::Noise, at).noise_key();
        let roundings = [0, 1].map(|g| Rounding::Noise(noise.wrapping_add(g)));
        let of_synthesizer = Rate::new(rates.synthesizer, step + 1);
        match Subject::of(stage) {
            Subject::Encoder => {
                let crops = Crops::draw(ground, step);
                let texels: Vec<Texel> = (0..batch)
                    .map(|index| crops.texel(ground, stream, index, batch))
                    .collect();
                let drawn = Drawn {
                    texels: &texels,
                    roundings,
                };
                let rates = [Rate::new(encoder, step + 1), of_synthesizer];
                self.crops_step(ground, &crops, drawn, rates);
            }
            Subject::Latents => {
                let sizes = &ground.texels.sizes;
                let texels: Vec<Texel> = (0..batch as u64)
                    .map(|i| draw_texel(stream, i, sizes, config.uniform_mips))
                    .collect();
                let drawn = Drawn {
                    texels: &texels,
                    roundings,
                };
                // The configured rate counts reals; the values count codes.
                let of_grid = |g: usize| {
                    let codes = f64::from(1_u32 << config.grids[g].bits);
                    Rate::new(rates.latents * codes, step + 1)
                };
                let of_latents = config.refine_latents.then(|| [of_grid(0), of_grid(1)]);
                self.set_step(ground, drawn, of_synthesizer, of_latents);
            }
        }
    }
}
