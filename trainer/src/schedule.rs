//! Schedule: the plan that follows from an effort, and the learning rate at each step of a stage.

use crate::choices::Precision;
use crate::config::{CHUNKS, TILE, TrainConfig};
use crate::plan::{Arithmetic, Fall, Mips, Plan, RatesPlan, Shown, StagePlan, Train};
use crate::stage::Stage;

/// Passes over all texels of all mips in the refinement and the integer stage together, at
/// efforts 0, 10, 50 and 100; between them the logarithm is interpolated.
const PASSES: [(f64, f64); 4] = [(0.0, 8.0), (10.0, 30.0), (50.0, 240.0), (100.0, 1200.0)];

/// The share of those passes that the integer stage has.
const INTEGER_SHARE: f64 = 0.25;

/// The same where any layer's weights have few bits: they have more to learn there.
const FEW_BITS_SHARE: f64 = 0.5;

/// Weights of fewer bits have few.
const FEW_BITS: u8 = 7;

/// The share of the way to its code that a weight of few bits is drawn in a step at the end of a
/// stage in the numbers of the decode.
const DRAW: f64 = 0.025;

/// The least steps of the two stages together, for each pass: what a set smaller than a batch
/// gets.
const LEAST: f64 = 8.0;

/// The effort from which on the encoder runs at all, and its steps at effort 100. On two cores a
/// step of it costs as much as ten to a hundred of the refinement, and a short encoder stage does
/// not pay: 120 steps of it before 4000 others gave 0.3 dB less than those 4000 alone.
const ENCODER: (f64, f64) = (75.0, 1000.0);

/// An effort, by name.
///
/// The names are those of astcenc; the numbers are a scale of their own.
pub const EFFORTS: [(&str, u8); 5] = [
    ("fastest", 0),
    ("fast", 10),
    ("medium", 50),
    ("thorough", 75),
    ("exhaustive", 100),
];

/// The plan of the configuration's effort for a set of `texels` texels in all its mips.
pub(crate) fn plan(config: &TrainConfig, texels: u64, batch: usize) -> Plan {
    let passes = interpolate(&PASSES, f64::from(config.effort));
    let steps = (passes * texels as f64 / batch as f64)
        .max(LEAST * passes)
        .round();
    let any_has_few = (0..config.layer_count()).any(|layer| config.has_few_bits(layer));
    let share = if any_has_few {
        FEW_BITS_SHARE
    } else {
        INTEGER_SHARE
    };
    let deployed = (share * steps).round();
    let (from, most) = ENCODER;
    let encoder = (most * (f64::from(config.effort) - from) / (100.0 - from)).max(0.0);
    config.usual_plan([encoder as u64, (steps - deployed) as u64, deployed as u64])
}

/// Steps that a pass over the texels has at least, before the batch grows to the configured one: a
/// small set needs steps more than it needs quiet gradients.
const STEPS_PER_PASS: u64 = 64;

/// The batch below which more steps no longer pay for their noise.
const SMALL_BATCH: u64 = 3072;

/// Steps from which on a run gains more from quiet gradients than from further steps.
const ENOUGH_STEPS: u64 = 20_000;

/// Texels that a step's are a multiple of: every chunk has whole tiles.
const TILES: u64 = (CHUNKS * TILE) as u64;

/// Texels of a step: the configured batch, fewer for a small set or an effort that would take too
/// few steps with it, at most the set's texels in whole tiles.
pub(crate) fn batch(config: &TrainConfig, texels: u64) -> usize {
    let quick = (texels / STEPS_PER_PASS).max(SMALL_BATCH);
    let most = quick.min(u64::from(config.batch)).min(texels);
    let most = most.next_multiple_of(TILES) as usize;
    if follows_effort(config) {
        let passes = interpolate(&PASSES, f64::from(config.effort));
        most.min(batch_of_run((passes * texels as f64) as u64))
    } else {
        most
    }
}

/// The most texels of a step in a run over `texels`, each counted as often as it is drawn.
pub(crate) fn batch_of_run(texels: u64) -> usize {
    let steady = texels / ENOUGH_STEPS / TILES * TILES;
    steady.max(SMALL_BATCH) as usize
}

/// The steps of a fall up to which a deep synthesizer takes its whole learning rate.
const SHORT_FALL: f64 = 2000.0;

/// The share of its learning rate that a deep synthesizer takes in a fall of so many steps.
pub(crate) fn ease(steps: f64) -> f64 {
    (SHORT_FALL / steps).sqrt().min(1.0)
}

/// The steps of a fall from which on latents have the time to come where they belong.
const LONG_FALL: f64 = 4000.0;

/// How many times their learning rate latents take in a fall of so many steps.
pub(crate) fn haste(steps: f64) -> f64 {
    (LONG_FALL / steps.max(1.0)).sqrt().max(1.0)
}

/// Passes over the texels for which latents may settle once: a round costs about as much as two.
const PASSES_PER_ROUND: f64 = 4.0;

/// Rounds beyond which hardly a latent moves.
pub(crate) const MOST_ROUNDS: u32 = 8;

/// What a round has to bring if another is to follow, in decibels, where nobody has fixed how many
/// there are: about what training brings in its time.
const LEAST_GAIN: f64 = 0.03;

/// See [`LEAST_GAIN`].
pub(crate) fn least_gain(config: &TrainConfig) -> f64 {
    if config.settle.is_none() {
        LEAST_GAIN
    } else {
        0.0
    }
}

