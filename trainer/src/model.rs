//! Model: everything that training changes.

use crate::adam::Moments;
use crate::config::TrainConfig;
use crate::error::TrainError;
use crate::export::shape_of;
use crate::integer::Range;
use crate::latents::Latents;
use crate::positions::Positions;
use crate::random::{Purpose, Stream};
use crate::sampler::{Embedding, Numbers};
use crate::source::{Source, Texels, real_range};
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
}

impl<'a> Ground<'a> {
    pub(crate) fn new(config: &'a TrainConfig, source: &'a Source) -> Result<Ground<'a>, TrainError> {
        Ok(Ground {
            config,
            source,
            texels: Texels::new(source),
            positions: Positions::new(&shape_of(config, source)?),
            topology: Topology::new(config, source.outputs.len()),
            low: source.outputs.iter().map(|&o| real_range(o).0).collect(),
        })
    }

    pub(crate) fn outputs(&self) -> &[OutputFormat] {
        &self.source.outputs
    }

    pub(crate) fn embedding(&self, numbers: Numbers) -> Embedding {
        let grids = &self.config.grids;
        Embedding {
            numbers,
            channels: [0, 1].map(|g: usize| usize::from(grids[g].channels)),
            bits: [0, 1].map(|g: usize| grids[g].bits),
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
    /// Ranges of the hidden layers; empty before the integer stage.
    pub(crate) ranges: Vec<Range>,
    /// Parameters of the encoder and its constructors; empty where no encoder runs.
    pub(crate) encoder: Vec<f32>,
    pub(crate) encoder_moments: Moments,
}

impl Model {
    pub(crate) fn new(ground: &Ground<'_>) -> Result<Model, TrainError> {
        let seed = ground.config.seed;
        let grid = |g: usize| -> Result<Latents, TrainError> {
            let (width, height) = ground.positions.grid_sizes[g];
            Ok(Latents::new(ground.config.grid_shape(g)?, width as usize * height as usize))
        };
        let mut latents = [grid(0)?, grid(1)?];
        let first = latents[0].values.len() as u64;
        let stream = Stream::new(seed, Purpose::Latents, 0);
        latents[0].scatter_start(stream, 0);
        latents[1].scatter_start(stream, first);
        let parameters = start(&ground.topology, &ground.texels, seed);
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
        for latents in &mut self.latents {
            latents.moments = Moments::zero(latents.values.len());
        }
    }
}

/// Initial parameters: uniform weights after He et al. 2015, the last layer of a residual block
/// at a tenth of that so that a block starts near the identity, and the output biases at the
/// channels' means so that the first steps need not find them.
fn start(topology: &Topology, texels: &Texels, seed: u64) -> Vec<f32> {
    let stream = Stream::new(seed, Purpose::Synthesizer, 0);
    let mut parameters = vec![0.0; topology.parameters];
    let last = topology.layers.len() - 1;
    for (index, layer) in topology.layers.iter().enumerate() {
        // Most inputs are latents with an eighth of the variance of a unit uniform.
        let gain = if index == 0 { 2.0 } else { 1.0 };
        let damp = if layer.skip.is_some() { 0.1 } else { 1.0 };
        let bound = gain * damp * (6.0 / layer.inputs as f32).sqrt();
        for k in 0..layer.inputs {
            for o in 0..layer.outputs {
                let at = layer.weights_at + k * layer.columns() + o;
                parameters[at] = bound * stream.signed(at as u64);
            }
        }
        if index == last {
            for channel in 0..layer.outputs {
                parameters[layer.bias_at + channel] = texels.mean(channel);
            }
        }
    }
    parameters
}
