//! Stage: one stage of a plan with nothing left to decide.

use crate::choices::Optimiser;
use crate::config::TrainConfig;
use crate::error::TrainError;
use crate::plan::{Arithmetic, Fall, Mips, Plan, Shown, StagePlan, Train};
use crate::schedule;
use serde::{Deserialize, Serialize};

/// Learning rates.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Rates {
    /// Of the encoder and its constructors.
    pub encoder: f64,
    /// Of the latents, whose reals are −½..=½.
    pub latents: f64,
    /// Of the synthesizer.
    pub synthesizer: f64,
}

/// One stage of a plan with nothing left to decide. The fields are those of [`StagePlan`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Stage {
    /// Its place in the plan, from 0; stages that were left out count.
    pub index: u32,
    /// What is trained.
    pub train: Train,
    /// Its steps.
    pub steps: u64,
    /// What the synthesizer sees of the latents.
    pub latents: Shown,
    /// The numbers in which the synthesizer computes.
    pub numbers: Arithmetic,
    /// The learning rates at a factor of 1.
    pub rates: Rates,
    /// Whether that of the latents rises in a short stage, see [`TrainConfig::latent_rate`].
    pub hastens: bool,
    /// Whether that of the synthesizer falls with the stage's length, see
    /// [`TrainConfig::synthesizer_rate`].
    pub eases: bool,
    /// What moves the synthesizer's parameters.
    pub optimiser: Optimiser,
    /// All of them times this.
    pub rate_factor: f64,
    /// How they go on.
    pub fall: Fall,
    /// The part of the fall that the stage covers.
    pub part: [f64; 2],
    /// Steps over which they rise.
    pub warm_up: u64,
    /// Side of a crop.
    pub crop: u32,
    /// Crops in a step.
    pub crops: u16,
    /// Texels in a step.
    pub batch: usize,
    /// Which mips a crop trains.
    pub mips: Mips,
    /// The share of texels whose mip is drawn uniformly.
    pub uniform_mips: f64,
}

impl Stage {
    /// The name in progress lines, errors and records.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match (self.train, self.numbers) {
            (Train::Encoder, Arithmetic::Real) => "encoder",
            (Train::Encoder, Arithmetic::Deployed) => "deployed encoder",
            (Train::Latents, Arithmetic::Real) => "latents",
            (Train::Latents, Arithmetic::Deployed) => "deployed",
            (Train::Synthesizer, Arithmetic::Real) => "synthesizer",
            (Train::Synthesizer, Arithmetic::Deployed) => "deployed synthesizer",
        }
    }

    /// The learning rates at step `step`, from 0.
    #[must_use]
    pub fn rates_at(&self, step: u64) -> Rates {
        let rise = schedule::rise(self.warm_up, step, self.steps);
        let factor = self.rate_factor * rise * self.fallen(step);
        Rates {
            encoder: factor * self.rates.encoder,
            latents: factor * self.of_length(self.hastens, schedule::haste) * self.rates.latents,
            synthesizer: factor
                * self.of_length(self.eases, schedule::ease)
                * self.rates.synthesizer,
        }
    }

    /// What the fall has left of a rate at step `step`.
    fn fallen(&self, step: u64) -> f64 {
        let [from, to] = self.part;
        match self.fall {
            Fall::Constant => 1.0,
            Fall::Cosine => {
                let at = step as f64 / self.steps.max(1) as f64;
                schedule::fall(from + (to - from) * at)
            }
        }
    }

    /// What a rate is multiplied with because of the length of the fall, where it is.
    fn of_length(&self, follows: bool, rule: impl Fn(f64) -> f64) -> f64 {
        let [from, to] = self.part;
        if follows {
            rule(self.steps as f64 / (to - from))
        } else {
            1.0
        }
    }

    /// The number of a step's random streams: no two stages share one.
    pub(crate) const fn stream(&self, step: u64) -> u64 {
        ((self.index as u64) << 48) | step
    }

    pub(crate) fn is_deployed(&self) -> bool {
        self.numbers == Arithmetic::Deployed
    }
}

impl TrainConfig {
    /// The plan of a run on a set whose mips have these sizes (width and height, mip 0 first): the
    /// configuration's own, or the one that follows from its effort.
    #[must_use]
    pub fn plan_for(&self, sizes: &[(u32, u32)]) -> Plan {
        match &self.plan {
            Some(plan) => plan.clone(),
            None => schedule::plan(self, texels(sizes), schedule::batch(self, texels(sizes))),
        }
    }

    /// The stages of that plan.
    ///
    /// # Errors
    /// When the plan has a field out of range or no stage is left for a set of this size.
    pub fn stages(&self, sizes: &[(u32, u32)]) -> Result<Vec<Stage>, TrainError> {
        let plan = self.plan_for(sizes);
        let batch = schedule::batch(self, texels(sizes));
        plan.check()?;
        let side = sizes.first().map_or(0, |&(w, h)| w.max(h));
        let stages = resolve(self, &plan, side, batch);
        if stages.is_empty() {
            return Err(TrainError::config(
                "plan",
                format!("no stage for a set of {side} texels a side"),
                "a stage whose least_side is no more",
            ));
        }
        Ok(stages)
    }
}

fn texels(sizes: &[(u32, u32)]) -> u64 {
    sizes
        .iter()
        .map(|&(w, h)| u64::from(w) * u64::from(h))
        .sum()
}

