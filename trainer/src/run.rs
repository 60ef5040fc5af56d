//! The run: stage after stage, with checkpoints between steps.

use crate::budget::Budget;
use crate::checkpoint::{self, Position};
use crate::engine::Engine;
use crate::error::{Good, TrainError};
use crate::evaluate::decibels;
use crate::export;
use crate::model::{Ground, Model};
use crate::plan::Train;
use crate::quantise::Widths;
use crate::record;
use crate::report::{Progress, StageReport, TrainReport, Trained, Watch};
use crate::sampler::Numbers;
use crate::stage::Stage;
use ntmu_isa::Asset;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// Steps between two calls of the watcher.
const OBSERVED: u64 = 20;

/// How much of the smoothed loss a new one replaces.
const SMOOTHING: f64 = 0.02;

/// A run has diverged when the smoothed loss is this many times the least of the stage…
const DIVERGED: f64 = 16.0;
/// …and more than this, which is 20 dB: outputs are limited to their formats' ranges, so that the
/// loss of a network gone wrong stays finite.
const DIVERGED_FROM: f64 = 0.01;

/// A state whose smoothed loss is this many times the least is not written over a better one.
const DOUBTFUL: f64 = 4.0;

/// How much measuring the asset may cost beside a target: a measurement costs about as much as a
/// third of the steps that see as many texels, so this makes a tenth of the time.
const PASSES_BETWEEN: u64 = 3;

/// The fewest steps between two measurements.
const LEAST_BETWEEN: u64 = 100;

pub(crate) struct Run<'a> {
    ground: Ground<'a>,
    model: Model,
    stages: Vec<Stage>,
    position: Position,
    identity: u64,
    pub(crate) checkpoint: Option<&'a Path>,
    /// In the process that measured it.
    pub(crate) budget: Option<Budget>,
    /// What this process wrote last.
    good: Option<Good>,
    /// Whether the asset reached the target.
    reached: bool,
    reports: Vec<StageReport>,
    /// When this process began, less what earlier ones took.
    started: Instant,
    earlier: f64,
}

