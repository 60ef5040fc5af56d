//! Settle: latents go one code up or down where the asset then decodes to something nearer its source.
//!
//! In training, a latent between two codes is pushed across their middle and back until the rates are
//! too small for it: which code it ends with is partly chance. Here the synthesizer stays as it is, and
//! the asset's own decode decides. A round:
//!
//! 1. the gradient of the error by every latent, over all texels, straight through the roundings;
//! 2. four times for each level of each grid, in every second cell of every second row: the latent of
//!    the cell with the largest gradient goes one code down it;
//! 3. the asset is decoded, and a cell keeps its move where the texels that read it lose error.
//!
//! While corners are one cell apart, no texel reads two cells that move together, so that its error
//! belongs to one of them. Where a texel reads more than one, they share what it changes, and it is
//! decoded again if some of them keep their moves and others do not. Moves that made the set worse all
//! together are taken back, so that no round does.

use crate::batch::all_texels;
use crate::config::{CHUNKS, TILE};
use crate::engine::{Engine, View};
use crate::error::TrainError;
use crate::evaluate::decibels;
use crate::import;
use crate::network::Network;
use crate::positions::Positions;
use crate::sampler::{Embedding, Window};
use crate::source::Source;
use crate::texels::Texels;
use crate::topology::Topology;
use ntmu_isa::Asset;
use ntmu_model::engine::Engine as Decode;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};

/// What a round did.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Round {
    /// Latents that moved.
    pub moved: u64,
    /// Decibels of the asset afterwards, over every texel that counts, each channel's error times its
    /// weight.
    pub psnr: f64,
}

/// Settles the latents of an asset on the set that it was made from, in `rounds` rounds or fewer: one
/// in which nothing moves is the last. Maps count as in [`crate::TrainConfig::weights`]. Nothing but
/// codes of the grids changes, and no random number is drawn.
///
/// `observe` hears of every round. The result is the same on any number of threads.
///
/// # Errors
/// When the set has other sizes or formats than the asset, the asset's synthesizer has activations
/// that no trained one has, or `stop` became true.
pub fn settle(
    asset: &Asset,
    source: &Source,
    weights: &BTreeMap<String, f64>,
    rounds: u32,
    stop: &AtomicBool,
    observe: &mut dyn FnMut(&Round),
) -> Result<(Asset, Vec<Round>), TrainError> {
    source.validate()?;
    let shape = &asset.shape;
    let sizes: Vec<_> = (0..shape.mip_count).map(|m| shape.mip_size(m)).collect();
    let differs = |field: &str, found: String, allowed: String| {
        Err(TrainError::Source {
            field: field.to_owned(),
            found,
            allowed: format!("{allowed}, as in the asset"),
        })
    };
    if source.sizes() != sizes {
        return differs(
            "mips",
            format!("{:?}", source.sizes()),
            format!("{sizes:?}"),
        );
    }
    if source.outputs != shape.outputs {
        let [found, allowed] = [&source.outputs, &shape.outputs].map(|o| format!("{o:?}"));
        return differs("outputs", found, allowed);
    }
    let texels = Texels::new(source, weights)?;
    let positions = Positions::new(shape);
    let mut settling = Settling::new(asset.clone(), &texels, &positions)?;
    let done = settling.rounds(rounds, 0.0, stop, observe)?;
    Ok((settling.asset, done))
}

/// Texels whose gradients are made together.
const BATCH: usize = 16 * CHUNKS * TILE;

/// A latent that goes one code up or down.
#[derive(Clone, Copy, Debug)]
struct Move {
    /// Its place among the codes of its grid.
    at: usize,
    up: bool,
}

/// The cells of one level of one grid that may move together: every second one along both axes,
/// from one of four on.
#[derive(Clone, Copy, Debug)]
struct Group {
    grid: usize,
    level: usize,
    /// The first cell along x and y.
    first: [u32; 2],
}

