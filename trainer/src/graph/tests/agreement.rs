//! When two evaluations of a step agree: bounds on their gradients, and what a step makes of them.

use super::{BATCH, RATES};
use crate::Train;
use crate::adam::{BETA1, EPSILON, Moments, Rate};
use crate::crop::{constructors, encoder};
use crate::descent::{COEFFICIENTS, MOMENTUM, ROUNDS, update_size};
use crate::model::{Ground, Model};
use std::ops::Range;

/// The unit roundoff of f32.
const U: f64 = 1.0 / (1_u64 << 24) as f64;

/// How far two evaluations of a step's gradient in f32 may be apart, over the Euclidean norm of the
/// gradient.
///
/// A sum of n products, in any order and with or without fused multiply-adds, errs by at most n·u
/// times the sum of their magnitudes (Higham 2002, section 3.1). A gradient passes the sums of every
/// layer forward and, as long, back, and at last sums over the batch and over a crop's positions.
/// The errors of all of them add up; that a layer makes a relative error larger is left out, because
/// what it does to an error it does to the signal. Both evaluations err, hence the 2. The absolute
/// error of 10^−5 that WGSL allows a tanh is far below.
pub(super) fn bound(ground: &Ground<'_>, train: Train) -> f64 {
    let synthesizer: usize = ground.topology.layers.iter().map(|l| l.inputs + 2).sum();
    let (forward, positions) = match train {
        Train::Encoder => {
            let constructors = constructors(ground);
            let encoder = encoder(ground, &constructors);
            let sums = encoder
                .places()
                .map(|(_, [_, i, k, _], _, _)| i * k * k + 2);
            let levels = 0..ground.positions.level_count();
            let pools = levels.flat_map(|l| constructors.each_ref().map(|c| c.pool_log2(l)));
            let pooled = 1 << (2 * pools.max().unwrap_or(0));
            let side = ground.config.crop as usize / 2;
            let positions = usize::from(ground.config.crops) * side * side;
            (synthesizer + sums.sum::<usize>() + pooled, positions)
        }
        Train::Latents | Train::Synthesizer => (synthesizer, 0),
    };
    2.0 * U * (2 * forward + positions + BATCH) as f64
}

pub(super) fn norm(values: impl Iterator<Item = f64>) -> f64 {
    values.map(|v| v * v).sum::<f64>().sqrt()
}

/// Fails unless the gradients that made `left` and `right` out of `before` are equal up to `bound`.
pub(super) fn assert_gradients_agree(
    name: &str,
    bound: f64,
    before: &Moments,
    (left, right): (&Moments, &Moments),
) {
    assert_momenta_agree(name, (bound, BETA1), before, (left, right));
}

/// The same where the momentum decays at another rate.
pub(super) fn assert_momenta_agree(
    name: &str,
    (bound, keep): (f64, f32),
    before: &Moments,
    (left, right): (&Moments, &Moments),
) {
    let keep = f64::from(keep);
    let gradient = |after: &Moments| -> Vec<f64> {
        let moments = after.first.iter().zip(&before.first);
        moments
            .map(|(&after, &before)| (f64::from(after) - keep * f64::from(before)) / (1.0 - keep))
            .collect()
    };
    let (left, right) = (gradient(left), gradient(right));
    let size = norm(right.iter().copied());
    assert!(size > 0.0, "{name}: no gradient");
    let error = norm(left.iter().zip(&right).map(|(l, r)| l - r)) / size;
    assert!(error <= bound, "{name}: {error:e} > {bound:e}");
}

/// Fails unless `after` is what Adam makes of `before` with these moments, each element by itself.
pub(super) fn assert_updated(
    name: &str,
    rate: Rate,
    before: &[f32],
    after: &[f32],
    moments: &Moments,
) {
    let elements = before
        .iter()
        .zip(after)
        .zip(&moments.first)
        .zip(&moments.second);
    for (at, (((&before, &after), &first), &second)) in elements.enumerate() {
        let step = rate.step * first / (second.sqrt() * rate.root + EPSILON);
        let expected = before - step;
        // WGSL allows a root 4.5 and a division 2.5 units in the last place; three products and
        // two sums are rounded on either side.
        let bound = 16.0 * U * f64::from(before.abs() + step.abs());
        let error = f64::from((after - expected).abs());
        assert!(error <= bound, "{name} {at}: {after} instead of {expected}");
    }
}

/// Fails unless Muon took the synthesizer from `before` to both others, and Adam what Muon leaves.
pub(super) fn assert_muon_agrees(
    ground: &Ground<'_>,
    bound: f64,
    rate: Rate,
    [before, left, right]: [&Model; 3],
) {
    let (last, hidden) = ground.topology.layers.split_last().unwrap();
    let moments = |model: &Model, part: Range<usize>| Moments {
        first: model.moments.first[part.clone()].to_vec(),
        second: model.moments.second[part].to_vec(),
    };
    let all = [before, left, right];
    let by_adam = hidden
        .iter()
        .map(|layer| layer.bias_at..layer.bias_at + layer.columns())
        .chain(std::iter::once(
            last.weights_at..last.bias_at + last.columns(),
        ));
    for part in by_adam {
        let [old, new, other] = all.map(|model| moments(model, part.clone()));
        assert_gradients_agree("by Adam", bound, &old, (&new, &other));
        let [old, values, _] = all.map(|model| &model.parameters[part.clone()]);
        assert_updated("by Adam", rate, old, values, &new);
    }
    // The polynomials are steepest at zero, and an odd function of singular values changes a matrix
    // by no more than its largest slope times the change (in Frobenius norms).
    let slope = f64::from(COEFFICIENTS[0]).powi(ROUNDS as i32);
    for layer in hidden {
        let part = layer.weights_at..layer.bias_at;
        let [old, new, other] = all.map(|model| moments(model, part.clone()));
        assert_momenta_agree("momentum", (bound, MOMENTUM), &old, (&new, &other));
        assert_eq!(new.second, old.second);
        let [old, new, other] = all.map(|model| &model.parameters[part.clone()]);
        let difference =
            |a: &[f32], b: &[f32]| norm(a.iter().zip(b).map(|(a, b)| f64::from(a - b)));
        let one = RATES.synthesizer * f64::from(update_size(layer));
        let error = difference(new, other) / one;
        assert!(error <= slope * bound, "{error:e} > {slope} · {bound:e}");
        // At least one singular value, and the iteration leaves none that mattered below 0.68.
        let moved = difference(new, old) / one;
        assert!(moved > 0.68, "{moved}");
    }
}
