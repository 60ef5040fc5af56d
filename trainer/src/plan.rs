//! Plan: what a run trains, stage after stage, as its file says it.

use crate::choices::{FirstLatents, Optimiser};
use crate::error::TrainError;
use serde::{Deserialize, Serialize};

/// The parameters that a stage moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Train {
    /// Encoder, constructors and synthesizer, on crops; the latents are what the encoder makes.
    Encoder,
    /// Latents, which are parameters of their own, and synthesizer, on the whole set.
    Latents,
    /// The synthesizer alone, on the whole set; the latents stay.
    Synthesizer,
}

/// What the synthesizer sees of the latents.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Shown {
    /// Plus uniform noise as wide as one code (Ballé et al. 2017).
    Noise,
    /// To the nearest code, the gradient passing straight through (Theis et al. 2017).
    Rounded,
}

/// The numbers in which the synthesizer computes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Arithmetic {
    /// Reals.
    Real,
    /// Those of the decode: isa's integers, or halves where a layer is fp16.
    Deployed,
}

/// How the learning rates go on within a stage.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Fall {
    /// They stay.
    Constant,
    /// Along half a cosine to a hundredth.
    #[default]
    Cosine,
}

/// Which mips a crop trains. A crop that is the whole set trains every mip.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Mips {
    /// Every mip of which a crop holds at least a texel: 0..=8 for 256², as in the paper's Table 1.
    #[default]
    Inside,
    /// Those of which a crop holds at least eight texels along its longer side, so that the corners
    /// of some lie inside the crop: 0..=5 for 256².
    Corners,
}

/// The learning rates of a stage; those left out are the configuration's.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RatesPlan {
    /// Of the encoder and its constructors.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub encoder: Option<f64>,
    /// Of the latents, whose reals are −½..=½.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub latents: Option<f64>,
    /// Of the synthesizer.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub synthesizer: Option<f64>,
}

/// One stage.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StagePlan {
    /// What is trained.
    pub train: Train,
    /// Its steps. They are part of the plan and never follow from a clock, unless a budget of time
    /// scales them before the first.
    pub steps: u64,
    /// The stage is left out for a set whose longer side has fewer texels.
    #[serde(default)]
    pub least_side: u32,
    /// What the synthesizer sees of the latents.
    pub latents: Shown,
    /// The numbers in which the synthesizer computes.
    pub numbers: Arithmetic,
    /// The learning rates.
    #[serde(default)]
    pub rates: RatesPlan,
    /// What moves the synthesizer's parameters; by default the configuration's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub optimiser: Option<Optimiser>,
    /// All of them times this.
    #[serde(default = "one")]
    pub rate_factor: f64,
    /// How they go on.
    #[serde(default)]
    pub fall: Fall,
    /// The part of the fall that the stage covers, from the first number to the second of 0..=1.
    /// Stages that follow each other in one fall end lower than after a fall each. Rules of rates by
    /// length count the steps of the whole fall at the stage's pace.
    #[serde(default = "whole", skip_serializing_if = "is_whole")]
    pub part: [f64; 2],
    /// Steps over which they rise from nothing, at most a tenth of the stage.
    #[serde(default)]
    pub warm_up: u64,
    /// Side of a crop in texels of mip 0, a multiple of 64; by default that of the stage before, or
    /// the configuration's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub crop: Option<u32>,
    /// Crops in a step; by default the configuration's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub crops: Option<u16>,
    /// Texels in a step, a multiple of 768; by default the configuration's, fewer for a small set.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub batch: Option<u32>,
    /// Which mips a crop trains.
    #[serde(default)]
    pub mips: Mips,
    /// The share of texels whose mip is drawn uniformly, 0..=1; by default the configuration's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub uniform_mips: Option<f64>,
}

const fn one() -> f64 {
    1.0
}

const fn whole() -> [f64; 2] {
    [0.0, 1.0]
}

fn is_whole(part: &[f64; 2]) -> bool {
    *part == whole()
}

/// What a run trains, stage after stage.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// The name, for the asset's record.
    pub name: String,
    /// Where latents start that no encoder makes; by default the configuration's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub first_latents: Option<FirstLatents>,
    /// The stages, in the order in which they run.
    pub stage: Vec<StagePlan>,
}

/// The plans that come with the trainer, by name.
const PLANS: [(&str, &str); 5] = [
    ("ntc", include_str!("../../plans/ntc.toml")),
    ("paper", include_str!("../../plans/paper.toml")),
    ("paper-short", include_str!("../../plans/paper-short.toml")),
    ("direct", include_str!("../../plans/direct.toml")),
    (
        "encoder-first",
        include_str!("../../plans/encoder-first.toml"),
    ),
];