impl<'a> Run<'a> {
    pub(crate) fn new(
        ground: Ground<'a>,
        model: Model,
        stages: Vec<Stage>,
        position: Position,
        identity: u64,
    ) -> Run<'a> {
        Run {
            ground,
            model,
            stages,
            earlier: position.seconds,
            position,
            identity,
            checkpoint: None,
            budget: None,
            good: None,
            reached: false,
            reports: Vec::new(),
            started: Instant::now(),
        }
    }

    pub(crate) fn all_stages(
        &mut self,
        stop: &AtomicBool,
        watch: &mut dyn Watch,
    ) -> Result<(), TrainError> {
        let mut engine: Option<Engine> = None;
        for index in self.position.stage..self.stages.len() {
            self.refit(index);
            let stage = self.stages[index];
            let start = Instant::now();
            if index > self.position.stage {
                self.position.stage = index;
                self.position.step = 0;
            }
            if self.position.step == 0 {
                self.enter(&stage)?;
            }
            if engine
                .as_ref()
                .is_none_or(|e| e.batch.texels.len() != stage.batch)
            {
                let channels = self.ground.texels.channels;
                engine = Some(Engine::new(&self.ground.topology, stage.batch, channels));
            }
            if let Some(engine) = &mut engine {
                self.steps(&stage, engine, stop, watch)?;
            }
            if stage.train == Train::Encoder && stage.steps > 0 {
                self.model.encode_whole(&self.ground)?;
            }
            self.reports.push(StageReport {
                name: stage.name().to_owned(),
                stage,
                seconds: start.elapsed().as_secs_f64(),
            });
            if self.reached {
                break;
            }
        }
        if self.model.ranges.is_empty() {
            self.deploy();
        }
        Ok(())
    }

    /// Fits the stages from `index` on into what is left of the time.
    fn refit(&mut self, index: usize) {
        let (Some(budget), Some(last)) = (&self.budget, self.reports.last()) else {
            return;
        };
        let spent = self.earlier + self.started.elapsed().as_secs_f64();
        budget.refit(&mut self.stages, index, spent, last.seconds);
        self.position.steps = self.stages.iter().map(|s| s.steps).collect();
    }

    /// What happens once, before the first step of a stage.
    fn enter(&mut self, stage: &Stage) -> Result<(), TrainError> {
        self.model.forget_moments();
        self.position.loss = f64::NAN;
        self.position.least = f64::NAN;
        let follows_reals = self.position.stage == 0
            || self
                .stages
                .get(self.position.stage - 1)
                .is_some_and(|before| !before.is_deployed());
        if stage.is_deployed() && follows_reals {
            if stage.train == Train::Encoder && stage.steps > 0 {
                self.model.encode_whole(&self.ground)?;
            }
            self.deploy();
        }
        Ok(())
    }

    /// From reals to the numbers of the decode.
    fn deploy(&mut self) {
        let errors = self.model.evaluate(&self.ground, Numbers::Real);
        self.position.psnr_float = decibels(errors.overall());
        self.model.calibrate(&self.ground);
    }

    fn steps(
        &mut self,
        stage: &Stage,
        engine: &mut Engine,
        stop: &AtomicBool,
        watch: &mut dyn Watch,
    ) -> Result<(), TrainError> {
        while self.position.step < stage.steps {
            if stop.load(Ordering::Relaxed) {
                self.save()?;
                return Err(TrainError::Stopped {
                    stage: stage.name(),
                    step: self.position.step,
                    checkpoint: self.checkpoint.map(Path::to_owned),
                });
            }
            let step = self.position.step;
            let rates = stage.rates_at(step);
            let (ground, model) = (&self.ground, &mut self.model);
            let loss = match stage.train {
                Train::Encoder => model.encoder_step(ground, engine, stage, step, rates)?,
                Train::Latents | Train::Synthesizer => {
                    model.step(ground, engine, stage, step, rates)
                }
            };
            self.smooth(stage, loss)?;
            self.position.step = step + 1;
            self.position.seconds = self.earlier + self.started.elapsed().as_secs_f64();
            self.after(stage, watch)?;
            if self.reached {
                break;
            }
        }
        Ok(())
    }

    /// Takes a step's loss into the smoothed one, and refuses one that has run away.
    fn smooth(&mut self, stage: &Stage, loss: f64) -> Result<(), TrainError> {
        let Position {
            loss: old, least, ..
        } = &mut self.position;
        let smooth = if old.is_nan() {
            loss
        } else {
            *old + SMOOTHING * (loss - *old)
        };
        if !loss.is_finite() || (smooth > DIVERGED_FROM && smooth > DIVERGED * *least) {
            return Err(self.diverged(stage, loss));
        }
        *old = smooth;
        // Not a number before the first step.
        *least = least.min(smooth);
        Ok(())
    }

    fn diverged(&self, stage: &Stage, loss: f64) -> TrainError {
        TrainError::Diverged {
            stage: stage.name(),
            step: self.position.step,
            loss,
            good: self.good.clone(),
        }
    }

    /// What follows a step: measurements, words, a checkpoint.
    fn after(&mut self, stage: &Stage, watch: &mut dyn Watch) -> Result<(), TrainError> {
        let step = self.position.step;
        let is_last = step == stage.steps;
        let deployed_psnr = self.measured(stage)?;
        if step.is_multiple_of(OBSERVED) || is_last || deployed_psnr.is_some() {
            let progress = self.progress(stage, deployed_psnr);
            watch.observe(&progress);
            if watch.wants_asset() {
                let asset = self.asset_now(stage)?;
                watch.asset(&progress, &asset);
            }
        }
        let is_sound = self.position.loss <= DOUBTFUL * self.position.least;
        if step.is_multiple_of(self.ground.config.checkpoint_every) && is_sound && !self.reached {
            if self.checkpoint.is_some() && !checkpoint::is_finite(&self.model) {
                return Err(self.diverged(stage, f64::NAN));
            }
            self.save()?;
        }
        Ok(())
    }

    fn progress(&self, stage: &Stage, deployed_psnr: Option<f64>) -> Progress {
        let before = &self.stages[..self.position.stage];
        let Position { step, loss, .. } = self.position;
        Progress {
            stage: *stage,
            step,
            stage_steps: stage.steps,
            done: before.iter().map(|s| s.steps).sum::<u64>() + step,
            total: self.stages.iter().map(|s| s.steps).sum(),
            loss,
            psnr: decibels(loss),
            deployed_psnr,
            rates: stage.rates_at(step - 1),
            seconds: self.position.seconds,
        }
    }

    /// The asset's quality, where there is a target and it is time to measure.
    fn measured(&mut self, stage: &Stage) -> Result<Option<f64>, TrainError> {
        let Some(target) = self.ground.config.target_psnr else {
            return Ok(None);
        };
        let passes = PASSES_BETWEEN * self.ground.texels.count() / stage.batch as u64;
        let step = self.position.step;
        if !step.is_multiple_of(passes.max(LEAST_BETWEEN)) && step != stage.steps {
            return Ok(None);
        }
        let psnr = self.as_deployed(stage, |model, ground| {
            decibels(model.evaluate(ground, Numbers::Integer).overall())
        })?;
        self.reached = psnr >= target;
        Ok(Some(psnr))
    }

    /// The asset as it would be if the run ended here.
    fn asset_now(&mut self, stage: &Stage) -> Result<Asset, TrainError> {
        self.as_deployed(stage, |model, ground| {
            let record = vec![("state".to_owned(), "unfinished".to_owned())];
            asset_of(model, ground, record)
        })?
    }

    /// What `look` sees of the model in the numbers of the decode; the run goes on as if nothing had
    /// happened.
    fn as_deployed<T>(
        &mut self,
        stage: &Stage,
        look: impl FnOnce(&mut Model, &Ground<'_>) -> T,
    ) -> Result<T, TrainError> {
        if stage.train == Train::Encoder {
            self.model.encode_whole(&self.ground)?;
        }
        let ranges = self.model.ranges.clone();
        if !stage.is_deployed() {
            self.model.calibrate(&self.ground);
        }
        let seen = look(&mut self.model, &self.ground);
        self.model.ranges = ranges;
        Ok(seen)
    }

    fn save(&mut self) -> Result<(), TrainError> {
        let Some(path) = self.checkpoint else {
            return Ok(());
        };
        checkpoint::write(path, self.identity, &self.position, &self.model)?;
        self.good = Some(Good {
            path: path.to_owned(),
            stage: self.stages[self.position.stage].name(),
            step: self.position.step,
        });
        Ok(())
    }

    pub(crate) fn finish(mut self) -> Result<Trained, TrainError> {
        let errors = self.model.evaluate(&self.ground, Numbers::Integer);
        let Run {
            ground,
            model,
            stages,
            position,
            reports,
            ..
        } = self;
        let psnr_quantised = decibels(errors.overall());
        let psnrs = [position.psnr_float, psnr_quantised];
        let record = record::of(ground.config, &stages, psnrs);
        let asset = asset_of(&model, &ground, record)?;
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
            steps: record::steps(ground.config, &stages),
            reached: ground
                .config
                .target_psnr
                .map(|target| psnr_quantised >= target),
            seed: ground.config.seed,
            stages: reports,
            config: ground.config.clone(),
        };
        Ok(Trained { asset, report })
    }
}

fn asset_of(
    model: &Model,
    ground: &Ground<'_>,
    record: Vec<(String, String)>,
) -> Result<Asset, TrainError> {
    let quantised = model.quantised(ground);
    let widths = Widths::of(ground.config);
    let layers = export::layers(&quantised.network, &model.ranges, widths)?;
    let codes = [model.latents[0].codes(), model.latents[1].codes()];
    export::asset(ground.config, ground.source, layers, codes, record)
}
