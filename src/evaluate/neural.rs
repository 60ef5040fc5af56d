//! Neural: a point of a neural codec, through the trainer.

use super::EvaluateError;
use super::codec::Neural;
use crate::texture_set::TextureSet;
use ndarray::Array3;
use serde_json::Value;
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// A texture set after a neural codec.
pub(super) struct Trained {
    /// The `.ntx` file.
    pub(super) bytes: Vec<u8>,
    /// As decoded: one array per mip, \[channel, row, column\], 0..=1.
    pub(super) mips: Vec<Array3<f32>>,
    /// Bits of grids and parameters.
    pub(super) bits: u64,
    /// See [`crate::quality::bppc`].
    pub(super) bppc: f64,
    /// Seconds of training, in however many processes.
    pub(super) encode_seconds: f64,
    /// Seconds of decoding all mips.
    pub(super) decode_seconds: f64,
    /// What the run says of itself.
    pub(super) report: Value,
}

#[cfg(not(feature = "train"))]
pub(super) fn check(codec: &Neural) -> Result<(), EvaluateError> {
    Err(EvaluateError::NoTrainer {
        codec: codec.preset.clone(),
    })
}

#[cfg(not(feature = "train"))]
pub(super) fn code(
    _set: &TextureSet,
    codec: &Neural,
    _checkpoint: &Path,
    _stop: &AtomicBool,
    _after_step: &mut dyn FnMut(usize, usize),
) -> Result<Trained, EvaluateError> {
    Err(EvaluateError::NoTrainer {
        codec: codec.preset.clone(),
    })
}

#[cfg(feature = "train")]
pub(super) use with_trainer::{check, code};

#[cfg(feature = "train")]
mod with_trainer {
    use super::{AtomicBool, EvaluateError, Neural, Path, TextureSet, Trained};
    use crate::decoded::Decoded;
    use crate::quality;
    use crate::trainer::{
        self, Backend, EFFORTS, Plan, Precision, Preset, TrainConfig, TrainError, TrainingDevice,
    };
    use crate::training_source::training_source;
    use std::time::Instant;

    /// Finds out before the work whether the configuration is one.
    pub(crate) fn check(codec: &Neural) -> Result<(), EvaluateError> {
        config(codec)?;
        device(codec)?;
        Ok(())
    }

    fn device(codec: &Neural) -> Result<TrainingDevice, TrainError> {
        let name = codec.backend.as_deref();
        let backend = name.map_or(Ok(Backend::Flex), Backend::by_name)?;
        backend.open()
    }

    /// Trains an asset and decodes it. A checkpoint at `checkpoint` is gone on from; it is removed
    /// by the caller, when the result is safe.
    pub(crate) fn code(
        set: &TextureSet,
        codec: &Neural,
        checkpoint: &Path,
        stop: &AtomicBool,
        after_step: &mut dyn FnMut(usize, usize),
    ) -> Result<Trained, EvaluateError> {
        let config = config(codec)?;
        let source = training_source(set);
        let trained = trainer::train(
            &source,
            &config,
            &device(codec)?,
            Some(checkpoint),
            true,
            stop,
            &mut |progress| after_step(progress.done as usize, progress.total as usize),
        )?;
        let asset = &trained.asset;
        let started = Instant::now();
        let mips = Decoded::of(asset, |_| ()).reals(&asset.shape);
        let decode_seconds = started.elapsed().as_secs_f64();
        let report = serde_json::to_value(&trained.report);
        Ok(Trained {
            bytes: asset.to_bytes(),
            mips,
            bits: asset.grid_bits() + asset.parameter_bits(),
            bppc: quality::bppc(asset),
            encode_seconds: trained.report.seconds,
            decode_seconds,
            report: report.map_err(|error| refuse(codec, "report", error.to_string(), "JSON"))?,
        })
    }

    fn config(codec: &Neural) -> Result<TrainConfig, EvaluateError> {
        let mut config = Preset::by_name(&codec.preset)?.config();
        if let Some(effort) = &codec.effort {
            config = config.with_effort(number(codec, effort)?);
        }
        if let Some(plan) = &codec.plan {
            config.plan = Some(Plan::by_name(plan)?);
        }
        config.seed = codec.seed;
        if let Some(name) = &codec.precision {
            let known = [Precision::Int8, Precision::Fp16];
            let found = known.into_iter().find(|precision| precision.name() == name);
            config.precision = found.ok_or_else(|| {
                let names = known.map(Precision::name).join(", ");
                refuse(codec, "precision", format!("{name:?}"), &names)
            })?;
        }
        if !codec.config.is_empty() {
            let failed = |error: serde_json::Error| {
                let allowed = "fields of the training configuration";
                refuse(codec, "config", error.to_string(), allowed)
            };
            let mut value = serde_json::to_value(&config).map_err(failed)?;
            for (name, field) in &codec.config {
                value[name] = field.clone();
            }
            config = serde_json::from_value(value).map_err(failed)?;
        }
        config.validate()?;
        Ok(config)
    }

    fn number(codec: &Neural, effort: &super::super::codec::Effort) -> Result<u8, EvaluateError> {
        use super::super::codec::Effort;
        let name = match effort {
            Effort::Number(number) => return Ok(*number),
            Effort::Name(name) => name,
        };
        let found = EFFORTS.iter().find(|(known, _)| known == name);
        found.map(|(_, number)| *number).ok_or_else(|| {
            let names = EFFORTS.map(|(name, _)| name).join(", ");
            refuse(codec, "effort", format!("{name:?}"), &names)
        })
    }

    fn refuse(codec: &Neural, field: &'static str, found: String, allowed: &str) -> EvaluateError {
        EvaluateError::Neural {
            codec: codec.preset.clone(),
            field,
            found,
            allowed: allowed.to_owned(),
        }
    }
}