/// An asset whose latents settle.
pub(crate) struct Settling<'a> {
    pub(crate) asset: Asset,
    texels: &'a Texels,
    positions: &'a Positions,
    topology: Topology,
    network: Network,
    embedding: Embedding,
    /// The weighted squared error of every texel, mip by mip; 0 where it is masked out.
    errors: Vec<Vec<f32>>,
    /// The same after moves that may be taken back.
    trial: Vec<Vec<f32>>,
}

impl<'a> Settling<'a> {
    /// Decodes the asset once.
    pub(crate) fn new(
        asset: Asset,
        texels: &'a Texels,
        positions: &'a Positions,
    ) -> Result<Settling<'a>, TrainError> {
        let (topology, network) = import::network(&asset)?;
        let empty = || -> Vec<Vec<f32>> {
            let sizes = texels.sizes.iter();
            sizes
                .map(|&(w, h)| vec![0.0; w as usize * h as usize])
                .collect()
        };
        let mut settling = Settling {
            embedding: import::embedding(&asset),
            topology,
            network,
            asset,
            texels,
            positions,
            errors: empty(),
            trial: empty(),
        };
        for (mip, errors) in (0..).zip(&mut settling.errors) {
            decode(&settling.asset, texels, mip, errors);
        }
        Ok(settling)
    }

    /// Rounds until one moves nothing or brings less than `least` decibels, `most` at the most.
    pub(crate) fn rounds(
        &mut self,
        most: u32,
        least: f64,
        stop: &AtomicBool,
        observe: &mut dyn FnMut(&Round),
    ) -> Result<Vec<Round>, TrainError> {
        let mut rounds = Vec::new();
        let mut before = self.psnr();
        for number in 0..most {
            let gradient = self.gradient();
            let mut moved = 0;
            for group in self.groups() {
                if stop.load(Ordering::Relaxed) {
                    return Err(TrainError::Stopped {
                        stage: STAGE,
                        step: u64::from(number),
                        checkpoint: None,
                    });
                }
                moved += self.settle_group(group, &gradient[group.grid])?;
            }
            let round = Round {
                moved,
                psnr: self.psnr(),
            };
            observe(&round);
            rounds.push(round);
            if moved == 0 || round.psnr < before + least {
                break;
            }
            before = round.psnr;
        }
        Ok(rounds)
    }

    fn groups(&self) -> Vec<Group> {
        let mut groups = Vec::new();
        for grid in 0..2 {
            for level in 0..self.positions.level_count() {
                for first in [[0, 0], [1, 0], [0, 1], [1, 1]] {
                    groups.push(Group { grid, level, first });
                }
            }
        }
        groups
    }

    fn psnr(&self) -> f64 {
        let mips = 0..self.texels.sizes.len() as u8;
        let counted: u64 = mips.map(|mip| self.texels.counted(mip)).sum();
        let sum: f64 = self.errors.iter().map(|errors| total(errors)).sum();
        decibels(sum / (counted * self.texels.channels as u64) as f64)
    }

    /// The derivative of the squared error by every latent of both grids, up to one positive factor
    /// for each grid.
    pub(crate) fn gradient(&self) -> [Vec<f32>; 2] {
        let seen = [0, 1].map(|g: usize| -> Vec<f32> {
            let format = self.asset.shape.grids[g].format;
            let codes = self.asset.grids[g].iter();
            codes.map(|&code| format.value(code) as f32).collect()
        });
        let windows = Window::whole(self.positions);
        let view = View {
            network: &self.network,
            embedding: self.embedding,
            positions: self.positions,
            windows: &windows,
            seen: [&seen[0], &seen[1]],
            texels: self.texels,
        };
        let mut engine = Engine::new(&self.topology, BATCH, self.texels.channels);
        let inputs = engine.batch.gradient.len() / BATCH;
        let mut gradient = [0, 1].map(|g: usize| vec![0.0; seen[g].len()]);
        let mut texels = all_texels(&self.texels.sizes).peekable();
        while let Some(&next) = texels.peek() {
            // What is left of a batch behind the last texel repeats one and counts nothing.
            engine.batch.texels.fill(next);
            let mut count = 0;
            for (slot, texel) in engine
                .batch
                .texels
                .iter_mut()
                .zip(texels.by_ref().take(BATCH))
            {
                *slot = texel;
                count += 1;
            }
            engine.step(view);
            engine.batch.gradient[count * inputs..].fill(0.0);
            let [g0, g1] = &mut gradient;
            engine.scatter(self.embedding, [g0, g1]);
        }
        gradient
    }

    /// Moves what a group gains from; how many latents that is.
    fn settle_group(&mut self, group: Group, gradient: &[f32]) -> Result<u64, TrainError> {
        let mut moves = self.proposed(group, gradient);
        let asset = self.moved(group, &moves)?;
        let mips: Vec<u8> = (0..self.texels.sizes.len() as u8)
            .filter(|&mip| self.positions.level_of(mip) == group.level)
            .collect();
        let mut differences = vec![0.0_f32; moves.len()];
        for &mip in &mips {
            let trial = &mut self.trial[usize::from(mip)];
            decode(&asset, self.texels, mip, trial);
            self.attribute(group, mip, &moves, &mut differences);
        }
        let kept: Vec<bool> = differences.iter().map(|&d| d < 0.0).collect();
        let proposed = moves.clone();
        for (of_cell, &kept) in moves.iter_mut().zip(&kept) {
            *of_cell = of_cell.filter(|_| kept);
        }
        let asset = self.moved(group, &moves)?;
        let [mut before, mut after] = [0.0, 0.0];
        for &mip in &mips {
            if self.take_back(group, mip, &proposed, &kept) {
                let trial = &mut self.trial[usize::from(mip)];
                decode(&asset, self.texels, mip, trial);
            }
            before += total(&self.errors[usize::from(mip)]);
            after += total(&self.trial[usize::from(mip)]);
        }
        if after >= before {
            return Ok(0);
        }
        for &mip in &mips {
            let mip = usize::from(mip);
            std::mem::swap(&mut self.errors[mip], &mut self.trial[mip]);
        }
        self.asset = asset;
        Ok(moves.iter().flatten().count() as u64)
    }

    /// The move of each cell of a level: that of the latent with the largest gradient among those that
    /// have a code in its direction; none outside the group.
    fn proposed(&self, group: Group, gradient: &[f32]) -> Vec<Option<Move>> {
        let level = self.positions.levels[group.grid][group.level];
        let channels = self.embedding.channels[group.grid];
        let highest = self.asset.shape.grids[group.grid].format.max_code();
        let codes = &self.asset.grids[group.grid];
        let mut moves = vec![None; level.cells()];
        let [width, height] = level.size;
        for y in (group.first[1]..height).step_by(2) {
            for x in (group.first[0]..width).step_by(2) {
                let cell = y as usize * width as usize + x as usize;
                let start = (level.base + cell) * channels;
                let mut steepest = 0.0;
                for at in start..start + channels {
                    let up = gradient[at] < 0.0;
                    let is_free = if up {
                        codes[at] < highest
                    } else {
                        codes[at] > 0
                    };
                    if is_free && gradient[at].abs() > steepest {
                        steepest = gradient[at].abs();
                        moves[cell] = Some(Move { at, up });
                    }
                }
            }
        }
        moves
    }

    /// The asset after moves.
    fn moved(&self, group: Group, moves: &[Option<Move>]) -> Result<Asset, TrainError> {
        let mut parts = self.asset.clone().into_parts();
        for Move { at, up } in moves.iter().flatten() {
            let code = &mut parts.grids[group.grid][*at];
            *code = if *up { *code + 1 } else { *code - 1 };
        }
        Ok(Asset::new(parts)?)
    }

    /// Adds to each moving cell what the texels of a mip that read it gain or lose.
    fn attribute(&self, group: Group, mip: u8, moves: &[Option<Move>], differences: &mut [f32]) {
        let (errors, trial) = (
            &self.errors[usize::from(mip)],
            &self.trial[usize::from(mip)],
        );
        let pairs = errors.iter().zip(trial);
        for ((error, trial), readers) in pairs.zip(self.reading(group, mip, moves)) {
            let share = (trial - error) / readers.count.max(1) as f32;
            for &cell in readers.cells() {
                differences[cell] += share;
            }
        }
    }

    /// Takes a mip's trial back where no move is kept that a texel reads. Whether there are texels of
    /// which some are kept and others not.
    fn take_back(&mut self, group: Group, mip: u8, moves: &[Option<Move>], kept: &[bool]) -> bool {
        let mut trial = std::mem::take(&mut self.trial[usize::from(mip)]);
        let mut are_mixed = false;
        let errors = &self.errors[usize::from(mip)];
        let pairs = trial.iter_mut().zip(errors);
        for ((trial, &error), read) in pairs.zip(self.reading(group, mip, moves)) {
            let count = read.cells().iter().filter(|&&cell| kept[cell]).count();
            if count == 0 {
                *trial = error;
            }
            are_mixed |= count != 0 && count != read.count;
        }
        self.trial[usize::from(mip)] = trial;
        are_mixed
    }

    /// The moving cells that each texel of a mip reads, in reading order.
    fn reading<'s>(
        &'s self,
        group: Group,
        mip: u8,
        moves: &'s [Option<Move>],
    ) -> impl Iterator<Item = Read> + 's {
        let (width, height) = self.texels.sizes[usize::from(mip)];
        let [columns, _] = self.positions.levels[group.grid][group.level].size;
        let of_axis = move |axis: usize, texel: u32| {
            self.positions.axis(axis, texel, mip).cells[group.grid].map(|cell| cell as usize)
        };
        (0..height).flat_map(move |y| {
            let rows = of_axis(1, y).map(|row| row * columns as usize);
            (0..width).map(move |x| {
                let mut read = Read::default();
                for row in rows {
                    for column in of_axis(0, x) {
                        if moves[row + column].is_some() {
                            read.add(row + column);
                        }
                    }
                }
                read
            })
        })
    }
}

