//! Train: the front door of a run.

use crate::budget::Budget;
use crate::checkpoint::{self, Extent, Position};
use crate::choices::FirstLatents;
use crate::config::TrainConfig;
use crate::device::TrainingDevice;
use crate::error::TrainError;
use crate::first_latents;
use crate::model::{Ground, Model};
use crate::plan::Train;
use crate::report::{Progress, Trained, Watch};
use crate::run::Run;
use crate::schedule;
use crate::source::Source;
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

/// Trains an asset for `source`.
///
/// The stages in reals run on `device`; those in the decode's own numbers and the evaluations run on
/// the processor. A run may be resumed on another device than it began on.
///
/// With `checkpoint`, the state is written there every [`TrainConfig::checkpoint_every`] steps and
/// when `stop` becomes true. With `resume` as well, a run goes on from the file if it exists, and
/// ends with the bytes that the uninterrupted run would have ended with. `observer` hears of every
/// twentieth step and of the last of each stage.
///
/// # Errors
/// When the configuration or the set is refused, the checkpoint is damaged or of another run, the
/// loss diverges, or `stop` became true.
pub fn train(
    source: &Source,
    config: &TrainConfig,
    device: &TrainingDevice,
    checkpoint: Option<&Path>,
    resume: bool,
    stop: &AtomicBool,
    observer: &mut dyn FnMut(&Progress),
) -> Result<Trained, TrainError> {
    // A closure watches; the compiler wants it said with a type of its own.
    let mut observer = observer;
    watched(
        source,
        config,
        device,
        checkpoint,
        resume,
        stop,
        &mut observer,
    )
}

/// The same with a watcher, who can also ask for the asset as it stands.
///
/// # Errors
/// As [`train`].
pub fn watched(
    source: &Source,
    config: &TrainConfig,
    device: &TrainingDevice,
    checkpoint: Option<&Path>,
    resume: bool,
    stop: &AtomicBool,
    watch: &mut dyn Watch,
) -> Result<Trained, TrainError> {
    let started = Instant::now();
    config.validate()?;
    source.validate()?;
    let ground = Ground::new(config, source)?;
    let mut stages = config.stages(&ground.texels.sizes)?;
    let identity = checkpoint::identity(&ground)?;
    let resumed = checkpoint.filter(|path| resume && path.exists());
    let mut model = Model::new(&ground)?;
    if stages
        .iter()
        .any(|s| s.train == Train::Encoder && s.steps > 0)
    {
        model.start_encoder(&ground);
    } else if config.first_latents() == FirstLatents::Components && resumed.is_none() {
        first_latents::set(&ground, &mut model.latents);
    }
    let texels = ground.texels.count();
    let mut rounds = schedule::rounds(config, &stages, texels);
    let mut budget = None;
    let position = match resumed {
        Some(path) => {
            let position = checkpoint::read(path, identity, &stages, &mut model)?;
            for (stage, extent) in stages.iter_mut().zip(&position.extents) {
                stage.steps = extent.steps;
                stage.batch = extent.batch;
            }
            position
        }
        None => {
            if let Some(seconds) = config.seconds {
                let fitted = Budget::fit(&ground, &model, &mut stages, device, (seconds, started))?;
                rounds = fitted.rounds;
                budget = Some(fitted);
            }
            Position {
                stage: 0,
                step: 0,
                loss: f64::NAN,
                least: f64::NAN,
                seconds: 0.0,
                rounds,
                extents: Extent::of(&stages),
            }
        }
    };
    let mut run = Run::new(ground, model, stages, device, (position, identity), started);
    run.checkpoint = checkpoint;
    run.budget = budget;
    if let Some(path) = resumed {
        run.resumed_from(path);
    }
    run.all_stages(stop, watch)?;
    run.finish(stop, watch)
}
