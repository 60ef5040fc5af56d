//! The stages on the whole set: latents and synthesizer, in reals and then in the numbers of the
//! decode.

use crate::adam::Rate;
use crate::calibrate::{calibrate, extents};
use crate::descent::Descent;
use crate::engine::{Engine, View};
use crate::equalise::equalise;
use crate::evaluate::{Errors, evaluate};
use crate::latents::Rounding;
use crate::model::{Ground, Model};
use crate::network::Network;
use crate::plan::{Shown, Train};
use crate::quantise::{Quantised, quantise};
use crate::random::{Purpose, Stream};
use crate::sampler::{Numbers, Texel, Window};
use crate::schedule;
use crate::stage::{Rates, Stage};

/// Texels that calibrate the activations.
const CALIBRATION: usize = 4096;

impl Model {
    /// What the unit would show of the latents.
    fn show(&mut self, rounding: impl Fn(u32) -> Rounding) {
        for (g, latents) in self.latents.iter_mut().enumerate() {
            latents.show(rounding(g as u32));
        }
    }

    fn seen(&self) -> [&[f32]; 2] {
        [&self.latents[0].seen, &self.latents[1].seen]
    }

    /// The numbers that the present parameters become in the decode.
    pub(crate) fn quantised(&self, ground: &Ground<'_>) -> Quantised {
        quantise(
            &ground.topology,
            &self.parameters,
            &self.ranges,
            ground.config,
            ground.outputs(),
        )
    }

    fn real(&self, ground: &Ground<'_>) -> Network {
        Network::real(&ground.topology, &self.parameters, &ground.low)
    }

    /// Prepares the network in reals for the numbers of the decode: neurons come nearer one range,
    /// and the ranges of the hidden layers are fixed.
    pub(crate) fn deploy(&mut self, ground: &Ground<'_>) {
        self.equalise(ground);
        let bits = ground.config.activation_bits;
        self.ranges = self.on_sample(ground, |view, texels| {
            calibrate(&ground.topology, view, texels, bits)
        });
    }

    pub(crate) fn equalise(&mut self, ground: &Ground<'_>) {
        let extents = self.extents(ground);
        equalise(&ground.topology, &extents, &mut self.parameters);
    }

    /// How far each neuron of each hidden layer goes from zero.
    pub(crate) fn extents(&mut self, ground: &Ground<'_>) -> Vec<Vec<f32>> {
        self.on_sample(ground, |view, texels| {
            extents(&ground.topology, view, texels)
        })
    }

    /// What `look` sees of the present network in reals, with texels to try it on.
    fn on_sample<T>(
        &mut self,
        ground: &Ground<'_>,
        look: impl FnOnce(View<'_>, &[Texel]) -> T,
    ) -> T {
        self.show(|_| Rounding::Nearest);
        let stream = Stream::new(ground.config.seed, Purpose::Calibration, 0);
        let texels: Vec<_> = (0..CALIBRATION as u64)
            .map(|i| {
                let uniform = ground.config.uniform_mips;
                crate::batch::draw_texel(stream, i, &ground.texels, uniform)
            })
            .collect();
        let network = self.real(ground);
        let windows = Window::whole(&ground.positions);
        let view = self.view(ground, &network, Numbers::Real, &windows);
        look(view, &texels)
    }

    fn view<'v>(
        &'v self,
        ground: &'v Ground<'_>,
        network: &'v Network,
        numbers: Numbers,
        windows: &'v [Window],
    ) -> View<'v> {
        View {
            network,
            embedding: ground.embedding(numbers),
            positions: &ground.positions,
            windows,
            seen: self.seen(),
            texels: &ground.texels,
        }
    }

    /// One step of a stage on the whole set; the mean squared error of its batch.
    pub(crate) fn step(
        &mut self,
        ground: &Ground<'_>,
        engine: &mut Engine,
        stage: &Stage,
        step: u64,
        rates: Rates,
    ) -> f64 {
        let at = stage.stream(step);
        let config = ground.config;
        let quantised = stage.is_deployed().then(|| self.quantised(ground));
        let numbers = if quantised.is_some() {
            Numbers::Integer
        } else {
            Numbers::Real
        };
        let noise = Stream::new(config.seed, Purpose::Noise, at).noise_key();
        self.show(|grid| match stage.latents {
            Shown::Noise => Rounding::Noise(noise.wrapping_add(grid)),
            Shown::Rounded => Rounding::Nearest,
        });
        let stream = Stream::new(config.seed, Purpose::Batch, at);
        engine
            .batch
            .draw(stream, &ground.texels, stage.uniform_mips);
        let windows = Window::whole(&ground.positions);
        let loss = match &quantised {
            Some(q) => engine.step(self.view(ground, &q.network, numbers, &windows)),
            None => {
                let network = self.real(ground);
                engine.step(self.view(ground, &network, numbers, &windows))
            }
        };
        let gradient = &mut engine.parameters;
        self.follow(ground, stage, step, rates, quantised.as_ref(), gradient);
        if stage.train == Train::Latents {
            let embedding = ground.embedding(numbers);
            let [g0, g1] = &mut self.latents;
            engine.scatter(embedding, [&mut g0.gradient, &mut g1.gradient]);
            for (latents, unit) in self.latents.iter_mut().zip(embedding.latent_unit()) {
                // The configured rate counts reals; the values count codes.
                let codes = f64::from(1_u32 << latents.format.bits());
                latents.update(Rate::new(rates.latents * codes, step + 1), unit);
            }
        }
        loss
    }

    /// Moves the synthesizer's parameters along their gradient at a step. It is that of the real
    /// parameters, or of what they were quantised to.
    pub(crate) fn follow(
        &mut self,
        ground: &Ground<'_>,
        stage: &Stage,
        step: u64,
        rates: Rates,
        quantised: Option<&Quantised>,
        gradient: &mut [f32],
    ) {
        let topology = &ground.topology;
        if let Some(quantised) = quantised {
            quantised.to_real_gradient(topology, gradient);
        }
        ground.hold_constants(gradient);
        let descent = Descent::new(stage.optimiser, rates.synthesizer, step + 1);
        let (moments, parameters) = (&mut self.moments, &mut self.parameters);
        descent.update(topology, moments, parameters, gradient);
        if let Some(quantised) = quantised {
            let share = schedule::draw(step, stage.steps) as f32;
            quantised.draw(ground.config, topology, parameters, share);
        }
    }

    /// The error over every texel, in reals or in the asset's numbers.
    pub(crate) fn evaluate(&mut self, ground: &Ground<'_>, numbers: Numbers) -> Errors {
        self.show(|_| Rounding::Nearest);
        let network = match numbers {
            Numbers::Real => self.real(ground),
            Numbers::Integer => self.quantised(ground).network,
        };
        let windows = Window::whole(&ground.positions);
        evaluate(
            &ground.topology,
            Some(ground.outputs()),
            self.view(ground, &network, numbers, &windows),
        )
    }
}
