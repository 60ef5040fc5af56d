//! Memory: what a run will hold, before it starts.

use crate::config::{CHUNKS, TrainConfig};
use crate::error::TrainError;
use crate::export;
use crate::kernel::{COLUMNS, ROWS};
use crate::plan::Train;
use crate::sampler::Texel;
use crate::source::Source;
use crate::stage::Stage;
use crate::topology::Topology;
use serde::Serialize;

/// Bytes of a number.
const FLOAT: u64 = 4;

/// What a run will hold, in bytes. An estimate: small buffers are left out, and what an encoder
/// needs is counted layer by layer, not measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Memory {
    /// The set as it was given, and as steps read it.
    pub texels: u64,
    /// Parameters, their moments and gradients.
    pub model: u64,
    /// Buffers of the largest step, those of the encoder included.
    pub step: u64,
    /// The list of all texels when the set is evaluated.
    pub evaluation: u64,
    /// While latents settle: their values and gradients, codes before and after, errors before and
    /// after.
    pub settling: u64,
}

impl Memory {
    /// What is held at once at the most.
    #[must_use]
    pub fn peak(&self) -> u64 {
        self.texels + self.model + self.step.max(self.evaluation).max(self.settling)
    }

    /// The estimate for a run.
    ///
    /// # Errors
    /// When the configuration or the set is refused.
    pub fn of(source: &Source, config: &TrainConfig) -> Result<Memory, TrainError> {
        config.validate()?;
        let channels = source.outputs.len();
        let topology = Topology::new(config, channels);
        let shape = export::shape_of(config, source)?;
        let sizes = source.sizes().into_iter();
        let texels: u64 = sizes.map(|(w, h)| u64::from(w) * u64::from(h)).sum();
        // Values, two moments, what the synthesizer sees, the gradient.
        let latents: u64 = (0..2).map(|g| shape.grid_latents(g)).sum();
        // Values, two moments, and a gradient for each chunk and for all of them.
        let parameters = (3 + 1 + CHUNKS as u64) * topology.parameters as u64;
        let inputs = topology.layers.first().map_or(0, |l| l.rows()) as u64;
        let stages = config.stages(&source.sizes())?;
        let step = |stage: &Stage| {
            // A texel's own fields, four corners and their weights in two grids, its gradient.
            let texel = size_of::<Texel>() as u64 + FLOAT * (16 + inputs);
            let encoder = match stage.train {
                Train::Encoder => of_encoder(config, stage, channels as u64, source.sizes()[0]),
                Train::Latents | Train::Synthesizer => 0,
            };
            stage.batch as u64 * texel + encoder
        };
        let running = stages.iter().filter(|stage| stage.steps > 0);
        Ok(Memory {
            texels: 2 * FLOAT * texels * channels as u64,
            model: FLOAT * (5 * latents + parameters),
            step: running.map(step).max().unwrap_or(0),
            evaluation: texels * size_of::<Texel>() as u64,
            settling: latents * 2 * (FLOAT + 1) + texels * 2 * FLOAT,
        })
    }
}

/// What a step on crops holds: the images, every output that the way back needs, and the gradients
/// that are under way at the finest positions. Channels are padded as [`crate::convolution`] has them.
/// For four 512² crops of 8 channels at width 32, a whole run is estimated at 754 MB where one took 648.
fn of_encoder(config: &TrainConfig, stage: &Stage, channels: u64, (w, h): (u32, u32)) -> u64 {
    let side = |n: u32| u64::from(n.min(stage.crop).next_multiple_of(8));
    let texels = u64::from(stage.crops) * side(w) * side(h);
    let padded = |n: u64| n.next_multiple_of(COLUMNS as u64);
    let width = u64::from(config.encoder_width);
    let (wide, narrow) = (padded(width), padded(width / 2));
    // As they came, with the channels of a texel together, and by parity for the first halving.
    let images = texels * (channels + 2 * channels.next_multiple_of(ROWS as u64));
    // Three blocks, each with its input and the two convolutions inside it.
    let blocks = 3 * (wide + 2 * narrow);
    // A later halving has its input by parity.
    let outputs = texels / 4 * blocks + texels / 16 * (4 * wide + blocks) + texels / 64 * 4 * wide;
    let gradients = texels / 4 * (2 * wide + 2 * narrow);
    FLOAT * (images + outputs + gradients)
}