impl Plan {
    /// The names of the plans that come with the trainer.
    pub fn names() -> impl Iterator<Item = &'static str> {
        PLANS.iter().map(|(name, _)| *name)
    }

    /// The plan with this name.
    ///
    /// # Errors
    /// When there is none.
    pub fn by_name(name: &str) -> Result<Plan, TrainError> {
        let Some((_, text)) = PLANS.iter().find(|(known, _)| *known == name) else {
            let names: Vec<&str> = Plan::names().collect();
            return Err(TrainError::config("plan", name, names.join(", ")));
        };
        Plan::parse(text)
    }

    /// The plan of a TOML text.
    ///
    /// # Errors
    /// When it is no plan, or its stages are in an order that makes no sense.
    pub fn parse(text: &str) -> Result<Plan, TrainError> {
        let plan: Plan = toml::from_str(text).map_err(|error| {
            TrainError::config("plan", error.to_string(), "a list of [[stage]]")
        })?;
        plan.check()?;
        Ok(plan)
    }

    /// The plan without its encoder: those stages train the latents directly, for as many steps, at
    /// the configuration's rates. A constant rate becomes a cosine: without one the latents keep
    /// moving by whole codes.
    #[must_use]
    pub fn without_encoder(mut self) -> Plan {
        for stage in &mut self.stage {
            if stage.train == Train::Encoder {
                stage.train = Train::Latents;
                stage.rates = RatesPlan::default();
                stage.fall = Fall::Cosine;
            }
        }
        self.name.push_str(" without encoder");
        self
    }

    /// The plan with other steps, stage by stage.
    ///
    /// # Errors
    /// When there are more or fewer numbers than stages.
    pub fn with_steps(mut self, steps: &[u64]) -> Result<Plan, TrainError> {
        if steps.len() != self.stage.len() {
            let allowed = format!("{}, one a stage", self.stage.len());
            return Err(TrainError::config(
                "steps",
                format!("{} numbers", steps.len()),
                allowed,
            ));
        }
        for (stage, &steps) in self.stage.iter_mut().zip(steps) {
            stage.steps = steps;
        }
        Ok(self)
    }

    /// Whether every field is in range and the order of the stages makes sense.
    ///
    /// # Errors
    /// The first stage that is out of order, or its first field that is out of range.
    pub fn check(&self) -> Result<(), TrainError> {
        if self.stage.is_empty() {
            return Err(TrainError::config("plan", "no stage", "at least one"));
        }
        for (index, stage) in self.stage.iter().enumerate() {
            stage.check(index)?;
        }
        let pairs = self.stage.windows(2).enumerate();
        for (index, pair) in pairs.map(|(index, pair)| (index + 1, pair)) {
            let [before, stage] = [&pair[0], &pair[1]];
            if stage.train == Train::Encoder && before.train != Train::Encoder {
                return Err(TrainError::config(
                    format!("plan: stage[{index}].train"),
                    "an encoder stage after one that is none",
                    "encoder stages before all others: the encoder makes the latents anew",
                ));
            }
            if stage.numbers == Arithmetic::Real && before.numbers == Arithmetic::Deployed {
                return Err(TrainError::config(
                    format!("plan: stage[{index}].numbers"),
                    "real after deployed",
                    "real stages before deployed ones: the ranges of the registers are fixed \
                     between the two",
                ));
            }
        }
        Ok(())
    }
}

impl StagePlan {
    fn check(&self, index: usize) -> Result<(), TrainError> {
        use crate::check_config::{check_batch, check_crop, range};
        let field = |name: &str| format!("plan: stage[{index}].{name}");
        range(field("steps"), self.steps, 0, MOST_STEPS)?;
        let rates = [
            ("rates.encoder", self.rates.encoder),
            ("rates.latents", self.rates.latents),
            ("rates.synthesizer", self.rates.synthesizer),
        ];
        for (name, rate) in rates {
            range(field(name), rate.unwrap_or(0.0), 0.0, 1.0)?;
        }
        range(field("rate_factor"), self.rate_factor, 0.0, 10.0)?;
        let [from, to] = self.part;
        if !(0.0 <= from && to <= 1.0 && to - from >= LEAST_PART) {
            return Err(TrainError::config(
                field("part"),
                format!("{from} to {to}"),
                format!("0 to 1, the second at least {LEAST_PART} above the first"),
            ));
        }
        if let Some(crop) = self.crop {
            check_crop(&field("crop"), crop)?;
        }
        range(field("crops"), self.crops.unwrap_or(1), 1, 64)?;
        if let Some(batch) = self.batch {
            check_batch(&field("batch"), batch)?;
        }
        range(
            field("uniform_mips"),
            self.uniform_mips.unwrap_or(0.0),
            0.0,
            1.0,
        )?;
        if self.numbers == Arithmetic::Deployed && self.latents == Shown::Noise {
            return Err(TrainError::config(
                field("latents"),
                "noise in a deployed stage",
                "rounded: the decode knows only whole codes",
            ));
        }
        Ok(())
    }
}

