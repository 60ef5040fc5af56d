//! The run: stage after stage, with checkpoints between steps.

use crate::budget::Budget;
use crate::checkpoint::{self, Extent, Position};
use crate::device::TrainingDevice;
use crate::error::{Good, TrainError};
use crate::evaluate::decibels;
use crate::export;
use crate::model::{Ground, Model};
use crate::plan::Train;
use crate::record;
use crate::report::{Progress, StageReport, TrainReport, Trained, Watch};
use crate::sampler::Numbers;
use crate::schedule;
use crate::settle::{self, Round, Settling};
use crate::stage::Stage;
use crate::stepper::Stepper;
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
    device: &'a TrainingDevice,
    /// Within a stage.
    stepper: Option<Stepper>,
    position: Position,
    identity: u64,
    pub(crate) checkpoint: Option<&'a Path>,
    /// In the process that measured it.
    pub(crate) budget: Option<Budget>,
    /// The last checkpoint.
    good: Option<Good>,
    /// Whether the asset reached the target.
    reached: bool,
    reports: Vec<StageReport>,
    /// When this process began, and what earlier ones took, in seconds.
    started: Instant,
    earlier: f64,
}

impl<'a> Run<'a> {
    pub(crate) fn new(
        ground: Ground<'a>,
        model: Model,
        stages: Vec<Stage>,
        device: &'a TrainingDevice,
        (position, identity): (Position, u64),
        started: Instant,
    ) -> Run<'a> {
        Run {
            ground,
            model,
            stages,
            device,
            stepper: None,
            earlier: position.seconds,
            position,
            identity,
            checkpoint: None,
            budget: None,
            good: None,
            reached: false,
            reports: Vec::new(),
            started,
        }
    }

    pub(crate) fn all_stages(
        &mut self,
        stop: &AtomicBool,
        watch: &mut dyn Watch,
    ) -> Result<(), TrainError> {
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
            let stepper = Stepper::new(&self.ground, &self.model, &stage, self.device);
            self.stepper = Some(stepper);
            self.steps(&stage, stop, watch)?;
            self.bring_back()?;
            self.stepper = None;
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
            self.model.deploy(&self.ground);
        }
        Ok(())
    }

    /// Notes the checkpoint that the run goes on from.
    pub(crate) fn resumed_from(&mut self, path: &Path) {
        self.good = Some(self.good_at(path));
    }

    /// The present position, kept in a file.
    fn good_at(&self, path: &Path) -> Good {
        Good {
            path: path.to_owned(),
            stage: self.stages[self.position.stage].name(),
            step: self.position.step,
        }
    }

    /// Seconds since the run began.
    fn seconds(&self) -> f64 {
        self.earlier + self.started.elapsed().as_secs_f64()
    }

    /// Fits the stages from `index` on into what is left of the time.
    fn refit(&mut self, index: usize) {
        let (Some(budget), Some(last)) = (&self.budget, self.reports.last()) else {
            return;
        };
        let spent = self.seconds();
        budget.refit(&mut self.stages, index, spent, last.seconds);
        self.position.extents = Extent::of(&self.stages);
    }

    /// What happens once, before the first step of a stage.
    fn enter(&mut self, stage: &Stage) -> Result<(), TrainError> {
        self.model.forget_moments();
        self.position.loss = f64::NAN;
        self.position.least = f64::NAN;
        // Once: a run that was interrupted before the stage's first step comes here again.
        if stage.is_deployed() && self.model.ranges.is_empty() {
            if stage.train == Train::Encoder && stage.steps > 0 {
                self.model.encode_whole(&self.ground)?;
            }
            self.model.deploy(&self.ground);
        }
        Ok(())
    }

    fn steps(
        &mut self,
        stage: &Stage,
        stop: &AtomicBool,
        watch: &mut dyn Watch,
    ) -> Result<(), TrainError> {
        while self.position.step < stage.steps {
            if stop.load(Ordering::Relaxed) {
                self.read_losses(stage)?;
                if let Some(path) = self.checkpoint {
                    self.bring_back()?;
                    self.save(path)?;
                }
                return Err(TrainError::Stopped {
                    stage: stage.name(),
                    step: self.position.step,
                    checkpoint: self.checkpoint.map(Path::to_owned),
                });
            }
            let step = self.position.step;
            let rates = stage.rates_at(step);
            if let Some(stepper) = &mut self.stepper {
                stepper.step(&self.ground, &mut self.model, stage, step, rates)?;
            }
            self.position.step = step + 1;
            self.position.seconds = self.seconds();
            if self.needs_losses(stage) {
                self.read_losses(stage)?;
            }
            self.after(stage, watch)?;
            if self.reached {
                break;
            }
        }
        Ok(())
    }

    /// Whether the losses must be known after the step just taken. Reading them from a device waits
    /// for it.
    fn needs_losses(&self, stage: &Stage) -> bool {
        let step = self.position.step;
        !self.stepper.as_ref().is_some_and(Stepper::is_remote)
            || self.is_observed(stage)
            || self.is_measured(stage)
            || step.is_multiple_of(self.ground.config.checkpoint_every)
    }

    /// Smooths the losses that were not read so far, of all steps up to the last.
    fn read_losses(&mut self, stage: &Stage) -> Result<(), TrainError> {
        let Some(stepper) = &mut self.stepper else {
            return Ok(());
        };
        let losses = stepper.losses()?;
        let first = self.position.step - losses.len() as u64;
        for (step, loss) in (first..).zip(losses) {
            self.smooth(stage, step, loss)?;
        }
        Ok(())
    }

    /// Brings what a device has changed back to the model.
    fn bring_back(&mut self) -> Result<(), TrainError> {
        match &self.stepper {
            Some(stepper) => stepper.write_to(&mut self.model),
            None => Ok(()),
        }
    }

    /// Takes a step's loss into the smoothed one, and refuses one that has run away.
    fn smooth(&mut self, stage: &Stage, step: u64, loss: f64) -> Result<(), TrainError> {
        let Position {
            loss: old, least, ..
        } = &mut self.position;
        let smooth = if old.is_nan() {
            loss
        } else {
            *old + SMOOTHING * (loss - *old)
        };
        if !loss.is_finite() || (smooth > DIVERGED_FROM && smooth > DIVERGED * *least) {
            return Err(self.diverged(stage, step, loss));
        }
        *old = smooth;
        // Not a number before the first step.
        *least = least.min(smooth);
        Ok(())
    }

    fn diverged(&self, stage: &Stage, step: u64, loss: f64) -> TrainError {
        TrainError::Diverged {
            stage: stage.name(),
            step,
            loss,
            good: self.good.clone(),
        }
    }

    /// What follows a step: measurements, words, a checkpoint.
    fn after(&mut self, stage: &Stage, watch: &mut dyn Watch) -> Result<(), TrainError> {
        let step = self.position.step;
        let deployed_psnr = self.measured(stage)?;
        if self.is_observed(stage) || deployed_psnr.is_some() {
            let progress = self.progress(stage, deployed_psnr);
            watch.observe(&progress);
            if watch.wants_asset() {
                let asset = self.asset_now(stage)?;
                watch.asset(&progress, &asset);
            }
        }
        let is_sound = self.position.loss <= DOUBTFUL * self.position.least;
        let saves = step.is_multiple_of(self.ground.config.checkpoint_every) && is_sound;
        if let Some(path) = self.checkpoint.filter(|_| saves && !self.reached) {
            self.bring_back()?;
            if !checkpoint::is_finite(&self.model) {
                return Err(self.diverged(stage, step, f64::NAN));
            }
            self.save(path)?;
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

    fn is_observed(&self, stage: &Stage) -> bool {
        let step = self.position.step;
        step.is_multiple_of(OBSERVED) || step == stage.steps
    }

    /// Whether there is a target and it is time to measure.
    fn is_measured(&self, stage: &Stage) -> bool {
        let passes = PASSES_BETWEEN * self.ground.texels.count() / stage.batch as u64;
        let step = self.position.step;
        self.ground.config.target_psnr.is_some()
            && (step.is_multiple_of(passes.max(LEAST_BETWEEN)) || step == stage.steps)
    }

    /// The asset's quality, where there is a target and it is time to measure.
    fn measured(&mut self, stage: &Stage) -> Result<Option<f64>, TrainError> {
        let Some(target) = self.ground.config.target_psnr else {
            return Ok(None);
        };
        if !self.is_measured(stage) {
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
        self.bring_back()?;
        if stage.train == Train::Encoder {
            self.model.encode_whole(&self.ground)?;
        }
        if stage.is_deployed() {
            return Ok(look(&mut self.model, &self.ground));
        }
        let (parameters, ranges) = (self.model.parameters.clone(), self.model.ranges.clone());
        self.model.deploy(&self.ground);
        let seen = look(&mut self.model, &self.ground);
        self.model.parameters = parameters;
        self.model.ranges = ranges;
        Ok(seen)
    }

    fn save(&mut self, path: &Path) -> Result<(), TrainError> {
        checkpoint::write(path, self.identity, &self.position, &self.model)?;
        self.good = Some(self.good_at(path));
        Ok(())
    }

    /// Lets the latents settle, unless the asset was wanted as soon as it reached its target.
    fn settle(
        &mut self,
        stop: &AtomicBool,
        watch: &mut dyn Watch,
    ) -> Result<Vec<Round>, TrainError> {
        if self.reached || self.position.rounds == 0 {
            return Ok(Vec::new());
        }
        let Ground {
            texels, positions, ..
        } = &self.ground;
        let asset = asset_of(&self.model, &self.ground, Vec::new())?;
        let mut settling = Settling::new(asset, texels, positions)?;
        let least = schedule::least_gain(self.ground.config);
        let most = self.position.rounds;
        let rounds = settling.rounds(most, least, stop, &mut |r| watch.settled(r));
        if let (Err(TrainError::Stopped { step, .. }), Some(path)) = (&rounds, self.checkpoint) {
            let step = *step;
            self.save(path)?;
            return Err(TrainError::Stopped {
                stage: settle::STAGE,
                step,
                checkpoint: Some(path.to_owned()),
            });
        }
        let grids = &settling.asset.grids;
        for (latents, codes) in self.model.latents.iter_mut().zip(grids) {
            latents.take(codes);
        }
        rounds
    }

    pub(crate) fn finish(
        mut self,
        stop: &AtomicBool,
        watch: &mut dyn Watch,
    ) -> Result<Trained, TrainError> {
        let settled = self.settle(stop, watch)?;
        let psnr_float = decibels(self.model.evaluate(&self.ground, Numbers::Real).overall());
        let errors = self.model.evaluate(&self.ground, Numbers::Integer);
        let seconds = self.seconds();
        let Run {
            ground,
            model,
            stages,
            device,
            reports,
            ..
        } = self;
        let psnr_quantised = decibels(errors.overall());
        let psnrs = [psnr_float, psnr_quantised];
        let record = record::of(ground.config, &stages, settled.len(), device, psnrs);
        let asset = asset_of(&model, &ground, record)?;
        let (width, height) = ground.texels.sizes[0];
        let texels = f64::from(width) * f64::from(height);
        let bits = (asset.grid_bits() + asset.parameter_bits()) as f64;
        let report = TrainReport {
            psnr_float,
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
            settled,
            reached: ground
                .config
                .target_psnr
                .map(|target| psnr_quantised >= target),
            seed: ground.config.seed,
            backend: device.backend(),
            adapter: device.adapter().map(str::to_owned),
            seconds,
            stages: reports,
            config: ground.config.clone(),
        };
        Ok(Trained { asset, report })
    }
}

/// The asset that a model stands for.
pub(crate) fn asset_of(
    model: &Model,
    ground: &Ground<'_>,
    record: Vec<(String, String)>,
) -> Result<Asset, TrainError> {
    let quantised = model.quantised(ground);
    let layers = export::layers(&quantised.network, &model.ranges, ground.config)?;
    let codes = [model.latents[0].codes(), model.latents[1].codes()];
    export::asset(ground.config, ground.source, layers, codes, record)
}