fn resolve(config: &TrainConfig, plan: &Plan, side: u32, batch: usize) -> Vec<Stage> {
    let mut crop = config.crop;
    let kept = plan
        .stage
        .iter()
        .enumerate()
        .filter(|(_, stage)| side >= stage.least_side);
    kept.map(|(index, stage)| {
        crop = stage.crop.unwrap_or(crop);
        one(config, index as u32, stage, crop, batch)
    })
    .collect()
}

fn one(config: &TrainConfig, index: u32, stage: &StagePlan, crop: u32, batch: usize) -> Stage {
    Stage {
        index,
        train: stage.train,
        steps: stage.steps,
        latents: stage.latents,
        numbers: stage.numbers,
        rates: Rates {
            encoder: stage.rates.encoder.unwrap_or(config.encoder_rate),
            latents: stage.rates.latents.unwrap_or(config.latent_rate),
            synthesizer: stage
                .rates
                .synthesizer
                .unwrap_or(config.own_synthesizer_rate()),
        },
        hastens: stage.rates.latents.is_none(),
        eases: stage.rates.synthesizer.is_none() && config.is_deep(),
        optimiser: stage.optimiser.unwrap_or(config.optimiser),
        rate_factor: stage.rate_factor * config.rate_factor,
        fall: stage.fall,
        part: stage.part,
        warm_up: stage.warm_up,
        crop,
        crops: stage.crops.unwrap_or(config.crops),
        batch: stage.batch.map_or(batch, |texels| texels as usize),
        mips: stage.mips,
        uniform_mips: stage.uniform_mips.unwrap_or(config.uniform_mips),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::preset::Preset;

    fn sizes(side: u32) -> Vec<(u32, u32)> {
        (0..=side.ilog2()).map(|m| (side >> m, side >> m)).collect()
    }

    fn paper(side: u32) -> Vec<Stage> {
        let config = TrainConfig {
            plan: Some(Plan::by_name("paper").unwrap()),
            ..Preset::ALL[0].config()
        };
        config.stages(&sizes(side)).unwrap()
    }

    #[test]
    fn stages_in_parts_of_a_fall_take_the_rates_of_one_stage() {
        let config = Preset::ALL[0].config();
        let of = |plan: Plan| {
            let config = TrainConfig {
                plan: Some(plan),
                ..config.clone()
            };
            config.stages(&sizes(64)).unwrap()
        };
        let parts = of(config.usual_plan([0, 5000, 5000]));
        let whole = of(config.usual_plan([0, 10_000, 0]));
        let close = |a: f64, b: f64| (a - b).abs() <= 1e-9 * b;
        for (stage, step, at) in [
            (1, 200, 200),
            (1, 4999, 4999),
            (2, 100, 5100),
            (2, 4999, 9999),
        ] {
            let (found, one) = (parts[stage].rates_at(step), whole[1].rates_at(at));
            assert!(close(found.latents, one.latents), "{stage} {step}");
            assert!(close(found.synthesizer, one.synthesizer), "{stage} {step}");
        }
    }

    #[test]
    fn the_papers_plan_is_its_table_1() {
        let stages = paper(2048);
        let table: Vec<_> = stages
            .iter()
            .filter(|s| s.numbers == Arithmetic::Real)
            .map(|s| (s.crop, s.rates.encoder, s.steps, s.latents))
            .collect();
        assert_eq!(
            table,
            [
                (256, 10e-5, 160_000, Shown::Noise),
                (512, 5e-5, 80_000, Shown::Noise),
                (512, 1e-5, 20_000, Shown::Rounded),
            ]
        );
        for stage in stages.iter().filter(|s| s.numbers == Arithmetic::Real) {
            assert_eq!(stage.train, Train::Encoder);
            assert_eq!((stage.crops, stage.fall), (4, Fall::Constant));
            assert_eq!((stage.uniform_mips, stage.mips), (0.1, Mips::Inside));
            assert_eq!(stage.rates.synthesizer, stage.rates.encoder);
            assert_eq!(stage.warm_up, 0);
        }
        assert!(stages.last().unwrap().is_deployed());
    }

    /// The paper's rule: from 256 on the crop doubles, and rate and steps halve, until a crop holds
    /// a texel of the chain's last mip, which for the paper is 4 texels wide.
    #[test]
    fn at_every_size_the_papers_crop_doubles_until_its_chain_is_reachable() {
        for log2 in 6..=14_u32 {
            let side = 1_u32 << log2;
            let noise: Vec<_> = paper(side)
                .into_iter()
                .filter(|s| s.latents == Shown::Noise)
                .collect();
            let last_mip = log2 - 2;
            for (stage, table) in noise.iter().zip(0..) {
                assert_eq!(stage.crop, 256 << table);
                assert_eq!(stage.steps, 160_000 >> table);
                assert_eq!(stage.rates.encoder, 1e-4 / f64::from(1 << table));
                let deepest = stage.crop.ilog2();
                let is_last = table + 1 == noise.len() as u32;
                assert_eq!(deepest >= last_mip, is_last, "{side}: {stage:?}");
            }
            let rounded = paper(side)[noise.len()];
            assert_eq!(rounded.crop, noise.last().unwrap().crop, "{side}");
            assert_eq!((rounded.steps, rounded.rates.encoder), (20_000, 1e-5));
        }
    }

    #[test]
    fn the_short_plan_is_the_papers_with_fewer_steps() {
        let mut short = Plan::by_name("paper-short").unwrap();
        let paper = Plan::by_name("paper").unwrap();
        for (short, paper) in short.stage.iter_mut().zip(&paper.stage) {
            assert!(short.steps < paper.steps);
            short.steps = paper.steps;
        }
        assert_eq!(short.stage, paper.stage);
    }
}
