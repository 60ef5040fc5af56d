//! The steps of a stage on a device: the same draws as on the processor.

use super::{Drawn, Graph, Subject};
use crate::adam::Rate;
use crate::batch::draw_texel;
use crate::crop::Crops;
use crate::descent::Descent;
use crate::latents::Rounding;
use crate::model::Ground;
use crate::plan::{Shown, Train};
use crate::random::{Purpose, Stream};
use crate::sampler::Texel;
use crate::stage::{Rates, Stage};

impl Subject {
    /// What a stage in reals trains.
    pub(crate) const fn of(train: Train) -> Subject {
        match train {
            Train::Encoder => Subject::Encoder,
            Train::Latents | Train::Synthesizer => Subject::Latents,
        }
    }
}

impl Graph {
    /// The step `step` of `stage`, counted from 0. Its loss waits in [`Graph::losses`].
    pub(crate) fn step(&mut self, ground: &Ground<'_>, stage: &Stage, step: u64, rates: Rates) {
        let config = ground.config;
        let at = stage.stream(step);
        let stream = Stream::new(config.seed, Purpose::Batch, at);
        let noise = Stream::new(config.seed, Purpose::Noise, at).noise_key();
        let roundings = [0, 1].map(|g| match stage.latents {
            Shown::Noise => Rounding::Noise(noise.wrapping_add(g)),
            Shown::Rounded => Rounding::Nearest,
        });
        let of_synthesizer = Descent::new(stage.optimiser, rates.synthesizer, step + 1);
        match Subject::of(stage.train) {
            Subject::Encoder => {
                let crops = Crops::draw(ground, stage, step);
                let texels: Vec<Texel> = (0..stage.batch)
                    .map(|index| crops.texel(ground, stream, index, stage.batch))
                    .collect();
                let drawn = Drawn {
                    texels: &texels,
                    roundings,
                };
                let of_encoder = Rate::new(rates.encoder, step + 1);
                self.crops_step(ground, &crops, drawn, of_encoder, of_synthesizer);
            }
            Subject::Latents => {
                let texels: Vec<Texel> = (0..stage.batch as u64)
                    .map(|i| draw_texel(stream, i, &ground.texels, stage.uniform_mips))
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
                let moves = stage.train == Train::Latents;
                let of_latents = moves.then(|| [of_grid(0), of_grid(1)]);
                self.set_step(ground, drawn, of_synthesizer, of_latents);
            }
        }
    }
}