/// The most rounds in which latents settle after these stages on a set of so many texels.
pub(crate) fn rounds(config: &TrainConfig, stages: &[Stage], texels: u64) -> u32 {
    if let Some(rounds) = config.settle {
        return rounds;
    }
    if !follows_effort(config) {
        return 0;
    }
    let drawn = stages.iter().filter(|stage| stage.train == Train::Latents);
    let drawn: f64 = drawn.map(|s| s.steps as f64 * s.batch as f64).sum();
    let rounds = (drawn / texels as f64 / PASSES_PER_ROUND).round() as u32;
    rounds.clamp(1, MOST_ROUNDS)
}

/// The share of the way to its code that a weight of few bits is drawn at step `step` (from 0) of
/// `steps`: nothing at first, most of [`DRAW`] soon.
pub(crate) fn draw(step: u64, steps: u64) -> f64 {
    DRAW * (step as f64 / steps.max(1) as f64).sqrt()
}

/// Whether the plan is that of an effort, with whatever steps.
pub(crate) fn follows_effort(config: &TrainConfig) -> bool {
    let plan = config.plan.as_ref();
    plan.is_none_or(|plan| plan.name == USUAL)
}

/// The logarithm of the second number, linear in the first.
fn interpolate(points: &[(f64, f64)], at: f64) -> f64 {
    for pair in points.windows(2) {
        let [(x0, y0), (x1, y1)] = [pair[0], pair[1]];
        if at <= x1 {
            return y0 * (y1 / y0).powf((at - x0) / (x1 - x0));
        }
    }
    points.last().map_or(1.0, |p| p.1)
}

impl TrainConfig {
    /// The configuration with an effort of 0..=100: it decides the steps and the batch (together
    /// with the set's texels, never with a clock), and the encoder's width.
    ///
    /// Efforts up to 75 train latents and synthesizer alone; beyond, the encoder comes first. The
    /// names are in [`EFFORTS`].
    #[must_use]
    pub fn with_effort(mut self, effort: u8) -> TrainConfig {
        self.effort = effort.min(100);
        self.plan = None;
        self.encoder_width = if self.effort > 90 { 64 } else { 32 };
        self
    }
}

impl TrainConfig {
    /// Whether a layer's weights have so few bits that they are trained with more care.
    pub(crate) fn has_few_bits(&self, layer: usize) -> bool {
        self.precision_of(layer) == Precision::Int8 && self.weight_bits_of(layer) < FEW_BITS
    }

    /// The plan that an effort gives, with these steps: encoder, latents in reals, latents in the
    /// numbers of the decode. The last two share one fall of the rates: the first half of it
    /// and the second, whatever their steps.
    #[must_use]
    pub fn usual_plan(&self, [encoder, latents, deployed]: [u64; 3]) -> Plan {
        let stage = |train, steps, latents, numbers| StagePlan {
            train,
            steps,
            least_side: 0,
            latents,
            numbers,
            rates: RatesPlan::default(),
            optimiser: None,
            rate_factor: 1.0,
            fall: Fall::Cosine,
            part: [0.0, 1.0],
            warm_up: WARM_UP,
            crop: None,
            crops: None,
            batch: None,
            mips: Mips::Corners,
            uniform_mips: None,
        };
        let [mut first, mut last] = [
            stage(Train::Latents, latents, Shown::Noise, Arithmetic::Real),
            stage(
                Train::Latents,
                deployed,
                Shown::Rounded,
                Arithmetic::Deployed,
            ),
        ];
        if latents > 0 && deployed > 0 {
            first.part = [0.0, INTEGERS_FROM];
            last.part = [INTEGERS_FROM, 1.0];
        }
        Plan {
            first_latents: None,
            name: USUAL.to_owned(),
            stage: vec![
                stage(Train::Encoder, encoder, Shown::Noise, Arithmetic::Real),
                first,
                last,
            ],
        }
    }
}

/// The name of the plan that an effort gives.
pub(crate) const USUAL: &str = "effort";

/// Where in the fall of the rates an effort's integer stage takes over: before reals have settled
/// where integers would have to leave again. Its fewer steps fall faster.
const INTEGERS_FROM: f64 = 0.5;

/// Steps over which a rate rises from nothing.
const WARM_UP: u64 = 100;

/// What is left of a rate at the end of a stage that falls to the floor.
const FLOOR: f64 = 0.01;

/// The factor of a learning rate at a share `at` of 0..=1 of a fall along half a cosine.
pub(crate) fn fall(at: f64) -> f64 {
    FLOOR + (1.0 - FLOOR) * 0.5 * (1.0 + (std::f64::consts::PI * at.clamp(0.0, 1.0)).cos())
}

/// The factor of a learning rate at step `step` (from 0) of `steps` because of a warm-up, of at most a
/// tenth of them.
pub(crate) fn rise(warm_up: u64, step: u64, steps: u64) -> f64 {
    let warm = (warm_up as f64).min(0.1 * steps as f64).max(1.0);
    ((step + 1) as f64 / warm).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rate_rises_to_the_whole_and_falls_to_the_floor() {
        let of = |step| rise(WARM_UP, step, 10_000);
        assert!(of(0) > 0.0 && of(0) < of(50) && of(50) < of(99));
        assert!((99..10_000).all(|step| of(step) == 1.0));
        assert_eq!(rise(WARM_UP, 0, 1), 1.0);
        assert_eq!(fall(0.0), 1.0);
        assert!((fall(1.0) - FLOOR).abs() < 1e-12);
        assert!((1..=100).all(|i| fall(0.01 * f64::from(i)) < fall(0.01 * f64::from(i - 1))));
    }

    #[test]
    fn interpolation_meets_its_points() {
        for (x, y) in PASSES {
            assert!((interpolate(&PASSES, x) - y).abs() < 1e-9 * y);
        }
        assert!(interpolate(&PASSES, 30.0) > 30.0 && interpolate(&PASSES, 30.0) < 240.0);
    }
}
