//! Source: a setup's demands, as often as they are wanted, whole or in parts.

use super::setup::Setup;
use crate::access::{AccessError, TraceFile};
use crate::model::sampler::Sampled;
use crate::model::stream::{AccessSpec, Stream, StreamDemands, StreamError};
use crate::model::{Demand, Demands};
use std::convert::Infallible;
use std::ops::Range;
use std::path::Path;

/// Demands of a trace file that count as a piece.
const FILE_PIECE: u64 = 64;

/// Pixels after which progress is told.
const TOLD_EVERY: u64 = 4096;

/// Where demands come from, checked.
#[derive(Debug)]
pub struct Source<'s> {
    kind: Kind<'s>,
    pixels: u64,
}

#[derive(Debug)]
enum Kind<'s> {
    Stream(Stream<'s>),
    File {
        path: &'s Path,
        materials: &'s [Sampled],
    },
}

/// Why there are no demands.
#[derive(Debug, thiserror::Error)]
pub enum SourceError {
    /// A scene or scan that does not exist.
    #[error("access: {0}")]
    Stream(StreamError),
    /// A trace file that cannot be read.
    #[error(transparent)]
    File(#[from] AccessError),
    /// No pixel sees a texture.
    #[error("access {access}: found no pixel that asks for a texel; allowed: one or more")]
    Nothing {
        /// The access.
        access: String,
    },
}

impl<'s> Source<'s> {
    /// The demands of a setup. A trace file is read once from end to end, so that what is wrong
    /// with it is known before anything is run.
    ///
    /// # Errors
    /// When the access does not suit the materials, the file is damaged, or nothing is asked for.
    pub fn new(setup: &'s Setup) -> Result<Source<'s>, SourceError> {
        let materials = setup.sampled();
        let (kind, pixels) = match setup.access() {
            AccessSpec::Texels(spec) => {
                let stream = Stream::texels(spec, materials).map_err(SourceError::Stream)?;
                let pixels = match &stream {
                    Stream::Texels(texels) => texels.texels(),
                    Stream::Scene(_) => 0,
                };
                (Kind::Stream(stream), pixels)
            }
            AccessSpec::Scene(spec) => {
                let screen = setup.screen();
                let stream = Stream::scene(spec, screen, materials, setup.interleave());
                let stream = stream.map_err(SourceError::Stream)?;
                let pixels = u64::from(screen[0]) * u64::from(screen[1]);
                (Kind::Stream(stream), pixels)
            }
            AccessSpec::File(path) => {
                let mut file = TraceFile::open(path, materials)?;
                let (mut demand, mut pixels) = (Demand::default(), 0);
                while file.advance(&mut demand)? {
                    pixels += 1;
                }
                (Kind::File { path, materials }, pixels)
            }
        };
        let source = Source { kind, pixels };
        if !source.asks()? {
            return Err(SourceError::Nothing {
                access: setup.access().to_string(),
            });
        }
        Ok(source)
    }

    /// Whether there is a demand at all.
    fn asks(&self) -> Result<bool, AccessError> {
        self.demands()?.advance(&mut Demand::default())
    }

    /// The most pixels that ask: a scene's screen, of which some pixels may see nothing.
    #[must_use]
    pub fn most_pixels(&self) -> u64 {
        self.pixels
    }

    /// The stream, if it is no file.
    #[must_use]
    pub fn stream(&self) -> Option<&Stream<'s>> {
        match &self.kind {
            Kind::Stream(stream) => Some(stream),
            Kind::File { .. } => None,
        }
    }

    /// Pieces that follow each other and are of about one size: a stream's tiles, or 64 demands of a
    /// file.
    #[must_use]
    pub fn pieces(&self) -> u64 {
        match &self.kind {
            Kind::Stream(stream) => stream.tiles(),
            Kind::File { .. } => self.pixels.div_ceil(FILE_PIECE),
        }
    }

    /// All demands, from the first.
    ///
    /// # Errors
    /// When the file cannot be opened any more.
    pub fn demands(&self) -> Result<SourceDemands<'_>, AccessError> {
        Ok(match &self.kind {
            Kind::Stream(stream) => SourceDemands::Stream(stream.demands()),
            Kind::File { path, materials } => {
                SourceDemands::File(Box::new(TraceFile::open(path, materials)?))
            }
        })
    }

