//! Checkpoint: the state between two steps, as a file.
//!
//! ```text
//! "NTMUCKP1"  identity u64  stage u8  step u64  psnr_float f64
//! count u32   then for each array: length u64, that many f32
//! CRC-32 of everything before it
//! ```
//! All little endian. A file is written beside its place and renamed into it, so that an
//! interrupted write never replaces a good one.

use crate::error::TrainError;
use crate::model::{Ground, Model};
use crate::quantise::Range;
use crate::schedule::Stage;
use std::path::{Path, PathBuf};

const MAGIC: &[u8; 8] = b"NTMUCKP1";

/// Where a run is, between two steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Position {
    pub(crate) stage: Stage,
    /// Steps done in the stage.
    pub(crate) step: u64,
    /// What the refinement ended with; 0 before.
    pub(crate) psnr_float: f64,
}

/// A number that two runs share exactly when they make the same asset.
pub(crate) fn identity(ground: &Ground<'_>) -> Result<u64, TrainError> {
    let mut config = ground.config.clone();
    // How often a run saves itself does not change what it makes.
    config.checkpoint_every = 1;
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
fn arrays(model: &mut Model) -> Vec<&mut Vec<f32>> {
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

fn put_array(bytes: &mut Vec<u8>, array: &[f32]) {
    bytes.extend((array.len() as u64).to_le_bytes());
    for value in array {
        bytes.extend(value.to_le_bytes());
    }
}

/// Writes the state to `path`.
pub(crate) fn write(
    path: &Path,
    identity: u64,
    position: Position,
    model: &Model,
) -> Result<(), TrainError> {
    let mut model = model.clone();
    let mut bytes = MAGIC.to_vec();
    bytes.extend(identity.to_le_bytes());
    bytes.push(position.stage as u8);
    bytes.extend(position.step.to_le_bytes());
    bytes.extend(position.psnr_float.to_le_bytes());
    let ranges: Vec<f32> = model
        .ranges
        .iter()
        .flat_map(|r| [r.scale, f32::from(r.zero_point)])
        .collect();
    let arrays = arrays(&mut model);
    bytes.extend((arrays.len() as u32 + 1).to_le_bytes());
    for array in arrays {
        put_array(&mut bytes, array);
    }
    put_array(&mut bytes, &ranges);
    bytes.extend(crc32fast::hash(&bytes).to_le_bytes());
    let io = |cause| TrainError::Io {
        path: path.to_owned(),
        cause,
    };
    let mut beside = path.as_os_str().to_owned();
    beside.push(".part");
    let beside = PathBuf::from(beside);
    std::fs::write(&beside, &bytes).map_err(io)?;
    std::fs::rename(&beside, path).map_err(io)
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

/// Reads the state from `path` into `model`, which is a fresh one of the same run.
pub(crate) fn read(path: &Path, identity: u64, model: &mut Model) -> Result<Position, TrainError> {
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
        return Err(reader.refuse("damaged or truncated bytes", "those that were written"));
    }
    reader.bytes = &body[MAGIC.len()..];
    let found = reader.u64()?;
    if found != identity {
        return Err(reader.refuse(
            format!("the state of run {found:016x}"),
            format!("{identity:016x}: the same configuration and texture set"),
        ));
    }
    let [stage] = reader.array()?;
    let Some(&stage) = Stage::ALL.get(usize::from(stage)) else {
        return Err(reader.refuse(format!("stage {stage}"), "0..=2"));
    };
    let step = reader.u64()?;
    let psnr_float = f64::from_le_bytes(reader.array()?);
    let count = u32::from_le_bytes(reader.array()?);
    let targets = arrays(model);
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
        psnr_float,
    })
}
