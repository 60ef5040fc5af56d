//! Curve: a run's quality so far in one line of text.

/// Columns of the curve.
const COLUMNS: usize = 16;

/// Heights, lowest first.
const BARS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];

/// A curve that halves its resolution when it is full, so that it always shows the whole run.
#[derive(Debug)]
pub(super) struct Curve {
    points: Vec<f64>,
    /// Values that make a point, and those of the next one so far.
    each: usize,
    pending: Vec<f64>,
}

impl Curve {
    pub(super) fn new() -> Curve {
        Curve {
            points: Vec::new(),
            each: 1,
            pending: Vec::new(),
        }
    }

    pub(super) fn push(&mut self, value: f64) {
        self.pending.push(value);
        if self.pending.len() < self.each {
            return;
        }
        let mean = self.pending.iter().sum::<f64>() / self.each as f64;
        self.pending.clear();
        self.points.push(mean);
        if self.points.len() > COLUMNS {
            self.points = self
                .points
                .chunks_exact(2)
                .map(|pair| (pair[0] + pair[1]) / 2.0)
                .collect();
            self.each *= 2;
        }
    }

    /// The curve, its lowest point at the bottom and its highest at the top.
    pub(super) fn text(&self) -> String {
        let low = self.points.iter().copied().fold(f64::INFINITY, f64::min);
        let high = self
            .points
            .iter()
            .copied()
            .fold(f64::NEG_INFINITY, f64::max);
        let top = (BARS.len() - 1) as f64;
        let bar = |value: &f64| {
            let height = if high > low {
                (value - low) / (high - low)
            } else {
                0.0
            };
            BARS[(height * top).round() as usize]
        };
        self.points.iter().map(bar).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rising_run_is_a_rising_curve_of_bounded_width() {
        let mut curve = Curve::new();
        assert_eq!(curve.text(), "");
        for value in 0..1000 {
            curve.push(f64::from(value));
            let text: Vec<char> = curve.text().chars().collect();
            assert!(text.len() <= COLUMNS && text.is_sorted(), "{text:?}");
        }
        let text: Vec<char> = curve.text().chars().collect();
        assert_eq!((text[0], text[text.len() - 1]), ('▁', '█'));
    }
}
