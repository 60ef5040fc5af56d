//! The run: stage after stage, with checkpoints between steps.

use crate::checkpoint::{self, Position};
use crate::config::{Steps, TrainConfig};
use crate::engine::Engine;
use crate::error::TrainError;
use crate::evaluate::decibels;
use crate::export;
use crate::model::{Ground, Model};
use crate::quantise::Widths;
use crate::refine::Rates;
use crate::report::{Progress, StageReport, TrainReport, Trained};
use crate::sampler::Numbers;
use crate::schedule::{self, Stage};
use crate::source::Source;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// Steps between two calls of the observer.
const OBSERVED: u64 = 20;

/// How much of the smoothed loss a new one replaces.
const SMOOTHING: f64 = 0.02;

/// Trains an asset for `source`.
///
/// With `checkpoint`, the state is written there every [`TrainConfig::checkpoint_every`] steps and
/// when `stop` becomes true. With `resume` as well, a run goes on from the file if it exists, and
/// ends with the bytes that the uninterrupted run would have ended with. `observer` hears of every
/// twentieth step and of the last of each stage.
///
/// # Errors
/// When the configuration or the set is refused, the checkpoint is damaged or of another run, the
/// loss is no number, or `stop` became true.
pub fn train(
    source: &Source,
    config: &TrainConfig,
    checkpoint: Option<&Path>,
    resume: bool,
    stop: &AtomicBool,
    observer: &mut dyn FnMut(&Progress),
) -> Result<Trained, TrainError> {
    config.validate()?;
    source.validate()?;
    let ground = Ground::new(config, source)?;
    let batch = schedule::batch(config, ground.texels.count());
    let steps = schedule::steps(config, ground.texels.count(), batch);
    let identity = checkpoint::identity(&ground)?;
    let mut run = Run {
        model: Model::new(&ground)?,
        position: Position {
            stage: Stage::Encoder,
            step: 0,
            psnr_float: 0.0,
        },
        ground,
        steps,
        identity,
        checkpoint,
        stop,
        observer,
        stages: Vec::new(),
    };
    if steps.encoder > 0 {
        run.model.start_encoder(&run.ground);
    }
    if let Some(path) = checkpoint.filter(|p| resume && p.exists()) {
        run.position = checkpoint::read(path, run.identity, &mut run.model)?;
    }
    run.all_stages()?;
    run.finish()
}

struct Run<'a> {
    ground: Ground<'a>,
    model: Model,
    position: Position,
    steps: Steps,
    identity: u64,
    checkpoint: Option<&'a Path>,
    stop: &'a AtomicBool,
    observer: &'a mut dyn FnMut(&Progress),
    stages: Vec<StageReport>,
}

