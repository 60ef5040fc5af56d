//! Checkpoint: the state between two steps, as a file.
//!
//! ```text
//! "NTMUCKP4"  identity u64  stage u32  step u64
//! loss f64  least f64  seconds f64
//! rounds u32  stages u32  then for each: steps u64  batch u64
//! count u32   then for each array: length u64, that many f32
//! CRC-32 of everything before it
//! ```
//! All little endian. A file is written beside its place, made durable and renamed, so that an
//! interrupted write never replaces a good one.

use crate::error::TrainError;
use crate::model::{Ground, Model};
use crate::quantise::Range;
use crate::stage::Stage;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

const MAGIC: &[u8; 8] = b"NTMUCKP4";

/// Where a run is, between two steps.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Position {
    /// The place in the list of stages that run.
    pub(crate) stage: usize,
    /// Steps done in the stage.
    pub(crate) step: u64,
    /// The smoothed loss in this stage, and the least that it was; no numbers before its first step.
    pub(crate) loss: f64,
    pub(crate) least: f64,
    /// Seconds that the run has taken so far.
    pub(crate) seconds: f64,
    /// The most rounds in which latents settle after the last stage.
    pub(crate) rounds: u32,
    /// What a budget of time has fixed of each stage that runs.
    pub(crate) extents: Vec<Extent>,
}

/// How much a stage does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Extent {
    pub(crate) steps: u64,
    /// Texels of a step.
    pub(crate) batch: usize,
}

impl Extent {
    pub(crate) fn of(stages: &[Stage]) -> Vec<Extent> {
        let extents = stages
            .iter()
            .map(|&Stage { steps, batch, .. }| Extent { steps, batch });
        extents.collect()
    }
}

/// A number that two runs share exactly when they make the same asset.
pub(crate) fn identity(ground: &Ground<'_>) -> Result<u64, TrainError> {
    let mut config = ground.config.clone();
    // How often a run saves itself does not change what it makes; and other rates are the way on
    // after a divergence.
    config.checkpoint_every = 1;
    config.rate_factor = 1.0;
    let text = serde_json::to_string(&(
        &config,
        &ground.source.name,
        format!("{:?}", (&ground.source.outputs, &ground.source.maps)),
    ))
    .map_err(|e| TrainError::config("config", e, "what JSON can hold"))?;
    let config = crc32fast::hash(text.as_bytes());
    Ok(u64::from(config) << 32 | u64::from(ground.texels.fingerprint()))
}

/// Every array of the model, in the file's order.
fn arrays(model: &Model) -> Vec<&[f32]> {
    let mut out: Vec<&[f32]> = vec![
        &model.parameters,
        &model.moments.first,
        &model.moments.second,
        &model.encoder,
        &model.encoder_moments.first,
        &model.encoder_moments.second,
    ];
    for grid in &model.latents {
        out.extend([
            grid.values.as_slice(),
            &grid.moments.first,
            &grid.moments.second,
        ]);
    }
    out
}

/// The same, to be replaced.
fn arrays_mut(model: &mut Model) -> Vec<&mut Vec<f32>> {
    let [g0, g1] = &mut model.latents;
    let mut out = vec![
        &mut model.parameters,
        &mut model.moments.first,
        &mut model.moments.second,
        &mut model.encoder,
        &mut model.encoder_moments.first,
        &mut model.encoder_moments.second,
    ];
    for grid in [g0, g1] {
        out.extend([
            &mut grid.values,
            &mut grid.moments.first,
            &mut grid.moments.second,
        ]);
    }
    out
}

/// Whether every number of the state is one.
pub(crate) fn is_finite(model: &Model) -> bool {
    let mut values = arrays(model).into_iter().flatten();
    values.all(|value| value.is_finite())
}

/// A file under its checksum.
struct Summed<W> {
    inner: W,
    hasher: crc32fast::Hasher,
}