/// The least part of a fall that a stage covers.
const LEAST_PART: f64 = 0.001;

/// The most steps of a stage.
const MOST_STEPS: u64 = 100_000_000;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_plan_that_comes_with_the_trainer_reads_and_has_its_name() {
        for name in Plan::names() {
            assert_eq!(Plan::by_name(name).unwrap().name, name);
        }
        let error = Plan::by_name("papers").unwrap_err().to_string();
        assert!(error.contains("paper-short"), "{error}");
    }

    #[test]
    fn a_plan_survives_toml_and_json() {
        for name in Plan::names() {
            let plan = Plan::by_name(name).unwrap();
            let text = toml::to_string(&plan).unwrap();
            assert_eq!(Plan::parse(&text).unwrap(), plan);
            let text = serde_json::to_string(&plan).unwrap();
            assert_eq!(serde_json::from_str::<Plan>(&text).unwrap(), plan);
        }
    }

    #[test]
    fn a_part_that_is_none_is_refused() {
        for (part, good) in [
            ("0.0, 1.0", true),
            ("0.75, 1.0", true),
            ("0.5, 0.5", false),
            ("0.6, 0.5", false),
            ("-0.1, 0.5", false),
            ("0.5, 1.1", false),
            ("nan, 1.0", false),
        ] {
            let text = format!(
                "name = \"t\"\n[[stage]]\ntrain = \"latents\"\nsteps = 3\nlatents = \"noise\"\n\
                 numbers = \"real\"\npart = [{part}]\n"
            );
            match Plan::parse(&text) {
                Ok(_) => assert!(good, "{part}"),
                Err(error) => {
                    assert!(!good, "{part}: {error}");
                    assert!(error.to_string().contains("stage[0].part"), "{error}");
                }
            }
        }
    }

    /// A plan of (train, latents, numbers).
    fn plan_of(stages: &[(&str, &str, &str)]) -> Result<Plan, TrainError> {
        let stages = stages.iter().map(|(train, latents, numbers)| {
            format!(
                "[[stage]]\ntrain = {train:?}\nsteps = 3\nlatents = {latents:?}\nnumbers = \
                 {numbers:?}\n"
            )
        });
        Plan::parse(&format!("name = \"t\"\n{}", stages.collect::<String>()))
    }

    #[test]
    fn every_order_of_two_stages_is_taken_or_refused_as_the_rules_say() {
        let trains = ["encoder", "latents", "synthesizer"];
        let numbers = ["real", "deployed"];
        for (a, b) in trains.iter().flat_map(|a| trains.map(|b| (*a, b))) {
            for (x, y) in numbers.iter().flat_map(|x| numbers.map(|y| (*x, y))) {
                let found = plan_of(&[(a, "rounded", x), (b, "rounded", y)]);
                let encoder_late = b == "encoder" && a != "encoder";
                let real_late = y == "real" && x == "deployed";
                assert_eq!(found.is_err(), encoder_late || real_late, "{a} {x} {b} {y}");
                if encoder_late {
                    let error = found.unwrap_err().to_string();
                    assert!(error.contains("stage[1].train"), "{error}");
                }
            }
        }
    }

    #[test]
    fn noise_in_a_deployed_stage_an_empty_plan_and_an_unknown_field_are_refused() {
        for (text, part) in [
            ("name = \"t\"\nstage = []", "no stage"),
            ("name = \"t\"\n[[stage]]\nstep = 3\n", "step"),
        ] {
            let error = Plan::parse(text).unwrap_err().to_string();
            assert!(error.contains(part), "{error}");
        }
        let error = plan_of(&[("latents", "noise", "deployed")]).unwrap_err();
        assert!(error.to_string().contains("stage[0].latents"), "{error}");
    }

    #[test]
    fn a_plan_without_its_encoder_keeps_its_steps() {
        let plan = Plan::by_name("paper").unwrap();
        let steps = |plan: &Plan| plan.stage.iter().map(|s| s.steps).collect::<Vec<_>>();
        let direct = plan.clone().without_encoder();
        assert_eq!(steps(&plan), steps(&direct));
        assert!(direct.stage.iter().all(|s| s.train != Train::Encoder));
        assert!(plan.clone().with_steps(&[1]).is_err());
        let count = plan.stage.len();
        let short = plan.with_steps(&vec![7; count]).unwrap();
        assert_eq!(steps(&short), vec![7; count]);
    }
}
