//! Budget: as many steps as fit a time.
//!
//! The steps of a stage are fixed before its first, so that its learning rates are those of a plan
//! with as many: a run that a time has fixed can be repeated without a clock. What a machine's load
//! makes of the prediction shows when a stage is done; the stages after it are fitted anew.

use crate::device::TrainingDevice;
use crate::error::TrainError;
use crate::model::{Ground, Model};
use crate::plan::Train;
use crate::run::asset_of;
use crate::sampler::Numbers;
use crate::schedule;
use crate::settle::Settling;
use crate::stage::Stage;
use crate::stepper::Stepper;
use std::time::Instant;

/// The share of the time that goes to measuring how long a step of a stage takes, over all stages;
/// twice that where the batch changes.
const MEASURING: f64 = 0.04;

/// The most seconds that one stage is measured for.
const MOST: f64 = 10.0;

/// How far a later fit may change the steps of a stage, either way.
const CHANGE: f64 = 4.0;

/// Steps before the clock starts: the first ones warm caches and pages, or compile kernels.
const WARM_UP: u64 = 2;

/// The most steps between two looks at the clock on a device, which has to finish them for that.
const AT_ONCE: u64 = 16;

/// The share of the time in which latents settle.
const SETTLING: f64 = 0.1;

/// Decodes of the whole set that a round of settling costs: eight, each with the comparison of all
/// errors.
const DECODES: f64 = 12.0;

/// What is kept back for what was not foreseen.
const KEPT: f64 = 0.02;

/// What a run of a given time knows of its stages.
#[derive(Clone, Debug)]
pub(crate) struct Budget {
    /// Seconds that the run may take.
    seconds: f64,
    /// Seconds of a step of each stage, as measured before the first.
    costs: Vec<f64>,
    /// Seconds that settling, and looking at the whole set, take when the steps are over.
    ending: f64,
    /// The most rounds in which latents settle.
    pub(crate) rounds: u32,
}

impl Budget {
    /// Measures every stage, and scales the steps of all by one factor, so that the run ends
    /// `seconds` after `started`, evaluation included. A stage of any steps keeps at least one.
    ///
    /// Where the plan follows from an effort, a short time gets smaller batches, and the stages are
    /// measured again with them.
    pub(crate) fn fit(
        ground: &Ground<'_>,
        model: &Model,
        stages: &mut [Stage],
        device: &TrainingDevice,
        (seconds, started): (f64, Instant),
    ) -> Result<Budget, TrainError> {
        let mut scratch = model.clone();
        let evaluation = Instant::now();
        scratch.evaluate(ground, Numbers::Real);
        // In reals, and in the numbers of the decode.
        let ending = 2.0 * evaluation.elapsed().as_secs_f64();
        let mut budget = Budget {
            seconds,
            costs: Vec::new(),
            ending,
            rounds: ground.config.settle.unwrap_or(0),
        };
        let mut factor = budget.measure(ground, &mut scratch, stages, device, started)?;
        if schedule::follows_effort(ground.config) {
            let drawn = |stage: &Stage| stage.steps as f64 * stage.batch as f64;
            let texels: f64 = stages.iter().map(drawn).sum();
            let batch = schedule::batch_of_run((factor.max(0.0) * texels) as u64);
            if stages.iter().any(|stage| stage.batch > batch) {
                for stage in stages.iter_mut().filter(|stage| stage.batch > batch) {
                    stage.steps = (drawn(stage) / batch as f64).round() as u64;
                    stage.batch = batch;
                }
                factor = budget.measure(ground, &mut scratch, stages, device, started)?;
            }
        }
        let settling = budget.fit_rounds(ground, &mut scratch)?;
        budget.ending += settling;
        factor -= settling / budget.cost(stages, 0);
        budget.scale(stages, 0, factor);
        Ok(budget)
    }

    /// Fixes the rounds in which latents settle, where the configuration does not; the seconds that
    /// they will take.
    fn fit_rounds(&mut self, ground: &Ground<'_>, scratch: &mut Model) -> Result<f64, TrainError> {
        let config = ground.config;
        if config.settle.is_none() && !schedule::follows_effort(config) {
            return Ok(0.0);
        }
        if scratch.ranges.is_empty() {
            scratch.deploy(ground);
        }
        let asset = asset_of(scratch, ground, Vec::new())?;
        let clock = Instant::now();
        Settling::new(asset, &ground.texels, &ground.positions)?;
        let decode = clock.elapsed().as_secs_f64();
        // The way back takes twice the way forward, of which the ending has two.
        let round = DECODES * decode + 1.5 * self.ending;
        let fitting = (SETTLING * self.seconds / round) as u32;
        self.rounds = config.settle.unwrap_or(fitting.min(schedule::MOST_ROUNDS));
        Ok(f64::from(self.rounds) * round)
    }

