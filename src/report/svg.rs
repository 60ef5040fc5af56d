//! What the charts share: an axis, its ticks, and coordinates with one digit behind the point.
//!
//! Charts are written as SVG inside the page, with classes instead of colours, so that they
//! follow the page from light to dark.

/// Categories that have a colour of their own; later ones repeat the colours, hatched.
pub(super) const COLOURS: usize = 8;

/// The class that paints category `index`.
pub(super) fn fill(index: usize) -> String {
    format!("fill{}", index % COLOURS)
}

/// A linear map from values to pixels.
#[derive(Clone, Copy)]
pub(crate) struct Axis {
    /// The values at both ends; they differ.
    pub(crate) values: (f64, f64),
    /// The pixels at both ends.
    pub(crate) pixels: (f64, f64),
}

impl Axis {
    /// Where a value lies.
    pub(crate) fn at(&self, value: f64) -> f64 {
        let share = (value - self.values.0) / (self.values.1 - self.values.0);
        self.pixels.0 + share * (self.pixels.1 - self.pixels.0)
    }

    /// About `wanted` round values from end to end, each with its label.
    pub(crate) fn ticks(&self, wanted: u32) -> Vec<(f64, String)> {
        let (low, high) = self.values;
        let step = round_step((high - low) / f64::from(wanted));
        let digits = (-step.log10().floor()).clamp(0.0, 9.0) as usize;
        let (first, last) = (
            (low / step).ceil() as i64,
            (high / step + 1e-9).floor() as i64,
        );
        (first..=last)
            .map(|index| index as f64 * step)
            .map(|value| (value, super::number::decimal(value, digits)))
            .collect()
    }
}

/// The first of 1, 2, 5 times a power of ten that is not less.
pub(super) fn round_step(least: f64) -> f64 {
    let power = 10_f64.powf(least.log10().floor());
    let factors = [1.0, 2.0, 5.0];
    factors
        .into_iter()
        .map(|f| f * power)
        .find(|s| *s >= least * (1.0 - 1e-9))
        .unwrap_or(10.0 * power)
}

/// A coordinate.
pub(crate) fn px(value: f64) -> String {
    let text = format!("{value:.1}");
    if text == "-0.0" {
        "0.0".to_owned()
    } else {
        text
    }
}

/// The text cut to `most` characters, for labels that must not run into a chart.
pub(crate) fn shortened(text: &str, most: usize) -> String {
    if text.chars().count() <= most {
        return text.to_owned();
    }
    text.chars()
        .take(most.saturating_sub(1))
        .chain(['…'])
        .collect()
}