impl<W: Write> Summed<W> {
    fn put(&mut self, bytes: &[u8]) -> std::io::Result<()> {
        self.hasher.update(bytes);
        self.inner.write_all(bytes)
    }

    fn put_array(&mut self, array: &[f32]) -> std::io::Result<()> {
        self.put(&(array.len() as u64).to_le_bytes())?;
        let mut bytes = Vec::new();
        for block in array.chunks(1 << 14) {
            bytes.clear();
            bytes.extend(block.iter().flat_map(|value| value.to_le_bytes()));
            self.put(&bytes)?;
        }
        Ok(())
    }
}

/// Writes the state to `path`.
pub(crate) fn write(
    path: &Path,
    identity: u64,
    position: &Position,
    model: &Model,
) -> Result<(), TrainError> {
    let beside = part(path);
    let written =
        put(&beside, identity, position, model).and_then(|()| std::fs::rename(&beside, path));
    written.map_err(|cause| {
        // What is half written helps nobody; the file system has said what is wrong already.
        std::fs::remove_file(&beside).ok();
        TrainError::Io {
            path: path.to_owned(),
            cause,
        }
    })
}

/// Where a checkpoint is written before it is renamed.
fn part(path: &Path) -> PathBuf {
    let mut beside = path.as_os_str().to_owned();
    beside.push(".part");
    PathBuf::from(beside)
}

fn put(path: &Path, identity: u64, position: &Position, model: &Model) -> std::io::Result<()> {
    let mut file = Summed {
        inner: BufWriter::new(File::create(path)?),
        hasher: crc32fast::Hasher::new(),
    };
    file.put(MAGIC)?;
    file.put(&identity.to_le_bytes())?;
    file.put(&(position.stage as u32).to_le_bytes())?;
    file.put(&position.step.to_le_bytes())?;
    let Position {
        loss,
        least,
        seconds,
        ..
    } = position;
    for value in [loss, least, seconds] {
        file.put(&value.to_le_bytes())?;
    }
    file.put(&position.rounds.to_le_bytes())?;
    file.put(&(position.extents.len() as u32).to_le_bytes())?;
    for extent in &position.extents {
        file.put(&extent.steps.to_le_bytes())?;
        file.put(&(extent.batch as u64).to_le_bytes())?;
    }
    let ranges: Vec<f32> = model
        .ranges
        .iter()
        .flat_map(|r| [r.scale, f32::from(r.zero_point)])
        .collect();
    let arrays = arrays(model);
    file.put(&(arrays.len() as u32 + 1).to_le_bytes())?;
    for array in arrays {
        file.put_array(array)?;
    }
    file.put_array(&ranges)?;
    let Summed { mut inner, hasher } = file;
    inner.write_all(&hasher.finalize().to_le_bytes())?;
    inner.flush()?;
    inner.get_ref().sync_all()
}

/// A cursor over bytes whose checksum is known to be right.
struct Reader<'a> {
    path: &'a Path,
    bytes: &'a [u8],
}

impl<'a> Reader<'a> {
    fn refuse(&self, found: impl Into<String>, allowed: impl Into<String>) -> TrainError {
        TrainError::Checkpoint {
            path: self.path.to_owned(),
            found: found.into(),
            allowed: allowed.into(),
        }
    }

