//! Model: everything that training changes.

use crate::adam::Moments;
use crate::config::TrainConfig;
use crate::error::TrainError;
use crate::export::shape_of;
use crate::latents::Latents;
use crate::positions::Positions;
use crate::quantise::Range;
use crate::random::{Purpose, Stream};
use crate::sampler::{Embedding, Numbers};
use crate::source::{Source, real_range};
use crate::texels::Texels;
use crate::topology::Topology;
use ntmu_isa::shape::OutputFormat;

/// What a run reads and never changes.
pub(crate) struct Ground<'a> {
    pub(crate) config: &'a TrainConfig,
    pub(crate) source: &'a Source,
    pub(crate) texels: Texels,
    pub(crate) positions: Positions,
    pub(crate) topology: Topology,
    /// The smallest real of each channel.
    pub(crate) low: Vec<f32>,
    /// The value of each channel that has only one.
    pub(crate) constants: Vec<Option<f32>>,
}

impl<'a> Ground<'a> {
    pub(crate) fn new(
        config: &'a TrainConfig,
        source: &'a Source,
    ) -> Result<Ground<'a>, TrainError> {
        let texels = Texels::new(source, &config.weights)?;
        Ok(Ground {
            config,
            source,
            constants: texels.constants(),
            texels,
            positions: Positions::new(&shape_of(config, source)?),
            topology: Topology::new(config, source.outputs.len()),
            low: source.outputs.iter().map(|&o| real_range(o).0).collect(),
        })
    }

    pub(crate) fn outputs(&self) -> &[OutputFormat] {
        &self.source.outputs
    }

    /// Takes the rows of constant channels out of a gradient. Such a row has no weights and its
    /// value as its bias from the start, which is exact; training could only disturb it.
    pub(crate) fn hold_constants(&self, gradient: &mut [f32]) {
        let Some(last) = self.topology.layers.last() else {
            return;
        };
        for (channel, _) in self
            .constants
            .iter()
            .enumerate()
            .filter(|(_, c)| c.is_some())
        {
            for k in 0..last.inputs {
                gradient[last.weights_at + k * last.columns() + channel] = 0.0;
            }
            gradient[last.bias_at + channel] = 0.0;
        }
    }

    pub(crate) fn embedding(&self, numbers: Numbers) -> Embedding {
        let grids = &self.config.grids;
        Embedding {
            numbers,
            channels: [0, 1].map(|g: usize| usize::from(grids[g].channels)),
            sampling: self.config.sampling,
            bits: [0, 1].map(|g: usize| grids[g].bits),
            input_bits: self.config.input_bits,
            inputs: self.config.input_count(),
        }
    }
}

/// Everything that training changes.
#[derive(Clone, Debug)]
pub(crate) struct Model {
    /// The synthesizer's real parameters; see [`Topology`] for their places.
    pub(crate) parameters: Vec<f32>,
    pub(crate) moments: Moments,
    pub(crate) latents: [Latents; 2],
    /// Ranges of the hidden layers' registers; empty before the integer stage.
    pub(crate) ranges: Vec<Range>,
    /// Parameters of the encoder and its constructors; empty where no encoder runs.
    pub(crate) encoder: Vec<f32>,
    pub(crate) encoder_moments: Moments,
}

impl Model {
    pub(crate) fn new(ground: &Ground<'_>) -> Result<Model, TrainError> {
        let seed = ground.config.seed;
        let grid = |g: usize| -> Result<Latents, TrainError> {
            Ok(Latents::new(
                ground.config.grid_shape(g)?,
                ground.positions.cells(g),
            ))
        };
        let mut latents = [grid(0)?, grid(1)?];
        let first = latents[0].values.len() as u64;
        let stream = Stream::new(seed, Purpose::Latents, 0);
        latents[0].scatter_start(stream, 0);
        latents[1].scatter_start(stream, first);
        let parameters = start(ground, seed);
        Ok(Model {
            moments: Moments::zero(parameters.len()),
            parameters,
            latents,
            ranges: Vec::new(),
            encoder: Vec::new(),
            encoder_moments: Moments::zero(0),
        })
    }

    /// Forgets every moment: a stage starts afresh.
    pub(crate) fn forget_moments(&mut self) {
        self.moments = Moments::zero(self.parameters.len());
        self.encoder_moments = Moments::zero(self.encoder.len());
        for latents in &mut self.latents {
            latents.moments = Moments::zero(latents.values.len());
        }
    }
}

/// Initial parameters: uniform weights after He et al. 2015, the last layer of a residual block
/// at a tenth of that so that a block starts near the identity, and the output biases at the
/// channels' means so that the first steps need not find them.
fn start(ground: &Ground<'_>, seed: u64) -> Vec<f32> {
    let topology = &ground.topology;
    let stream = Stream::new(seed, Purpose::Synthesizer, 0);
    let mut parameters = vec![0.0; topology.parameters];
    let last = topology.layers.len() - 1;
    for (index, layer) in topology.layers.iter().enumerate() {
        // Most inputs are latents with an eighth of the variance of a unit uniform. Those that are
        // always zero get no weights: nothing would ever move them.
        let (gain, live) = if index == 0 {
            let padding = usize::from(ground.config.padding);
            (2.0, layer.inputs - padding)
        } else {
            (1.0, layer.inputs)
        };
        let damp = if layer.skip.is_some() { 0.1 } else { 1.0 };
        let bound = gain * damp * (6.0 / live as f32).sqrt();
        for k in 0..live {
            for o in 0..layer.outputs {
                let at = layer.weights_at + k * layer.columns() + o;
                parameters[at] = bound * stream.signed(at as u64);
            }
        }
        if index == last {
            for channel in 0..layer.outputs {
                let mean = ground.texels.mean(channel);
                if let Some(value) = ground.constants[channel] {
                    for k in 0..layer.inputs {
                        parameters[layer.weights_at + k * layer.columns() + channel] = 0.0;
                    }
                    parameters[layer.bias_at + channel] = value;
                } else {
                    parameters[layer.bias_at + channel] = mean;
                }
            }
        }
    }
    parameters
}
