//! Estimate: a ratio from a stratified sample, with the interval that it lies in.
//!
//! A stream is cut into strata of equal length, and one segment is drawn from each at random: the
//! sample is spread like a systematic one (SMARTS, Wunderlich et al. 2003), but cannot fall into step
//! with the rows of a screen.
//!
//! The mean of y/x is the ratio of the sums (Cochran 1977, *Sampling Techniques*, chapter 6). With one
//! segment in each stratum the variance is taken between neighbours: strata collapsed in pairs (ibid.,
//! section 5A.12), of the residuals y − Rx. That errs upwards where neighbours differ. The interval
//! is Student's, with a degree of freedom for each pair. The bias of a warm-up that is too short is
//! no part of it.

use serde::Serialize;

/// The fewest pairs of segments: below them Student's distribution is too wide to be worth a sample.
pub const LEAST_PAIRS: usize = 8;

/// The share of intervals that hold the truth, if residuals are normal.
pub const CONFIDENCE: f64 = 0.95;

/// The quantile of the normal distribution for [`CONFIDENCE`] on two sides.
const NORMAL: f64 = 1.959_963_984_540_054;

/// A mean and its interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Estimate {
    /// The ratio of the sums.
    pub mean: f64,
    /// The lower end of the interval.
    pub low: f64,
    /// The upper end.
    pub high: f64,
    /// Half the interval over the mean, in percent; 0 where the mean is 0.
    pub plus_minus_percent: f64,
}

/// The ratio Σy / Σx of a sample, `pairs` being (x, y) of a segment each in the order of the strata.
/// `share` is the share of the stream that the segments cover, 0 to 1. `None` with fewer than
/// 2 · [`LEAST_PAIRS`] segments, or where nothing was asked for.
#[must_use]
pub fn ratio(pairs: &[(f64, f64)], share: f64) -> Option<Estimate> {
    let (x, y) = pairs
        .iter()
        .fold((0.0, 0.0), |sum, pair| (sum.0 + pair.0, sum.1 + pair.1));
    let degrees = pairs.len() / 2;
    if degrees < LEAST_PAIRS || x <= 0.0 {
        return None;
    }
    let mean = y / x;
    let residual = |pair: &(f64, f64)| pair.1 - mean * pair.0;
    let two_by_two = pairs.chunks_exact(2);
    // The segment that an odd number leaves over forms a pair with the one before it.
    let left_over = pairs.len() % 2;
    let last = &pairs[pairs.len() - 1 - left_over..pairs.len() - 1 + left_over];
    let squares: f64 = two_by_two
        .chain(last.chunks_exact(2))
        .map(|pair| (residual(&pair[0]) - residual(&pair[1])).powi(2))
        .sum();
    let half = student(degrees) * ((1.0 - share).max(0.0) * squares).sqrt() / x;
    Some(Estimate {
        mean,
        low: mean - half,
        high: mean + half,
        plus_minus_percent: if mean > 0.0 { 100.0 * half / mean } else { 0.0 },
    })
}

/// The two-sided quantile of Student's distribution for [`CONFIDENCE`]: Fisher's expansion about the
/// normal one (Abramowitz and Stegun 1964, 26.7.5), right to four digits from [`LEAST_PAIRS`] degrees
/// of freedom on.
fn student(degrees: usize) -> f64 {
    let (x, n) = (NORMAL, degrees as f64);
    let terms = [
        (x.powi(3) + x) / 4.0,
        (5.0 * x.powi(5) + 16.0 * x.powi(3) + 3.0 * x) / 96.0,
        (3.0 * x.powi(7) + 19.0 * x.powi(5) + 17.0 * x.powi(3) - 15.0 * x) / 384.0,
        (79.0 * x.powi(9) + 776.0 * x.powi(7) + 1482.0 * x.powi(5)
            - 1920.0 * x.powi(3)
            - 945.0 * x)
            / 92_160.0,
    ];
    let powers = (1..).map(|power| n.powi(power));
    x + terms
        .iter()
        .zip(powers)
        .map(|(term, power)| term / power)
        .sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_the_printed_tables() {
        // Abramowitz and Stegun 1964, table 26.10, P = 0.975, to three digits.
        for (degrees, printed) in [
            (8, 2.306),
            (10, 2.228),
            (16, 2.120),
            (30, 2.042),
            (120, 1.980),
        ] {
            assert_eq!((student(degrees) * 1000.0).round() / 1000.0, printed);
        }
    }

    #[test]
    fn equal_segments_have_an_interval_of_nothing_and_too_few_have_none() {
        let equal = vec![(4.0, 12.0); 16];
        let found = ratio(&equal, 0.1).unwrap();
        assert_eq!((found.mean, found.low, found.high), (3.0, 3.0, 3.0));
        assert_eq!(ratio(&equal[..15], 0.1), None);
        assert_eq!(ratio(&vec![(0.0, 0.0); 16], 0.1), None);
    }

    #[test]
    fn the_interval_is_that_of_a_sample_done_by_hand() {
        // Residuals are ±1 in each of eight pairs: squares 8 · 4, a deviation of √32 over Σx = 64.
        let pairs: Vec<(f64, f64)> = (0..16)
            .map(|n| (4.0, 8.0 + if n % 2 == 0 { 1.0 } else { -1.0 }))
            .collect();
        let half = student(8) * 32_f64.sqrt() / 64.0;
        let found = ratio(&pairs, 0.0).unwrap();
        assert_eq!((found.mean, found.low), (2.0, 2.0 - half));
        let all = ratio(&pairs, 1.0).unwrap();
        assert_eq!((all.low, all.high), (2.0, 2.0));
        // One segment more is compared with the one before it.
        let odd: Vec<(f64, f64)> = pairs.iter().copied().chain([(4.0, 8.0)]).collect();
        let half = student(8) * 33_f64.sqrt() / 68.0;
        assert_eq!(ratio(&odd, 0.0).unwrap().low, 2.0 - half);
    }
}