    /// Calls `each` with the demands of each range of pieces, in parallel where they can be made
    /// apart, and gives the answers in the order of the ranges. The ranges are in order; they may
    /// overlap. Memory holds the demands of a few of them.
    ///
    /// # Errors
    /// When the file cannot be read any more.
    pub fn parts<T: Send>(
        &self,
        ranges: &[Range<u64>],
        each: impl Fn(usize, &[Demand]) -> T + Sync,
    ) -> Result<Vec<T>, AccessError> {
        use rayon::prelude::*;
        match &self.kind {
            Kind::Stream(stream) => Ok(ranges
                .par_iter()
                .enumerate()
                .map(|(index, range)| each(index, &gathered(stream.part(range.clone()))))
                .collect()),
            Kind::File { .. } => {
                let mut demands = self.demands()?;
                let mut window = Window::default();
                let together = rayon::current_num_threads();
                let mut answers = Vec::with_capacity(ranges.len());
                for (batch, ranges) in ranges.chunks(together).enumerate() {
                    let mut held = Vec::new();
                    for range in ranges {
                        let pixels = range.start * FILE_PIECE..range.end * FILE_PIECE;
                        held.push(window.slide(&mut demands, pixels)?);
                    }
                    let first = batch * together;
                    answers.par_extend(
                        held.par_iter()
                            .enumerate()
                            .map(|(index, held)| each(first + index, held)),
                    );
                }
                Ok(answers)
            }
        }
    }
}

/// All demands of a part, in memory.
fn gathered(mut part: StreamDemands<'_>) -> Vec<Demand> {
    let (mut demand, mut all) = (Demand::default(), Vec::new());
    loop {
        let Ok(is_there) = part.advance(&mut demand);
        if !is_there {
            return all;
        }
        all.push(std::mem::take(&mut demand));
    }
}

/// The last demands read from a file, so that ranges may overlap.
#[derive(Default)]
struct Window {
    first: u64,
    held: std::collections::VecDeque<Demand>,
    is_at_end: bool,
}

impl Window {
    /// The demands of a range that starts no earlier than the one before.
    fn slide(
        &mut self,
        demands: &mut SourceDemands<'_>,
        range: Range<u64>,
    ) -> Result<Vec<Demand>, AccessError> {
        let mut demand = Demand::default();
        while !self.is_at_end && self.first + (self.held.len() as u64) < range.end {
            if demands.advance(&mut demand)? {
                self.held.push_back(demand.clone());
            } else {
                self.is_at_end = true;
            }
            while self.first < range.start && self.held.pop_front().is_some() {
                self.first += 1;
            }
        }
        while self.first < range.start && self.held.pop_front().is_some() {
            self.first += 1;
        }
        let count = range.end.saturating_sub(self.first) as usize;
        Ok(self.held.iter().take(count).cloned().collect())
    }
}

/// See [`Source::demands`].
pub enum SourceDemands<'s> {
    /// Of a stream.
    Stream(StreamDemands<'s>),
    /// Of a file.
    File(Box<TraceFile<'s>>),
}

impl Demands for SourceDemands<'_> {
    type Error = AccessError;

    fn advance(&mut self, demand: &mut Demand) -> Result<bool, AccessError> {
        match self {
            SourceDemands::Stream(stream) => {
                let Ok(is_there) = stream.advance(demand);
                Ok(is_there)
            }
            SourceDemands::File(file) => file.advance(demand),
        }
    }
}

/// Demands that tell how far they are.
pub struct Told<'t, D> {
    demands: D,
    tell: &'t (dyn Fn(u64) + Sync),
    untold: u64,
}

impl<'t, D> Told<'t, D> {
    /// `tell` is called with the pixels since it was called last.
    pub fn new(demands: D, tell: &'t (dyn Fn(u64) + Sync)) -> Told<'t, D> {
        Told {
            demands,
            tell,
            untold: 0,
        }
    }
}

impl<D: Demands> Demands for Told<'_, D> {
    type Error = D::Error;

    fn advance(&mut self, demand: &mut Demand) -> Result<bool, D::Error> {
        let is_there = self.demands.advance(demand)?;
        self.untold += u64::from(is_there);
        if self.untold == TOLD_EVERY || !is_there {
            (self.tell)(std::mem::take(&mut self.untold));
        }
        Ok(is_there)
    }
}

/// Demands that are in memory, once more.
pub struct Replay<'d>(std::slice::Iter<'d, Demand>);

impl<'d> Replay<'d> {
    /// These, from the first.
    #[must_use]
    pub fn new(demands: &'d [Demand]) -> Replay<'d> {
        Replay(demands.iter())
    }
}

impl Demands for Replay<'_> {
    type Error = Infallible;

    fn advance(&mut self, demand: &mut Demand) -> Result<bool, Infallible> {
        let Some(next) = self.0.next() else {
            return Ok(false);
        };
        demand.pixel = next.pixel;
        demand.material = next.material;
        demand.places.clone_from(&next.places);
        demand.weights = next.weights;
        Ok(true)
    }
}
