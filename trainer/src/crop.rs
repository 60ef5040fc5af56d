//! The encoder stage: crops of the set through encoder, constructors and synthesizer.

use crate::adam::Rate;
use crate::encoder::{Encoder, RECEPTIVE, SCALE_LOG2, for_latents};
use crate::engine::{Engine, View};
use crate::error::TrainError;
use crate::model::{Ground, Model};
use crate::network::Network;
use crate::random::{Purpose, Stream, half_unit_noise};
use crate::sampler::{Numbers, Texel, Window};
use ntmu_isa::position::AddressMode;

/// Texels of an encoder position along an axis.
const POSITION: u32 = 1 << SCALE_LOG2;

/// Positions along an axis of one piece when the whole set is encoded.
const PIECE: u32 = 32;

/// log2 of the crop's side over that of the coarsest mip that is trained on it: a coarser one's
/// corners would all lie outside the crop.
const MIP_MARGIN: u32 = 3;

/// The crops of one step, in encoder positions.
#[derive(Clone, Debug)]
pub(crate) struct Crops {
    /// Positions of the whole set along x and y.
    all: [u32; 2],
    /// Positions of a crop along x and y.
    size: [u32; 2],
    /// The first position of each crop.
    origins: Vec<[u32; 2]>,
}

impl Crops {
    /// The crops of a step. A crop wraps around the set where its grids do.
    pub(crate) fn draw(ground: &Ground<'_>, step: u64) -> Crops {
        let config = ground.config;
        let (width, height) = ground.texels.sizes[0];
        let all = [width, height].map(|n| n.div_ceil(POSITION));
        let size = all.map(|n| n.min(config.crop / POSITION));
        let stream = Stream::new(config.seed, Purpose::Crop, step);
        let wraps = AddressMode::from(config.address) == AddressMode::Wrap;
        let origin = |index: u64, axis: usize| {
            let free = all[axis] - size[axis];
            let choices = if free > 0 && wraps {
                all[axis]
            } else {
                free + 1
            };
            stream.below(2 * index + axis as u64, choices)
        };
        // Crops that are the whole set would all be the same.
        let whole = all == size;
        let items = if whole { 1 } else { u64::from(config.crops) };
        let origins = (0..items).map(|i| [origin(i, 0), origin(i, 1)]).collect();
        Crops { all, size, origins }
    }

    /// Crops, and the rows and columns of encoder positions of each.
    pub(crate) fn shape(&self) -> (usize, usize, usize) {
        (
            self.origins.len(),
            self.size[1] as usize,
            self.size[0] as usize,
        )
    }

    /// The window that each crop is.
    pub(crate) fn windows(&self, ground: &Ground<'_>) -> Vec<Window> {
        let scale = |g: usize| SCALE_LOG2 - ground.config.grids[g].scale_log2;
        let cells = |of: [u32; 2]| [0, 1].map(|g: usize| of.map(|n| n << scale(g)));
        let size = cells(self.size);
        let windows = self
            .origins
            .iter()
            .enumerate()
            .map(|(item, &origin)| Window {
                origin: cells(origin),
                size,
                period: cells(self.all),
                base: size.map(|[w, h]| item * w as usize * h as usize),
            });
        windows.collect()
    }

    /// The columns and the rows of mip 0 that each crop shows; one that wraps leaves the set on one
    /// side and enters it on the other.
    pub(crate) fn lines(&self, ground: &Ground<'_>) -> Vec<[Vec<u32>; 2]> {
        let (width, height) = ground.texels.sizes[0];
        let mode = AddressMode::from(ground.config.address);
        let line = |first: u32, count: u32, texels: u32| {
            let first = (first * POSITION) as i32;
            let line = first..first + (count * POSITION) as i32;
            line.map(|at| mode.resolve(at, texels)).collect()
        };
        let of = |origin: &[u32; 2]| {
            [
                line(origin[0], self.size[0], width),
                line(origin[1], self.size[1], height),
            ]
        };
        self.origins.iter().map(of).collect()
    }

