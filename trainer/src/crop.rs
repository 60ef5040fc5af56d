//! The encoder stage: crops of the set through encoder, constructors and synthesizer.

use crate::adam::Rate;
use crate::constructor::{Constructors, Piece};
use crate::encoder::{Encoder, RECEPTIVE, SCALE_LOG2};
use crate::engine::{Engine, View};
use crate::error::TrainError;
use crate::model::{Ground, Model};
use crate::network::Network;
use crate::plan::{Mips, Shown};
use crate::random::{Purpose, Stream, half_unit_noise};
use crate::sampler::{Numbers, Texel, Window};
use crate::stage::{Rates, Stage};
use ntmu_isa::position::AddressMode;

/// Texels of an encoder position along an axis.
const POSITION: u32 = 1 << SCALE_LOG2;

/// Positions along an axis of one piece when the whole set is encoded.
const PIECE: u32 = 32;

/// log2 of the texels, along a crop's longer side, of the coarsest mip of [`Mips::Corners`]: all
/// corners of a coarser one would lie outside the crop.
const MIP_MARGIN: u32 = 3;

/// How often a texel of a crop that is masked out is drawn anew. One that stays masked out counts
/// nothing.
const DRAWS: u64 = 8;

/// The crops of one step, in encoder positions.
#[derive(Clone, Debug)]
pub(crate) struct Crops {
    /// Positions of the whole set along x and y.
    all: [u32; 2],
    /// Positions of a crop along x and y.
    size: [u32; 2],
    /// The first position of each crop.
    origins: Vec<[u32; 2]>,
    /// Mips that texels are drawn from.
    mips: u8,
    /// The share of texels whose mip is drawn uniformly.
    uniform: f64,
}

/// The constructors of both grids.
pub(crate) fn constructors(ground: &Ground<'_>) -> [Constructors; 2] {
    let levels = ground.positions.level_count();
    [0, 1].map(|g| Constructors::new(ground.config, g, levels))
}

/// The encoder before these constructors.
pub(crate) fn encoder(ground: &Ground<'_>, constructors: &[Constructors; 2]) -> Encoder {
    let planes = [constructors[0].planes, constructors[1].planes];
    Encoder::new(ground.config, ground.texels.channels, planes)
}

impl Crops {
    /// The crops of a step. A crop wraps around the set where its grids do.
    pub(crate) fn draw(ground: &Ground<'_>, stage: &Stage, step: u64) -> Crops {
        let config = ground.config;
        let (width, height) = ground.texels.sizes[0];
        let all = [width, height].map(|n| n.div_ceil(POSITION));
        let size = all.map(|n| n.min(stage.crop / POSITION));
        let stream = Stream::new(config.seed, Purpose::Crop, stage.stream(step));
        let wraps = AddressMode::from(config.address) == AddressMode::Wrap;
        // Crops that are the whole set would all be the same.
        let whole = all == size;
        let (mips, grain) = if whole {
            (ground.texels.sizes.len() as u8, 1)
        } else {
            mips_of_crop(ground, all, size, stage.mips)
        };
        let origin = |index: u64, axis: usize| {
            let free = all[axis] - size[axis];
            let choices = if free > 0 && wraps && all[axis].is_multiple_of(grain) {
                all[axis] / grain
            } else {
                free / grain + 1
            };
            grain * stream.below(2 * index + axis as u64, choices)
        };
        let items = if whole { 1 } else { u64::from(stage.crops) };
        let origins = (0..items).map(|i| [origin(i, 0), origin(i, 1)]).collect();
        Crops {
            all,
            size,
            origins,
            mips,
            uniform: stage.uniform_mips,
        }
    }

    /// Crops, and the rows and columns of encoder positions of each.
    pub(crate) fn shape(&self) -> (usize, usize, usize) {
        (
            self.origins.len(),
            self.size[1] as usize,
            self.size[0] as usize,
        )
    }

