//! What stops a training run.

use std::path::PathBuf;

/// A checkpoint from which a run can go on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Good {
    /// The file.
    pub path: PathBuf,
    /// The stage.
    pub stage: &'static str,
    /// Steps done in the stage.
    pub step: u64,
}

/// Where, what was found, what is allowed.
#[derive(Debug, thiserror::Error)]
pub enum TrainError {
    /// A field of the configuration is out of range or contradicts another.
    #[error("configuration: {field}: found {found}; allowed: {allowed}")]
    Config {
        /// The field, `grids[0].channels`.
        field: String,
        /// What was found.
        found: String,
        /// What is allowed.
        allowed: String,
    },
    /// The texture set cannot be trained on.
    #[error("texture set: {field}: found {found}; allowed: {allowed}")]
    Source {
        /// The part, `mips[2]`.
        field: String,
        /// What was found.
        found: String,
        /// What is allowed.
        allowed: String,
    },
    /// There is no preset of this name.
    #[error("there is no preset {found:?}; there are {allowed}")]
    Preset {
        /// The name asked for.
        found: String,
        /// Every name, separated by commas.
        allowed: String,
    },
    /// The loss is no longer a number, or far above what it was.
    #[error("the loss is {loss} in stage {stage} at step {step}: the run diverged; {}", match .good {
        Some(good) => format!(
            "the last good checkpoint is {}, from stage {} at step {}: resume it with lower rates \
             (a rate factor below 1)",
            good.path.display(), good.stage, good.step,
        ),
        None => "there is no checkpoint from before; lower the learning rates".to_owned(),
    })]
    Diverged {
        /// The stage.
        stage: &'static str,
        /// The step within the stage.
        step: u64,
        /// The loss found there.
        loss: f64,
        /// The last good checkpoint.
        good: Option<Good>,
    },
    /// The caller asked for the run to stop.
    #[error("stopped in stage {stage} at step {step}; {}", match .checkpoint {
        Some(path) => format!("the checkpoint is {}", path.display()),
        None => "no checkpoint was asked for, so the work is lost".to_owned(),
    })]
    Stopped {
        /// The stage.
        stage: &'static str,
        /// The step within the stage that comes next.
        step: u64,
        /// Where the run can be taken up again.
        checkpoint: Option<PathBuf>,
    },
    /// A checkpoint is damaged, foreign, or of another run.
    #[error("checkpoint {}: found {found}; allowed: {allowed}", .path.display())]
    Checkpoint {
        /// The file.
        path: PathBuf,
        /// What was found.
        found: String,
        /// What is allowed.
        allowed: String,
    },
    /// A checkpoint cannot be read or written.
    #[error("checkpoint {}: {cause}", .path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        cause: std::io::Error,
    },
    /// The backend that was asked for cannot be had.
    #[error("backend {backend}: {reason}")]
    Backend {
        /// Its name.
        backend: &'static str,
        /// Why not, and what would bring it.
        reason: String,
    },
    /// The trained parts do not form an asset.
    #[error("the trained parts do not form an asset: {0}")]
    Asset(#[from] ntmu_isa::AssetError),
    /// The tensor engine failed, as it does when memory runs out.
    #[error("tensor engine: {0}")]
    Engine(String),
}

impl TrainError {
    pub(crate) fn config(
        field: impl Into<String>,
        found: impl std::fmt::Display,
        allowed: impl Into<String>,
    ) -> TrainError {
        TrainError::Config {
            field: field.into(),
            found: found.to_string(),
            allowed: allowed.into(),
        }
    }

    pub(crate) fn source(
        field: impl Into<String>,
        found: impl std::fmt::Display,
        allowed: impl Into<String>,
    ) -> TrainError {
        TrainError::Source {
            field: field.into(),
            found: found.to_string(),
            allowed: allowed.into(),
        }
    }
}
