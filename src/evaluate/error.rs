//! What can be wrong with an evaluation.

use crate::metrics::MetricsError;
use crate::rival::RivalError;
use crate::texture_set::TextureSetError;
use std::path::{Path, PathBuf};

/// Why an evaluation, or one point of it, was not made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EvaluateError {
    /// The plan is not TOML or not of a plan's form.
    #[error("{}: {field}: found {found}; allowed: {allowed}", path.display())]
    Plan {
        /// The plan.
        path: PathBuf,
        /// The part of it.
        field: String,
        /// What was found.
        found: String,
        /// What may stand there.
        allowed: String,
    },
    /// A shard that does not exist.
    #[error("shard: found {found:?}; allowed: i/n with i from 0 to n − 1, such as 0/8")]
    Shard {
        /// What was found.
        found: String,
    },
    /// The file system said no.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// The system's answer.
        source: std::io::Error,
    },
    /// The result of a point is damaged.
    #[error("{}: {found}; remove the file, and the point is made again", path.display())]
    Result {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        found: String,
    },
    /// A texture set cannot be read.
    #[error(transparent)]
    Set(#[from] TextureSetError),
    /// A block codec failed.
    #[error(transparent)]
    Rival(#[from] RivalError),
    /// The decoded set is not of the source's shape.
    #[error(transparent)]
    Metrics(#[from] MetricsError),
    /// The trainer failed.
    #[cfg(feature = "train")]
    #[error(transparent)]
    Train(#[from] crate::trainer::TrainError),
    /// The configuration of a neural codec is not one.
    #[error("{codec}: {field}: found {found}; allowed: {allowed}")]
    Neural {
        /// The codec.
        codec: String,
        /// The field.
        field: &'static str,
        /// What was found.
        found: String,
        /// What is allowed.
        allowed: String,
    },
    /// The codec is neural and this build has no trainer.
    #[error(
        "{codec}: this build has no trainer; it comes with `cargo run --release --features train -- \
         evaluate`"
    )]
    NoTrainer {
        /// The codec.
        codec: String,
    },
    /// A curve, plot or matrix cannot be made of the points.
    #[error("{name}: {found}")]
    Curve {
        /// The curve or set.
        name: String,
        /// Why.
        found: String,
    },
}

impl EvaluateError {
    pub(super) fn io(path: &Path) -> impl FnOnce(std::io::Error) -> EvaluateError {
        let path = path.to_owned();
        move |source| EvaluateError::Io { path, source }
    }
}