    fn take(&mut self, len: usize) -> Result<&'a [u8], TrainError> {
        let Some((head, rest)) = self.bytes.split_at_checked(len) else {
            return Err(self.refuse(format!("{} bytes left", self.bytes.len()), format!("{len}")));
        };
        self.bytes = rest;
        Ok(head)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], TrainError> {
        let mut out = [0; N];
        out.copy_from_slice(self.take(N)?);
        Ok(out)
    }

    fn u64(&mut self) -> Result<u64, TrainError> {
        Ok(u64::from_le_bytes(self.array()?))
    }

    fn u32(&mut self) -> Result<u32, TrainError> {
        Ok(u32::from_le_bytes(self.array()?))
    }

    fn f64(&mut self) -> Result<f64, TrainError> {
        Ok(f64::from_le_bytes(self.array()?))
    }

    fn floats(&mut self) -> Result<Vec<f32>, TrainError> {
        let len = self.u64()?;
        let bytes = usize::try_from(len).ok().and_then(|l| l.checked_mul(4));
        let Some(bytes) = bytes else {
            return Err(self.refuse(format!("an array of {len}"), "what fits in memory"));
        };
        let mut value = [0; 4];
        let values = self.take(bytes)?.chunks_exact(4).map(|chunk| {
            value.copy_from_slice(chunk);
            f32::from_le_bytes(value)
        });
        Ok(values.collect())
    }
}

/// Reads the state from `path` into `model`, which is a fresh one of the same run, of these stages
/// before any of them was fitted into a time.
pub(crate) fn read(
    path: &Path,
    identity: u64,
    stages: &[Stage],
    model: &mut Model,
) -> Result<Position, TrainError> {
    let file = std::fs::read(path).map_err(|cause| TrainError::Io {
        path: path.to_owned(),
        cause,
    })?;
    let mut reader = Reader { path, bytes: &file };
    if reader.bytes.len() < MAGIC.len() + 4 || &reader.array()? != MAGIC {
        return Err(reader.refuse("another kind of file", "a checkpoint of this trainer"));
    }
    let (body, crc) = file.split_at(file.len() - 4);
    if crc32fast::hash(body).to_le_bytes() != crc {
        return Err(reader.refuse(
            "damaged or truncated bytes",
            "those that were written, whole",
        ));
    }
    reader.bytes = &body[MAGIC.len()..];
    let found = reader.u64()?;
    if found != identity {
        return Err(reader.refuse(
            format!("the state of run {found:016x}"),
            format!("{identity:016x}: the same configuration and texture set"),
        ));
    }
    let stage = reader.u32()? as usize;
    let step = reader.u64()?;
    let [loss, least, seconds] = [reader.f64()?, reader.f64()?, reader.f64()?];
    let rounds = reader.u32()?;
    let found = reader.u32()? as usize;
    if found != stages.len() {
        return Err(reader.refuse(format!("{found} stages"), stages.len().to_string()));
    }
    let mut extents = Vec::new();
    for planned in stages {
        let (steps, batch) = (reader.u64()?, reader.u64()? as usize);
        if !(1..=planned.batch).contains(&batch) {
            let allowed = format!("1..={}", planned.batch);
            return Err(reader.refuse(format!("a batch of {batch}"), allowed));
        }
        extents.push(Extent { steps, batch });
    }
    match extents.get(stage) {
        Some(extent) if step <= extent.steps => {}
        Some(extent) => {
            let allowed = format!("0..={}", extent.steps);
            return Err(reader.refuse(format!("step {step}"), allowed));
        }
        None => {
            let allowed = format!("0..{}", stages.len());
            return Err(reader.refuse(format!("stage {stage}"), allowed));
        }
    }
    let count = reader.u32()?;
    let targets = arrays_mut(model);
    if count as usize != targets.len() + 1 {
        return Err(reader.refuse(format!("{count} arrays"), format!("{}", targets.len() + 1)));
    }
    for target in targets {
        let values = reader.floats()?;
        if values.len() != target.len() {
            return Err(reader.refuse(
                format!("an array of {}", values.len()),
                format!("{}", target.len()),
            ));
        }
        *target = values;
    }
    let ranges = reader.floats()?;
    model.ranges = ranges
        .chunks_exact(2)
        .map(|pair| Range {
            scale: pair[0],
            zero_point: pair[1] as i16,
        })
        .collect();
    Ok(Position {
        stage,
        step,
        loss,
        least,
        seconds,
        rounds,
        extents,
    })
}
