//! Points: two series of a curve, one of them the rate.

use super::error::CurveError;

/// Which series of a curve are its axes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Axes {
    /// The key of the rate, in bits per something.
    pub rate: String,
    /// The key of the metric; more is better.
    pub metric: String,
}

/// `bpp` and `psnr`.
impl Default for Axes {
    fn default() -> Axes {
        Axes {
            rate: "bpp".to_owned(),
            metric: "psnr".to_owned(),
        }
    }
}

/// Points (rate, metric), rates above 0 and ascending, metrics finite; at least one.
#[derive(Clone, Debug, PartialEq)]
pub struct Points {
    name: String,
    metric: String,
    pairs: Vec<(f64, f64)>,
}

impl Points {
    /// Points in any order. Those of one rate are sorted by their metric.
    ///
    /// # Errors
    /// When there is none, a rate is not above 0, or a number is not finite.
    pub fn new(name: impl Into<String>, mut pairs: Vec<(f64, f64)>) -> Result<Points, CurveError> {
        let curve = name.into();
        if pairs.is_empty() {
            return Err(CurveError::Empty { curve });
        }
        for (index, (rate, metric)) in pairs.iter().enumerate() {
            let (key, found, allowed) = if !(rate.is_finite() && *rate > 0.0) {
                ("rate", rate, "a finite number above 0")
            } else if !metric.is_finite() {
                ("metric", metric, "a finite number")
            } else {
                continue;
            };
            return Err(CurveError::Value {
                curve,
                key: key.to_owned(),
                index,
                found: found.to_string(),
                allowed,
            });
        }
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
        Ok(Points {
            name: curve,
            metric: Axes::default().metric,
            pairs,
        })
    }

    /// The points as those of another metric than PSNR, by its key.
    #[must_use]
    pub fn with_metric(mut self, metric: impl Into<String>) -> Points {
        self.metric = metric.into();
        self
    }

    /// The key of the metric, `psnr` if nothing else was said.
    #[must_use]
    pub fn metric(&self) -> &str {
        &self.metric
    }

    /// The curve's name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// (rate, metric), rates ascending.
    #[must_use]
    pub fn pairs(&self) -> &[(f64, f64)] {
        &self.pairs
    }

    /// The second point, by its index, that is not above the one before it in rate and metric.
    pub(super) fn first_fall(&self) -> Option<usize> {
        let falls = |pair: &[(f64, f64)]| pair[1].0 <= pair[0].0 || pair[1].1 <= pair[0].1;
        self.pairs.windows(2).position(falls).map(|at| at + 1)
    }
}
