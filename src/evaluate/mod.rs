//! Evaluate: sets × codecs × rates, point by point, to one table, one plot and one matrix.
//!
//! ```text
//! Plan ─► Evaluation: points with identities ─► run: a file for each ─► summary: tables, curves, BD
//! ```
//!
//! A point's identity is the hash of what is coded and how, so a finished point is not made again, and
//! machines that share a folder, or whose folders are put together, share the work. A result is
//! written whole or not at all, after everything else of its point: what is there is finished.

use crate::texture_set::TextureSet;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::atomic::{AtomicBool, Ordering};

mod code;
pub mod codec;
mod curves;
mod error;
pub mod identity;
pub mod machine;
mod measured;
mod neural;
pub mod plan;
pub mod result;
pub mod summary;
mod table;
#[cfg(test)]
mod tests;

pub use codec::Codec;
pub use error::EvaluateError;
pub use plan::Plan;
pub use result::PointResult;
pub use summary::summarise;

/// A set of the plan, known but not held.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct KnownSet {
    /// Where it is.
    pub place: plan::SetPlace,
    /// Its name, which no other set of the plan has.
    pub name: String,
    /// See [`identity::fingerprint`].
    pub fingerprint: String,
}

/// One set after one codec at one rate.
#[derive(Clone, Debug, PartialEq)]
pub struct Point {
    /// Index into [`Evaluation::sets`].
    pub set: usize,
    /// Index into the plan's curves.
    pub curve: usize,
    /// How it is coded.
    pub codec: Codec,
    /// Its name for people: `Wood063_1K.astc-8x8`.
    pub label: String,
    /// See [`identity::identity`].
    pub id: String,
}

/// The files of a point.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// The point's identity.
    pub id: String,
    /// The result.
    pub result: PathBuf,
    /// The asset of a neural codec.
    pub asset: PathBuf,
    /// Where an unfinished training run is kept.
    pub checkpoint: PathBuf,
}

/// A part of the points, for one machine of several.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// Which, from 0.
    pub index: usize,
    /// Of how many.
    pub count: usize,
}

impl FromStr for Shard {
    type Err = EvaluateError;

    fn from_str(text: &str) -> Result<Shard, EvaluateError> {
        let parts = text.split_once('/');
        let parts = parts.and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
        match parts {
            Some((index, count)) if index < count => Ok(Shard { index, count }),
            Some(_) | None => Err(EvaluateError::Shard {
                found: text.to_owned(),
            }),
        }
    }
}

/// What happens while points are made.
#[derive(Debug)]
pub enum Event<'a> {
    /// A point begins.
    Begun {
        /// Its place among those to be made, from 0.
        index: usize,
        /// How many are to be made.
        count: usize,
        /// The point.
        point: &'a Point,
    },
    /// A part of it is done: an image, or some steps.
    Part {
        /// Parts done.
        done: usize,
        /// Parts of the point.
        total: usize,
    },
    /// It is finished, and its result is written.
    Finished {
        /// The point.
        point: &'a Point,
        /// Its result.
        result: &'a PointResult,
    },
    /// It failed; the others go on.
    Failed {
        /// The point.
        point: &'a Point,
        /// Why.
        error: &'a EvaluateError,
    },
}

/// A plan with its sets looked at and its points named.
#[derive(Clone, Debug, PartialEq)]
pub struct Evaluation {
    /// The plan.
    pub plan: Plan,
    /// The sets, in the plan's order.
    pub sets: Vec<KnownSet>,
    /// Every point: set by set, curve by curve, rate by rate.
    pub points: Vec<Point>,
    folder: PathBuf,
}

impl Evaluation {
    /// Reads every set once and names the points. Results are looked for and kept in `folder`, of
    /// which nothing is touched yet.
    ///
    /// # Errors
    /// When a set cannot be read.
    pub fn new(plan: Plan, folder: &Path) -> Result<Evaluation, EvaluateError> {
        let mut sets: Vec<KnownSet> = Vec::new();
        for place in &plan.sets {
            let set = place.read()?;
            let name = unused(&plain(&set.name), &sets);
            sets.push(KnownSet {
                place: place.clone(),
                name,
                fingerprint: identity::fingerprint(&set),
            });
        }
        let mut points = Vec::new();
        for (index, set) in sets.iter().enumerate() {
            for (curve, planned) in plan.curves.iter().enumerate() {
                points.extend(planned.codecs.iter().map(|codec| Point {
                    set: index,
                    curve,
                    label: format!("{}.{codec}", set.name),
                    id: identity::identity(&set.fingerprint, codec),
                    codec: codec.clone(),
                }));
            }
        }
        Ok(Evaluation {
            plan,
            sets,
            points,
            folder: folder.to_owned(),
        })
    }