    /// Texel `index` of a batch of `len`: the crops share the batch in equal runs.
    pub(crate) fn texel(
        &self,
        ground: &Ground<'_>,
        stream: Stream,
        index: usize,
        len: usize,
    ) -> Texel {
        let window = index * self.origins.len() / len;
        let sizes = &ground.texels.sizes;
        let at = 4 * index as u64;
        let uniform = ground.config.uniform_mips;
        let side = self.size[0].max(self.size[1]) * POSITION;
        let deepest = if self.size == self.all {
            sizes.len() as u8
        } else {
            (side.ilog2().saturating_sub(MIP_MARGIN) as u8 + 1).min(sizes.len() as u8)
        };
        let mip = crate::batch::draw_mip(stream.unit(at), stream.unit(at + 1), deepest, uniform);
        let place = |axis: usize, texels: u32| {
            let inside = stream.below(
                at + 2 + axis as u64,
                ((self.size[axis] * POSITION) >> mip).max(1),
            );
            let place = ((self.origins[window][axis] * POSITION) >> mip) + inside;
            let around = ((self.all[axis] * POSITION) >> mip).max(1);
            (if place >= around {
                place - around
            } else {
                place
            })
            .min(texels - 1)
        };
        let (width, height) = sizes[usize::from(mip)];
        Texel {
            x: place(0, width),
            y: place(1, height),
            mip,
            window: window as u16,
        }
    }
}

/// Channels, rows and columns of mip 0 from a position on, `[channel][row][column]`; beyond the
/// set, what the address mode says.
fn image(ground: &Ground<'_>, first: [i32; 2], size: [usize; 2], out: &mut Vec<f32>) {
    let (width, height) = ground.texels.sizes[0];
    let mode = AddressMode::from(ground.config.address);
    let columns: Vec<u32> = (0..size[0] as i32)
        .map(|i| mode.resolve(first[0] + i, width))
        .collect();
    for channel in 0..ground.texels.channels {
        for row in 0..size[1] as i32 {
            let y = mode.resolve(first[1] + row, height);
            out.extend(
                columns
                    .iter()
                    .map(|&x| ground.texels.texel(x, y, 0)[channel]),
            );
        }
    }
}

impl Model {
    /// Makes room for the encoder and sets it to its start.
    pub(crate) fn start_encoder(&mut self, ground: &Ground<'_>) {
        let encoder = Encoder::new(ground.config, ground.texels.channels);
        self.encoder = encoder.start(Stream::new(ground.config.seed, Purpose::Encoder, 0));
        self.encoder_moments = crate::adam::Moments::zero(self.encoder.len());
    }

    /// One step on crops, with learning rates for the encoder and for the synthesizer.
    pub(crate) fn encoder_step(
        &mut self,
        ground: &Ground<'_>,
        engine: &mut Engine,
        step: u64,
        rates: [f64; 2],
    ) -> Result<f64, TrainError> {
        let config = ground.config;
        let encoder = Encoder::new(config, ground.texels.channels);
        let crops = Crops::draw(ground, step);
        let (items, rows, columns) = crops.shape();
        let size = crops.size.map(|n| (n * POSITION) as usize);
        let mut images = Vec::with_capacity(items * ground.texels.channels * size[0] * size[1]);
        for origin in &crops.origins {
            // A crop that wraps leaves the padded set on one side and enters it on the other.
            image(
                ground,
                origin.map(|n| (n * POSITION) as i32),
                size,
                &mut images,
            );
        }
        let shape = [items, ground.texels.channels, size[1], size[0]];
        let pass = encoder.forward(&self.encoder, images, shape, true);
        let grids = pass.grids()?;
        let noise = Stream::new(config.seed, Purpose::Noise, step).noise_key();
        let seen = [0, 1].map(|g: usize| {
            let format = self.latents[g].format;
            let codes = (1_u32 << format.bits()) as f32;
            let (low, high) = (format.min_value() as f32, format.max_value() as f32);
            let mut seen = vec![0.0; grids[g].len()];
            let channels = usize::from(config.grids[g].channels);
            for_latents(
                (items, rows, columns),
                channels,
                config.grids[g].scale_log2,
                |from, to| {
                    let noise = half_unit_noise(noise.wrapping_add(g as u32), to as u32);
                    seen[to] = (grids[g][from] * codes).clamp(low, high) + noise;
                },
            );
            seen
        });
        let stream = Stream::new(config.seed, Purpose::Batch, step);
        let len = engine.batch.texels.len();
        for index in 0..len {
            engine.batch.texels[index] = crops.texel(ground, stream, index, len);
        }
        let windows = crops.windows(ground);
        let network = Network::real(&ground.topology, &self.parameters, &ground.low);
        let embedding = ground.embedding(Numbers::Real);
        let loss = engine.step(View {
            network: &network,
            embedding,
            positions: &ground.positions,
            windows: &windows,
            seen: [&seen[0], &seen[1]],
            texels: &ground.texels,
        });
        let mut gradients = [0, 1].map(|g: usize| vec![0.0; seen[g].len()]);
        let [g0, g1] = &mut gradients;
        engine.scatter(embedding, [g0, g1]);
        let of_tensors = [0, 1].map(|g: usize| {
            let mut out = vec![0.0; gradients[g].len()];
            let channels = usize::from(config.grids[g].channels);
            for_latents(
                (items, rows, columns),
                channels,
                config.grids[g].scale_log2,
                |from, to| {
                    // Beyond the range only a gradient that leads back counts.
                    let (real, gradient) = (grids[g][from], gradients[g][to]);
                    let outward = (real > 0.5 && gradient < 0.0) || (real < -0.5 && gradient > 0.0);
                    out[from] = if outward { 0.0 } else { gradient };
                },
            );
            out
        });
        ground.hold_constants(&mut engine.parameters);
        let gradient = encoder.backward(pass, of_tensors)?;
        let [of_encoder, of_synthesizer] = rates.map(|rate| Rate::new(rate, step + 1));
        self.encoder_moments
            .update(of_encoder, &mut self.encoder, &gradient);
        self.moments
            .update(of_synthesizer, &mut self.parameters, &engine.parameters);
        Ok(loss)
    }