/// The name of this work in errors.
pub(crate) const STAGE: &str = "settling";

/// Some of a texel's four corners, each once.
#[derive(Clone, Copy, Debug, Default)]
struct Read {
    list: [usize; 4],
    count: usize,
}

impl Read {
    fn cells(&self) -> &[usize] {
        &self.list[..self.count]
    }

    fn add(&mut self, cell: usize) {
        if !self.cells().contains(&cell) {
            self.list[self.count] = cell;
            self.count += 1;
        }
    }
}

fn total(errors: &[f32]) -> f64 {
    errors.iter().map(|&error| f64::from(error)).sum()
}

/// The weighted squared error of every texel of a mip of an asset, 0 where it is masked out.
fn decode(asset: &Asset, texels: &Texels, mip: u8, errors: &mut [f32]) {
    let (width, _) = texels.sizes[usize::from(mip)];
    let outputs = asset.shape.outputs.iter();
    let units: Vec<f32> = outputs.map(|o| 1.0 / o.range().1 as f32).collect();
    Decode::new(asset).bands(mip, |first, codes| {
        let (_, rows, columns) = codes.dim();
        let start = first as usize * columns;
        let band = errors[start..start + rows * columns].par_chunks_mut(columns);
        band.enumerate().for_each(|(row, errors)| {
            let y = first + row as u32;
            errors.fill(0.0);
            let channels = codes.outer_iter().zip(&texels.weights).zip(&units);
            for (channel, ((plane, &weight), &unit)) in channels.enumerate() {
                for ((x, &code), error) in (0..width).zip(plane.row(row)).zip(errors.iter_mut()) {
                    let difference = code as f32 * unit - texels.texel(x, y, mip)[channel];
                    *error += weight * (difference * difference);
                }
            }
            if texels.covered(mip).is_some() {
                for (x, error) in (0..width).zip(errors) {
                    if !texels.is_covered(x, y, mip) {
                        *error = 0.0;
                    }
                }
            }
        });
    });
}
