//! What is wrong with a curve.

/// Why a curve cannot be read, or has no Bjøntegaard delta.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CurveError {
    /// The text is not a curve's JSON.
    #[error(
        "curve: found {found}; allowed: an object with `name`, optionally `description`, and \
         `results`, an object of arrays of numbers"
    )]
    Document {
        /// What the reader met.
        found: String,
    },
    /// A series holds something else than finite numbers.
    #[error("curve {curve:?}, series {key:?}, point {index}: found {found}; allowed: {allowed}")]
    Value {
        /// The curve's name.
        curve: String,
        /// The series.
        key: String,
        /// The place in it, from 0.
        index: usize,
        /// What is there.
        found: String,
        /// What may be there.
        allowed: &'static str,
    },
    /// A series is no array.
    #[error("curve {curve:?}, series {key:?}: found {found}; allowed: an array of numbers")]
    Series {
        /// The curve's name.
        curve: String,
        /// The series.
        key: String,
        /// What is there.
        found: &'static str,
    },
    /// Series of one curve differ in length.
    #[error(
        "curve {curve:?}, series {key:?}: found {found} points; allowed: {allowed}, as many as \
         its other series have"
    )]
    Length {
        /// The curve's name.
        curve: String,
        /// The series.
        key: String,
        /// Its length.
        found: usize,
        /// The length of the others.
        allowed: usize,
    },
    /// A curve has no series, or no point.
    #[error("curve {curve:?}: found no point; allowed: at least 1")]
    Empty {
        /// The curve's name.
        curve: String,
    },
    /// A series was asked for that the curve lacks.
    #[error("curve {curve:?}: found no series {found:?}; allowed: {}", .allowed.join(", "))]
    Key {
        /// The curve's name.
        curve: String,
        /// The series asked for.
        found: String,
        /// Those it has.
        allowed: Vec<String>,
    },
    /// Too few points for the interpolation.
    #[error("curve {curve:?}: found {found} points; allowed with {method}: at least {allowed}")]
    TooFew {
        /// The curve's name.
        curve: String,
        /// The method's name.
        method: &'static str,
        /// How many points there are.
        found: usize,
        /// How many it takes.
        allowed: usize,
    },
    /// A dearer point is not a better one.
    #[error(
        "curve {curve:?}, points {} and {index} by rate: found {found:?} after {before:?}; \
         allowed: rate and metric both greater", .index - 1
    )]
    NotRising {
        /// The curve's name.
        curve: String,
        /// The second of the two points, from 0, rates ascending.
        index: usize,
        /// The first point: rate, metric.
        before: (f64, f64),
        /// The second point.
        found: (f64, f64),
    },
    /// Two curves have no interval in common.
    #[error(
        "curves {anchor:?} and {test:?}: found {along} from {:.4} to {:.4} and from {:.4} to {:.4}; \
         allowed: intervals that overlap",
        .anchor_range[0], .anchor_range[1], .test_range[0], .test_range[1]
    )]
    NoOverlap {
        /// The anchor's name.
        anchor: String,
        /// The test curve's name.
        test: String,
        /// Along which axis: `metric` or `rate`.
        along: &'static str,
        /// The anchor's interval.
        anchor_range: [f64; 2],
        /// The test curve's interval.
        test_range: [f64; 2],
    },
    /// Nothing to draw.
    #[error("chart: found no curve; allowed: at least 1")]
    Nothing,
    /// The picture could not be encoded.
    #[error("chart: found {found}; allowed: a picture that can be written as PNG")]
    Picture {
        /// What the encoder met.
        found: String,
    },
}