    /// The latents that the encoder gives the whole set, piece by piece; each piece is encoded
    /// with all the texels that its latents depend on.
    pub(crate) fn encode_whole(&mut self, ground: &Ground<'_>) -> Result<(), TrainError> {
        let config = ground.config;
        let encoder = Encoder::new(config, ground.texels.channels);
        let (width, height) = ground.texels.sizes[0];
        let all = [width, height].map(|n| n.div_ceil(POSITION));
        let margin = RECEPTIVE as u32 / POSITION;
        for top in (0..all[1]).step_by(PIECE as usize) {
            for left in (0..all[0]).step_by(PIECE as usize) {
                let size = [(all[0] - left).min(PIECE), (all[1] - top).min(PIECE)];
                let padded = size.map(|n| ((n + 2 * margin) * POSITION) as usize);
                let first = [left, top].map(|n| (n * POSITION) as i32 - RECEPTIVE as i32);
                let mut images = Vec::new();
                image(ground, first, padded, &mut images);
                let shape = [1, ground.texels.channels, padded[1], padded[0]];
                let grids = encoder
                    .forward(&self.encoder, images, shape, false)
                    .grids()?;
                for (g, grid) in grids.iter().enumerate() {
                    let scale_log2 = config.grids[g].scale_log2;
                    let side = 1_usize << (SCALE_LOG2 - scale_log2);
                    let channels = usize::from(config.grids[g].channels);
                    let (cells_x, cells_y) = ground.positions.grid_sizes[g];
                    let latents = &mut self.latents[g];
                    let codes = (1_u32 << latents.format.bits()) as f32;
                    let (low, high) = (
                        latents.format.min_value() as f32,
                        latents.format.max_value() as f32,
                    );
                    let around = [padded[1], padded[0]].map(|n| n / POSITION as usize);
                    let row_cells = around[1] * side;
                    for_latents(
                        (1, around[0], around[1]),
                        channels,
                        scale_log2,
                        |from, to| {
                            let (cell, channel) = (to / channels, to % channels);
                            let (y, x) = (cell / row_cells, cell % row_cells);
                            let skip = margin as usize * side;
                            let inside =
                                |at: usize, n: u32| at >= skip && at < skip + n as usize * side;
                            if !inside(x, size[0]) || !inside(y, size[1]) {
                                return;
                            }
                            let x = x - skip + left as usize * side;
                            let y = y - skip + top as usize * side;
                            if x < cells_x as usize && y < cells_y as usize {
                                let at = (y * cells_x as usize + x) * channels + channel;
                                latents.values[at] = (grid[from] * codes).clamp(low, high);
                            }
                        },
                    );
                }
            }
        }
        Ok(())
    }
}