    /// Where the latents of each level of each crop lie, crop after crop.
    pub(crate) fn windows(&self, ground: &Ground<'_>) -> Vec<Window> {
        let constructors = constructors(ground);
        let levels = ground.positions.level_count();
        let mut base = [0; 2];
        let mut windows = Vec::with_capacity(self.origins.len() * levels);
        for &origin in &self.origins {
            for level in 0..levels {
                let cells = |of: [u32; 2]| {
                    [0, 1].map(|g: usize| of.map(|n| constructors[g].cells(level, n)))
                };
                let window = Window {
                    origin: cells(origin),
                    size: cells(self.size),
                    period: cells(self.all),
                    base,
                };
                base = [0, 1].map(|g: usize| base[g] + window.cells(g));
                windows.push(window);
            }
        }
        windows
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
        let drawn = |draw: u64| {
            let at = 4 * (index as u64 + draw * len as u64);
            self.place(
                &ground.texels.sizes,
                stream,
                at,
                index * self.origins.len() / len,
            )
        };
        let covered = |texel: &Texel| ground.texels.is_covered(texel.x, texel.y, texel.mip);
        let first = drawn(0);
        if covered(&first) {
            return first;
        }
        (1..DRAWS).map(drawn).find(covered).unwrap_or(first)
    }

