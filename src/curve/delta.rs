//! The Bjøntegaard delta: the mean distance of two curves over what they have in common.

use super::error::CurveError;
use super::interpolant::{Interpolant, Method};
use super::points::Points;
use serde::Serialize;

/// A mean distance, and what it is the mean over.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Delta {
    /// Of a BD-rate: percent, negative where the test needs fewer bits. Of a BD-PSNR: the metric's
    /// unit, positive where the test is better.
    pub value: f64,
    /// The interval that both curves cover: of the metric for a BD-rate, of log10 rate for a
    /// BD-PSNR.
    pub overlap: [f64; 2],
    /// Its length over that of the interval that either covers, above 0, at most 1. The figure says
    /// little of two curves where this is small; PyPI's bjontegaard warns below 0.75.
    pub overlap_share: f64,
}

/// BD-rate: how much more rate, in percent, the test needs for the anchor's quality; the mean of
/// log10 rate over the metric, as in VCEG-M33.
///
/// # Errors
/// When a curve has too few points for the method, falls anywhere, or the metrics do not overlap.
pub fn bd_rate(anchor: &Points, test: &Points, method: Method) -> Result<Delta, CurveError> {
    let swap = |points: &Points| -> Vec<(f64, f64)> {
        let pairs = points.pairs().iter();
        pairs
            .map(|(rate, metric)| (*metric, rate.log10()))
            .collect()
    };
    let delta = mean_distance(METRIC, (anchor, swap(anchor)), (test, swap(test)), method)?;
    Ok(Delta {
        value: 100.0 * (10_f64.powf(delta.value) - 1.0),
        ..delta
    })
}

/// BD-PSNR: how much better the test is at the anchor's rate, in the metric's unit; the mean of the
/// metric over log10 rate. The metric need not be PSNR.
///
/// # Errors
/// As [`bd_rate`], where the rates do not overlap.
pub fn bd_psnr(anchor: &Points, test: &Points, method: Method) -> Result<Delta, CurveError> {
    let logs = |points: &Points| -> Vec<(f64, f64)> {
        let pairs = points.pairs().iter();
        pairs
            .map(|(rate, metric)| (rate.log10(), *metric))
            .collect()
    };
    mean_distance(RATE, (anchor, logs(anchor)), (test, logs(test)), method)
}

/// What the mean is over: its name, and what a knot's place on it means to a reader.
type Along = (&'static str, fn(f64) -> f64);

const METRIC: Along = ("metric", |metric| metric);
const RATE: Along = ("rate", |log10| 10_f64.powf(log10));

type Knots<'a> = (&'a Points, Vec<(f64, f64)>);

fn mean_distance(
    (along, shown): Along,
    anchor: Knots<'_>,
    test: Knots<'_>,
    method: Method,
) -> Result<Delta, CurveError> {
    for (points, knots) in [&anchor, &test] {
        check(points, knots, method)?;
    }
    let range = |knots: &[(f64, f64)]| [knots[0].0, knots[knots.len() - 1].0];
    let (a, t) = (range(&anchor.1), range(&test.1));
    let overlap = [a[0].max(t[0]), a[1].min(t[1])];
    let length = overlap[1] - overlap[0];
    if length <= 0.0 {
        return Err(CurveError::NoOverlap {
            anchor: anchor.0.name().to_owned(),
            test: test.0.name().to_owned(),
            along,
            anchor_range: a.map(shown),
            test_range: t.map(shown),
        });
    }
    let integral = |knots| Interpolant::new(knots, method).integral(overlap[0], overlap[1]);
    Ok(Delta {
        value: (integral(test.1) - integral(anchor.1)) / length,
        overlap,
        overlap_share: length / (a[1].max(t[1]) - a[0].min(t[0])),
    })
}