    /// The folder of the results.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The files of a point.
    #[must_use]
    pub fn place(&self, point: &Point) -> Place {
        let at = |folder: &str, extension: &str| {
            let file = format!("{}.{}.{extension}", point.label, point.id);
            self.folder.join(folder).join(file)
        };
        Place {
            id: point.id.clone(),
            result: at("points", "json"),
            asset: at("points", "ntx"),
            checkpoint: at("unfinished", "checkpoint"),
        }
    }

    /// The result of a point, if it is finished.
    ///
    /// # Errors
    /// When the file is damaged, or is another point's.
    pub fn result(&self, point: &Point) -> Result<Option<PointResult>, EvaluateError> {
        let place = self.place(point);
        let result = PointResult::read(&place.result)?;
        match result {
            Some(result) if result.id != point.id => Err(EvaluateError::Result {
                path: place.result,
                found: format!("found the result of point {}", result.id),
            }),
            other => Ok(other),
        }
    }

    /// The points whose label or identity has one of the texts in it (all, where there is none) and
    /// that belong to the shard.
    #[must_use]
    pub fn chosen(&self, only: &[String], shard: Option<Shard>) -> Vec<&Point> {
        let is_meant = |point: &&Point| {
            only.is_empty()
                || only
                    .iter()
                    .any(|text| point.label.contains(text) || point.id.contains(text))
        };
        let meant = self.points.iter().filter(is_meant).enumerate();
        meant
            .filter(|(index, _)| shard.is_none_or(|shard| index % shard.count == shard.index))
            .map(|(_, point)| point)
            .collect()
    }

    /// Finds out before the work what this machine or this build lacks for a point.
    ///
    /// # Errors
    /// When the encoder is missing or the configuration is none.
    pub fn check(&self, point: &Point) -> Result<(), EvaluateError> {
        match &point.codec {
            Codec::Neural(codec) => neural::check(codec),
            Codec::Astc { .. } => Ok(crate::rival::astcenc::Astcenc::find().map(|_| ())?),
            Codec::Bc { .. } => Ok(()),
        }
    }

    /// Makes the points that are not finished. One that fails stops no other; `stop` does, before
    /// the next point, and at once where a neural codec is at work, which leaves a checkpoint.
    ///
    /// # Errors
    /// When the folder cannot be made. What befalls a point is an [`Event`].
    pub fn run(
        &self,
        points: &[&Point],
        stop: &AtomicBool,
        observer: &mut dyn FnMut(Event<'_>),
    ) -> Result<(), EvaluateError> {
        for name in ["points", "unfinished"] {
            let folder = self.folder.join(name);
            std::fs::create_dir_all(&folder).map_err(EvaluateError::io(&folder))?;
        }
        let mut held: Option<(usize, TextureSet)> = None;
        for (index, point) in points.iter().enumerate() {
            if stop.load(Ordering::SeqCst) {
                break;
            }
            observer(Event::Begun {
                index,
                count: points.len(),
                point,
            });
            match self.make(point, &mut held, stop, observer) {
                Ok(result) => observer(Event::Finished {
                    point,
                    result: &result,
                }),
                Err(error) => observer(Event::Failed {
                    point,
                    error: &error,
                }),
            }
        }
        Ok(())
    }

    fn make(
        &self,
        point: &Point,
        held: &mut Option<(usize, TextureSet)>,
        stop: &AtomicBool,
        observer: &mut dyn FnMut(Event<'_>),
    ) -> Result<PointResult, EvaluateError> {
        if let Some(result) = self.result(point)? {
            return Ok(result);
        }
        let known = &self.sets[point.set];
        let set = match held.take() {
            Some((index, set)) if index == point.set => set,
            Some(_) | None => known.place.read()?,
        };
        let place = self.place(point);
        let mut after_part = |done, total| observer(Event::Part { done, total });
        let result = code::code(
            &set,
            &known.fingerprint,
            &point.codec,
            &place,
            stop,
            &mut after_part,
        );
        *held = Some((point.set, set));
        result
    }
}

/// A name as a part of a file's name.
fn plain(name: &str) -> String {
    let plain = |c: char| {
        if c.is_ascii_alphanumeric() || c == '_' || c == '-' {
            c
        } else {
            '_'
        }
    };
    name.chars().map(plain).take(60).collect()
}

/// The name, with a number where another set has it.
fn unused(name: &str, sets: &[KnownSet]) -> String {
    let is_free = |candidate: &str| sets.iter().all(|set| set.name != candidate);
    if is_free(name) {
        return name.to_owned();
    }
    let mut number = 2;
    while !is_free(&format!("{name}_{number}")) {
        number += 1;
    }
    format!("{name}_{number}")
}