    /// The texel of crop `window` that the numbers of `stream` from `at` on say.
    fn place(&self, sizes: &[(u32, u32)], stream: Stream, at: u64, window: usize) -> Texel {
        let (choice, unit) = (stream.unit(at), stream.unit(at + 1));
        let mip = crate::batch::draw_mip(choice, unit, self.mips, self.uniform);
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

/// How many mips are trained on a crop that is not the whole set, and the positions of which its
/// origin is a multiple: a crop begins and ends with a cell of every level that it trains.
fn mips_of_crop(ground: &Ground<'_>, all: [u32; 2], size: [u32; 2], mips: Mips) -> (u8, u32) {
    let side = size[0].max(size[1]) * POSITION;
    let deepest = match mips {
        Mips::Inside => side.ilog2(),
        Mips::Corners => side.ilog2().saturating_sub(MIP_MARGIN),
    };
    let mips = (deepest as u8 + 1).min(ground.texels.sizes.len() as u8);
    let constructors = constructors(ground);
    let grain = |mip: u8| {
        let level = ground.positions.level_of(mip);
        let pools = constructors.each_ref().map(|c| c.pool_log2(level));
        1_u32 << pools[0].max(pools[1])
    };
    let fits = |mip: &u8| {
        (0..2).all(|axis| size[axis] == all[axis] || size[axis].is_multiple_of(grain(*mip)))
    };
    // Mip 0 is served by level 0, which pools nothing.
    let mips = (1..mips).take_while(fits).last().map_or(1, |mip| mip + 1);
    (mips, grain(mips - 1))
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
        let encoder = encoder(ground, &constructors(ground));
        self.encoder = encoder.start(Stream::new(ground.config.seed, Purpose::Encoder, 0));
        self.encoder_moments = crate::adam::Moments::zero(self.encoder.len());
    }

    /// One step of a stage on crops; the mean squared error of its batch.
    pub(crate) fn encoder_step(
        &mut self,
        ground: &Ground<'_>,
        engine: &mut Engine,
        stage: &Stage,
        step: u64,
        rates: Rates,
    ) -> Result<f64, TrainError> {
        let config = ground.config;
        let at = stage.stream(step);
        let constructors = constructors(ground);
        let encoder = encoder(ground, &constructors);
        let crops = Crops::draw(ground, stage, step);
        let windows = crops.windows(ground);
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
        let noise = Stream::new(config.seed, Purpose::Noise, at).noise_key();
        let piece = Piece {
            tensor: (items, rows, columns),
            margin: 0,
            origin: [0; 2],
            extent: [columns, rows],
        };
        let reals = [0, 1].map(|g: usize| {
            let cells: usize = windows.iter().map(|w| w.cells(g)).sum();
            let mut reals = vec![0.0; cells * usize::from(config.grids[g].channels)];
            let tensor = &grids[g];
            constructors[g].for_latents(piece, g, &windows, |from, to, share| {
                reals[to] += share * tensor[from];
            });
            reals
        });
        let seen = [0, 1].map(|g: usize| -> Vec<f32> {
            let format = self.latents[g].format;
            let codes = (1_u32 << format.bits()) as f32;
            let (low, high) = (format.min_value() as f32, format.max_value() as f32);
            let key = noise.wrapping_add(g as u32);
            let latents = reals[g].iter().enumerate();
            latents
                .map(|(at, real)| {
                    let value = (real * codes).clamp(low, high);
                    match stage.latents {
                        Shown::Noise => value + half_unit_noise(key, at as u32),
                        Shown::Rounded => (value + 0.5).floor().clamp(low, high),
                    }
                })
                .collect()
        });
        let stream = Stream::new(config.seed, Purpose::Batch, at);
        let len = engine.batch.texels.len();
        for index in 0..len {
            engine.batch.texels[index] = crops.texel(ground, stream, index, len);
        }
        let quantised = stage.is_deployed().then(|| self.quantised(ground));
        let real;
        let (network, embedding) = match &quantised {
            Some(quantised) => (&quantised.network, ground.embedding(Numbers::Integer)),
            None => {
                real = Network::real(&ground.topology, &self.parameters, &ground.low);
                (&real, ground.embedding(Numbers::Real))
            }
        };
        let loss = engine.step(View {
            network,
            embedding,
            positions: &ground.positions,
            windows: &windows,
            seen: [&seen[0], &seen[1]],
            texels: &ground.texels,
        });
        let mut gradients = [0, 1].map(|g: usize| vec![0.0; seen[g].len()]);
        let [g0, g1] = &mut gradients;
        engine.scatter(embedding, [g0, g1]);
        let units = embedding.latent_unit();
        let of_tensors = [0, 1].map(|g: usize| {
            // A real latent in units of an input: 1 where inputs are reals.
            let unit = units[g] * (1_u32 << self.latents[g].format.bits()) as f32;
            // Beyond the range only a gradient that leads back counts.
            for (gradient, &real) in gradients[g].iter_mut().zip(&reals[g]) {
                let outward = (real > 0.5 && *gradient < 0.0) || (real < -0.5 && *gradient > 0.0);
                *gradient = if outward { 0.0 } else { unit * *gradient };
            }
            let mut out = vec![0.0; grids[g].len()];
            let gradients = &gradients[g];
            constructors[g].for_latents(piece, g, &windows, |from, to, share| {
                out[from] = share * gradients[to];
            });
            out
        });
        let gradient = encoder.backward(pass, of_tensors)?;
        let of_encoder = Rate::new(rates.encoder, step + 1);
        self.encoder_moments
            .update(of_encoder, &mut self.encoder, &gradient);
        let gradient = &mut engine.parameters;
        self.follow(ground, stage, step, rates, quantised.as_ref(), gradient);
        Ok(loss)
    }

    /// The latents that the encoder gives the whole set, piece by piece; each piece is encoded
    /// with all the texels that its latents depend on.
    pub(crate) fn encode_whole(&mut self, ground: &Ground<'_>) -> Result<(), TrainError> {
        let constructors = constructors(ground);
        let encoder = encoder(ground, &constructors);
        let windows = Window::whole(&ground.positions);
        let (width, height) = ground.texels.sizes[0];
        let all = [width, height].map(|n| n.div_ceil(POSITION));
        let margin = RECEPTIVE as u32 / POSITION;
        for latents in &mut self.latents {
            latents.values.fill(0.0);
        }
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
                let [columns, rows] = padded.map(|n| n / POSITION as usize);
                let piece = Piece {
                    tensor: (1, rows, columns),
                    margin: margin as usize,
                    origin: [left, top].map(|n| n as usize),
                    extent: all.map(|n| n as usize),
                };
                for (g, tensor) in grids.iter().enumerate() {
                    let values = &mut self.latents[g].values;
                    constructors[g].for_latents(piece, g, &windows, |from, to, share| {
                        values[to] += share * tensor[from];
                    });
                }
            }
        }
        for latents in &mut self.latents {
            let codes = (1_u32 << latents.format.bits()) as f32;
            let (low, high) = latents.limits();
            for value in &mut latents.values {
                *value = (*value * codes).clamp(low, high);
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