fn check(points: &Points, knots: &[(f64, f64)], method: Method) -> Result<(), CurveError> {
    let (found, allowed) = (knots.len(), method.least_points());
    if found < allowed {
        return Err(CurveError::TooFew {
            curve: points.name().to_owned(),
            method: method.name(),
            found,
            allowed,
        });
    }
    // Two rates so close that their logarithms are one number are not apart either.
    let level = knots
        .windows(2)
        .position(|k| k[1].0 <= k[0].0 || k[1].1 <= k[0].1);
    match points.first_fall().or(level.map(|at| at + 1)) {
        None => Ok(()),
        Some(index) => Err(CurveError::NotRising {
            curve: points.name().to_owned(),
            index,
            before: points.pairs()[index - 1],
            found: points.pairs()[index],
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The example of the README of PyPI's bjontegaard: x265 at four bit rates, two presets.
    fn readme() -> (Points, Points) {
        let points = |name, rates: [f64; 4], psnrs: [f64; 4]| {
            Points::new(name, rates.into_iter().zip(psnrs).collect()).unwrap()
        };
        (
            points(
                "anchor",
                [9487.76, 4593.60, 2486.44, 1358.24],
                [40.037, 38.615, 36.845, 34.851],
            ),
            points(
                "test",
                [9787.80, 4469.00, 2451.52, 1356.24],
                [40.121, 38.651, 36.970, 34.987],
            ),
        )
    }

    /// Percent, dB: of the test over the anchor and the other way round, as bjontegaard 1.3.0 with
    /// SciPy 1.17.1 prints them on that example.
    const KNOWN: [(Method, [f64; 2], [f64; 2]); 2] = [
        (
            Method::Pchip,
            [-4.417485350589045, 0.11969278542479489],
            [4.621645880307734, -0.11969278542479489],
        ),
        (
            Method::Akima,
            [-4.425245156997493, 0.11940927028529469],
            [4.630140212513956, -0.11940927028529469],
        ),
    ];

    #[test]
    fn deltas_are_those_of_bjontegaard_on_its_own_example() {
        // Integrals of at most 5 · 40 from some 40 roundings each, over a length of 0.8, and
        // d(percent) = 100·ln 10 · d(log10).
        let bound = 230.3 * 2.0 * 40.0 * 200.0 * f64::EPSILON / 0.8;
        assert!(bound < 1e-8);
        let (anchor, test) = readme();
        for (method, forth, back) in KNOWN {
            for (a, b, known) in [(&anchor, &test, forth), (&test, &anchor, back)] {
                let found =
                    [bd_rate(a, b, method), bd_psnr(a, b, method)].map(|d| d.unwrap().value);
                for (found, known) in found.into_iter().zip(known) {
                    assert!(
                        (found - known).abs() < bound,
                        "{method:?}: {found}, {known}"
                    );
                }
            }
        }
    }

    #[test]
    fn half_the_rate_is_minus_fifty_percent_over_the_whole_curve() {
        let rates = [0.125, 0.25, 0.5, 1.0];
        let points = |scale: f64, lift: f64| {
            let pairs = rates.iter().zip([30.0, 33.0, 35.0, 36.0]);
            let pairs = pairs.map(|(rate, psnr)| (rate * scale, psnr + lift));
            Points::new("c", pairs.collect()).unwrap()
        };
        for method in Method::ALL {
            let half = bd_rate(&points(1.0, 0.0), &points(0.5, 0.0), method).unwrap();
            assert_eq!((half.overlap, half.overlap_share), ([30.0, 36.0], 1.0));
            // A hundred roundings of integrals of at most 6 · 1.3, over 6, times 100·ln 10 / 2.
            assert!((half.value + 50.0).abs() < 115.2 * 100.0 * 1.3 * f64::EPSILON);
            let lifted = bd_psnr(&points(1.0, 0.0), &points(1.0, 0.5), method).unwrap();
            assert!((lifted.value - 0.5).abs() < 100.0 * 36.5 * f64::EPSILON);
            assert_eq!(
                bd_rate(&points(1.0, 0.0), &points(1.0, 0.0), method)
                    .unwrap()
                    .value,
                0.0
            );
        }
    }

    #[test]
    fn what_has_no_delta_is_refused_with_the_reason() {
        let points = |pairs: &[(f64, f64)]| Points::new("c", pairs.to_vec()).unwrap();
        let (good, short) = (
            points(&[(1.0, 30.0), (2.0, 33.0), (4.0, 35.0)]),
            points(&[(1.0, 30.0), (2.0, 33.0)]),
        );
        let message =
            |a: &Points, b: &Points, method| bd_rate(a, b, method).unwrap_err().to_string();
        assert!(bd_rate(&good, &short, Method::Pchip).is_ok());
        assert!(
            message(&good, &short, Method::Akima)
                .contains("found 2 points; allowed with akima: at least 3")
        );
        let one = points(&[(1.0, 30.0)]);
        assert!(message(&one, &good, Method::Pchip).contains("allowed with pchip: at least 2"));
        let falling = points(&[(4.0, 31.0), (1.0, 30.0), (2.0, 33.0)]);
        let text = message(&good, &falling, Method::Pchip);
        assert!(
            text.contains("points 1 and 2 by rate: found (4.0, 31.0) after (2.0, 33.0)"),
            "{text}"
        );
        let twice = points(&[(1.0, 30.0), (1.0, 31.0), (2.0, 33.0)]);
        assert!(bd_psnr(&good, &twice, Method::Pchip).is_err());
        let above = points(&[(1.0, 35.0), (2.0, 36.0)]);
        let text = message(&good, &above, Method::Pchip);
        assert!(
            text.contains("metric from 30.0000 to 35.0000 and from 35.0000 to 36.0000"),
            "{text}"
        );
        assert!(bd_psnr(&good, &above, Method::Pchip).is_ok());
    }

    #[test]
    fn the_overlap_is_reported_as_a_share_of_both() {
        let points = |low: f64| Points::new("c", vec![(1.0, low), (10.0, low + 3.0)]).unwrap();
        let delta = bd_rate(&points(30.0), &points(31.0), Method::Pchip).unwrap();
        assert_eq!((delta.overlap, delta.overlap_share), ([31.0, 33.0], 0.5));
    }
}