    /// Measures a step of every stage; the factor by which the steps then fit the time left.
    fn measure(
        &mut self,
        ground: &Ground<'_>,
        scratch: &mut Model,
        stages: &[Stage],
        device: &TrainingDevice,
        started: Instant,
    ) -> Result<f64, TrainError> {
        // What happens once between stages: the encoding of the set, the ranges of the registers.
        let mut between = 0.0;
        let running = stages.iter().filter(|s| s.steps > 0).count().max(1);
        let share = (MEASURING * self.seconds / running as f64).min(MOST);
        self.costs.clear();
        for stage in stages {
            if stage.steps == 0 {
                self.costs.push(0.0);
                continue;
            }
            let preparing = Instant::now();
            if stage.train == Train::Encoder {
                scratch.encode_whole(ground)?;
            }
            if scratch.ranges.is_empty() && stage.is_deployed() {
                scratch.deploy(ground);
            }
            between += preparing.elapsed().as_secs_f64();
            let cost = seconds_of_step(ground, scratch, stage, device, share)?;
            self.costs.push(cost);
        }
        let left = self.left(started.elapsed().as_secs_f64()) - between;
        Ok(left / self.cost(stages, 0))
    }

    /// Fits the stages from `next` on again, after `spent` seconds, now that the stage before is
    /// known to have taken `taken` seconds. One that took less than expected leaves its time to them,
    /// but does not make them faster: too long a run is worse than too short a one.
    pub(crate) fn refit(&self, stages: &mut [Stage], next: usize, spent: f64, taken: f64) {
        let Some(before) = next.checked_sub(1) else {
            return;
        };
        let expected = self.costs[before] * stages[before].steps as f64;
        let slower = if expected > 0.0 {
            (taken / expected).max(1.0)
        } else {
            1.0
        };
        let factor = self.left(spent) / (slower * self.cost(stages, next));
        self.scale(stages, next, factor.clamp(1.0 / CHANGE, CHANGE));
    }

    /// Seconds left for steps.
    fn left(&self, spent: f64) -> f64 {
        self.seconds * (1.0 - KEPT) - self.ending - spent
    }

    /// Seconds that the stages from `first` on are expected to take.
    fn cost(&self, stages: &[Stage], first: usize) -> f64 {
        let costs = stages.iter().zip(&self.costs).skip(first);
        costs.map(|(stage, cost)| stage.steps as f64 * cost).sum()
    }

    fn scale(&self, stages: &mut [Stage], first: usize, factor: f64) {
        for stage in stages.iter_mut().skip(first).filter(|s| s.steps > 0) {
            stage.steps = ((stage.steps as f64 * factor.max(0.0)).round() as u64).max(1);
        }
    }
}

/// How long a step takes, from as many as fit `share` seconds.
fn seconds_of_step(
    ground: &Ground<'_>,
    model: &mut Model,
    stage: &Stage,
    device: &TrainingDevice,
    share: f64,
) -> Result<f64, TrainError> {
    let mut stepper = Stepper::new(ground, model, stage, device);
    let mut clock = Instant::now();
    let (mut step, mut counted) = (0, 0_u64);
    loop {
        let rates = stage.rates_at(step.min(stage.steps - 1));
        stepper.step(ground, model, stage, step, rates)?;
        (step, counted) = (step + 1, counted + 1);
        if step == WARM_UP {
            stepper.losses()?;
            // What a kernel costs to compile is paid once; a step that alone fills the share is the
            // measurement.
            if stepper.is_remote() || clock.elapsed().as_secs_f64() < share {
                (clock, counted) = (Instant::now(), 0);
                continue;
            }
        }
        if stepper.is_remote() && !counted.is_power_of_two() && !counted.is_multiple_of(AT_ONCE) {
            continue;
        }
        stepper.losses()?;
        let spent = clock.elapsed().as_secs_f64();
        if spent >= share {
            return Ok(spent / counted as f64);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::TrainConfig;

    fn stages(steps: [u64; 3]) -> Vec<Stage> {
        let config = TrainConfig {
            plan: Some(TrainConfig::default().usual_plan(steps)),
            ..TrainConfig::default()
        };
        config.stages(&[(64, 64)]).unwrap()
    }

    #[test]
    fn what_a_stage_took_too_long_is_taken_from_those_after_it_and_not_from_itself() {
        let budget = Budget {
            seconds: 100.0,
            costs: vec![0.0, 0.01, 0.02],
            ending: 3.0,
            rounds: 0,
        };
        // 60 s expected and 30 after it. Twice as slow, 30 would take 60 where only 95 − 65 are
        // left.
        let mut late = stages([0, 6000, 1500]);
        budget.refit(&mut late, 2, 65.0, 120.0);
        let steps: Vec<u64> = late.iter().map(|s| s.steps).collect();
        assert_eq!(steps, [0, 6000, 750]);
        // Nothing is left: a quarter of the steps all the same.
        let mut gone = stages([0, 6000, 1500]);
        budget.refit(&mut gone, 2, 200.0, 60.0);
        assert_eq!(gone[2].steps, 375);
        let mut early = stages([0, 6000, 1500]);
        budget.refit(&mut early, 2, 35.0, 30.0);
        assert_eq!(early[2].steps, 3000);
        let mut on_time = stages([0, 6000, 1500]);
        budget.refit(&mut on_time, 2, 65.0, 60.0);
        assert_eq!(on_time[2].steps, 1500);
    }
}