impl Run<'_> {
    fn all_stages(&mut self) -> Result<(), TrainError> {
        let batch = schedule::batch(self.ground.config, self.ground.texels.count());
        let channels = self.ground.texels.channels;
        let mut engine = Engine::new(&self.ground.topology, batch, channels);
        for stage in Stage::ALL {
            if stage < self.position.stage {
                continue;
            }
            let start = Instant::now();
            if stage > self.position.stage {
                self.position = Position {
                    stage,
                    step: 0,
                    ..self.position
                };
            }
            if self.position.step == 0 {
                self.enter(stage);
            }
            self.stage(stage, &mut engine)?;
            if stage == Stage::Encoder && self.steps.encoder > 0 {
                self.model.encode_whole(&self.ground)?;
            }
            if stage == Stage::Refine {
                let errors = self.model.evaluate(&self.ground, Numbers::Real);
                self.position.psnr_float = decibels(errors.overall());
            }
            let seconds = start.elapsed().as_secs_f64();
            self.stages.push(StageReport {
                stage,
                steps: self.steps.of(stage),
                seconds,
            });
        }
        Ok(())
    }

    /// What happens once, before the first step of a stage.
    fn enter(&mut self, stage: Stage) {
        match stage {
            Stage::Encoder => {}
            Stage::Refine => self.model.forget_moments(),
            Stage::Integer => {
                self.model.forget_moments();
                self.model.calibrate(&self.ground);
            }
        }
    }

    fn stage(&mut self, stage: Stage, engine: &mut Engine) -> Result<(), TrainError> {
        let steps = self.steps.of(stage);
        let before: u64 = Stage::ALL
            .iter()
            .filter(|&&s| s < stage)
            .map(|&s| self.steps.of(s))
            .sum();
        let mut smooth = None;
        while self.position.step < steps {
            if self.stop.load(Ordering::Relaxed) {
                self.save()?;
                return Err(TrainError::Stopped {
                    stage: stage.name(),
                    step: self.position.step,
                    checkpoint: self.checkpoint.map(Path::to_owned),
                });
            }
            let step = self.position.step;
            let rates = self.rates(stage, step);
            let loss = match stage {
                Stage::Encoder => {
                    let factor = schedule::factor(step, steps);
                    let rates = [factor * self.ground.config.encoder_rate, rates.synthesizer];
                    self.model.encoder_step(&self.ground, engine, step, rates)?
                }
                Stage::Refine | Stage::Integer => {
                    self.model.step(&self.ground, engine, stage, step, rates)
                }
            };
            if !loss.is_finite() {
                return Err(TrainError::Diverged {
                    stage: stage.name(),
                    step,
                    loss,
                });
            }
            let loss = smooth.map_or(loss, |old: f64| old + SMOOTHING * (loss - old));
            smooth = Some(loss);
            let step = step + 1;
            self.position.step = step;
            if step.is_multiple_of(OBSERVED) || step == steps {
                (self.observer)(&Progress {
                    stage,
                    step,
                    stage_steps: steps,
                    done: before + step,
                    total: self.steps.total(),
                    loss,
                    psnr: decibels(loss),
                });
            }
            if step.is_multiple_of(self.ground.config.checkpoint_every) {
                self.save()?;
            }
        }
        Ok(())
    }

    fn rates(&self, stage: Stage, step: u64) -> Rates {
        let config = self.ground.config;
        let factor = match stage {
            Stage::Encoder | Stage::Refine => schedule::factor(step, self.steps.of(stage)),
            Stage::Integer => config.integer_rate * schedule::factor(step, self.steps.integer),
        };
        Rates {
            latents: factor * config.latent_rate,
            synthesizer: factor * config.synthesizer_rate,
        }
    }

    fn save(&self) -> Result<(), TrainError> {
        match self.checkpoint {
            Some(path) => checkpoint::write(path, self.identity, self.position, &self.model),
            None => Ok(()),
        }
    }

    fn finish(mut self) -> Result<Trained, TrainError> {
        let errors = self.model.evaluate(&self.ground, Numbers::Integer);
        let Run {
            ground,
            model,
            position,
            steps,
            stages,
            ..
        } = self;
        let psnr_quantised = decibels(errors.overall());
        let quantised = model.quantised(&ground);
        let widths = Widths::of(ground.config);
        let layers = export::layers(&quantised.network, &model.ranges, widths)?;
        let codes = [model.latents[0].codes(), model.latents[1].codes()];
        let batch = schedule::batch(ground.config, ground.texels.count());
        let record = record(
            ground.config,
            &steps,
            batch,
            position.psnr_float,
            psnr_quantised,
        );
        let asset = export::asset(ground.config, ground.source, layers, codes, record)?;
        let (width, height) = ground.texels.sizes[0];
        let texels = f64::from(width) * f64::from(height);
        let bits = (asset.grid_bits() + asset.parameter_bits()) as f64;
        let report = TrainReport {
            psnr_float: position.psnr_float,
            psnr_quantised,
            psnr_channels: (0..ground.texels.channels)
                .map(|c| decibels(errors.channel(c)))
                .collect(),
            psnr_mips: (0..ground.texels.sizes.len())
                .map(|m| decibels(errors.mip(m)))
                .collect(),
            bits_per_texel_channel: bits / (texels * ground.texels.channels as f64),
            macs: ground.topology.macs(),
            steps,
            seed: ground.config.seed,
            stages,
            config: ground.config.clone(),
        };
        Ok(Trained { asset, report })
    }
}

/// The training record of the asset: what made it, nothing that differs between two equal runs.
fn record(
    config: &TrainConfig,
    steps: &Steps,
    batch: usize,
    psnr_float: f64,
    psnr_quantised: f64,
) -> Vec<(String, String)> {
    let grids = config
        .grids
        .map(|g| format!("{}ch@{}bit/{}", g.channels, g.bits, 1 << g.scale_log2));
    let entries = [
        ("trainer", env!("CARGO_PKG_VERSION").to_owned()),
        ("grids", grids.join(" ")),
        ("hidden", format!("{:?}", config.hidden)),
        (
            "blocks",
            format!("{}x{}", config.residual_blocks, config.layers_per_block),
        ),
        ("effort", config.effort.to_string()),
        (
            "steps",
            format!("{}+{}+{}", steps.encoder, steps.refine, steps.integer),
        ),
        ("batch", batch.to_string()),
        ("seed", config.seed.to_string()),
        ("psnr_float", format!("{psnr_float:.3}")),
        ("psnr_quantised", format!("{psnr_quantised:.3}")),
    ];
    entries.map(|(key, value)| (key.to_owned(), value)).to_vec()
}
