//! Result: what is known of a point, as a file.

use super::EvaluateError;
use super::machine::Machine;
use crate::beside;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::io::Write as _;
use std::path::Path;

/// The set of a point.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SetRecord {
    /// Its name.
    pub name: String,
    /// See [`super::identity::fingerprint`].
    pub fingerprint: String,
    /// Texels per row at mip 0.
    pub width: u32,
    /// Rows at mip 0.
    pub height: u32,
    /// Channels of all maps.
    pub channels: usize,
    /// Mips of the chain.
    pub mips: usize,
}

/// A map's figure.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MapRecord {
    /// The map's name.
    pub name: String,
    /// PSNR of mip 0 in dB; none where equal.
    pub psnr: Option<f64>,
}

/// What is known of a point.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PointResult {
    /// See [`super::identity::identity`].
    pub id: String,
    /// The set.
    pub set: SetRecord,
    /// The point's name on its curve.
    pub label: String,
    /// The codec with all that decides its result.
    pub codec: Value,
    /// Bits of what is stored: all blocks of all mips, or grids and parameters.
    pub bits: u64,
    /// These bits over the texels of mip 0 and the channels: the rate of curves.
    pub bppc: f64,
    /// The same of the blocks of mip 0 alone; none for neural codecs, whose grids serve all mips.
    pub bppc_mip0: Option<f64>,
    /// PSNR over all mips and channels in dB; none where equal.
    pub psnr: Option<f64>,
    /// SSIM over all mips and channels.
    pub ssim: f64,
    /// PSNR of mip 0 per map.
    pub maps: Vec<MapRecord>,
    /// All figures: per map and mip.
    pub quality: Value,
    /// Seconds of encoding; of a training run that was resumed, those after it.
    pub encode_seconds: f64,
    /// Seconds of decoding the whole chain on the CPU.
    pub decode_seconds: f64,
    /// The encoder and its version.
    pub encoder: String,
    /// What was stored together, in words; of a neural codec, what the training run says of itself.
    pub details: Value,
    /// Where it was made.
    pub machine: Machine,
    /// When it was finished, in UTC.
    pub finished: String,
    /// This program's version.
    pub ntmu: String,
}

impl PointResult {
    /// Reads a result, if it is there.
    ///
    /// # Errors
    /// [`EvaluateError::Result`] when the file is no result.
    pub fn read(path: &Path) -> Result<Option<PointResult>, EvaluateError> {
        let text = match std::fs::read_to_string(path) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(EvaluateError::io(path)(error)),
        };
        let result = serde_json::from_str(&text).map_err(|error| EvaluateError::Result {
            path: path.to_owned(),
            found: error.to_string(),
        });
        result.map(Some)
    }
}

/// Writes a file so that it is there whole or not at all.
pub(super) fn write(path: &Path, bytes: &[u8]) -> Result<(), EvaluateError> {
    let io = || EvaluateError::io(path);
    let mut file = beside::file_for(path).map_err(io())?;
    file.write_all(bytes).map_err(io())?;
    file.as_file().sync_all().map_err(io())?;
    file.persist(path).map_err(|error| io()(error.error))?;
    Ok(())
}

/// Writes a value as JSON, in the same way.
pub(super) fn write_json(path: &Path, value: &impl Serialize) -> Result<(), EvaluateError> {
    let mut text = serde_json::to_string_pretty(value).map_err(|error| EvaluateError::Result {
        path: path.to_owned(),
        found: error.to_string(),
    })?;
    text.push('\n');
    write(path, text.as_bytes())
}
