//! The document: a curve as CompressAI writes and reads it.
//!
//! `{"name": …, "description": …, "meta"?: …, "results": {"bpp": […], "psnr-rgb": […], …}}`, as in
//! `results/image/kodak/*.json` of that project. ntmu's own curves have `bpp`, `bppc` (bits per
//! pixel and channel), `psnr` and `ssim`.

use super::error::CurveError;
use super::points::{Axes, Points};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use std::collections::BTreeMap;

/// A rate-distortion curve: series of finite numbers, all of one length, at least 1.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    name: String,
    description: Option<String>,
    results: BTreeMap<String, Vec<f64>>,
    /// `meta` and whatever else stood in the file; written back as it was.
    other: Map<String, Value>,
}

/// The file.
#[derive(Deserialize, Serialize)]
struct File {
    name: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    description: Option<String>,
    results: Map<String, Value>,
    #[serde(flatten)]
    other: Map<String, Value>,
}

impl Curve {
    /// A curve of these series.
    ///
    /// # Errors
    /// When there is no point, series differ in length, or a number is not finite.
    pub fn new(
        name: impl Into<String>,
        description: impl Into<String>,
        results: BTreeMap<String, Vec<f64>>,
    ) -> Result<Curve, CurveError> {
        let curve = Curve {
            name: name.into(),
            description: Some(description.into()),
            results,
            other: Map::new(),
        };
        curve.checked()
    }

    /// The curve with this `meta` field: whatever else is worth knowing of it.
    #[must_use]
    pub fn with_meta(mut self, meta: Value) -> Curve {
        self.other.insert("meta".to_owned(), meta);
        self
    }

    fn checked(self) -> Result<Curve, CurveError> {
        let curve = || self.name.clone();
        let length = self.results.values().next().map_or(0, Vec::len);
        if length == 0 {
            return Err(CurveError::Empty { curve: curve() });
        }
        for (key, series) in &self.results {
            if series.len() != length {
                return Err(CurveError::Length {
                    curve: curve(),
                    key: key.clone(),
                    found: series.len(),
                    allowed: length,
                });
            }
            if let Some(index) = series.iter().position(|value| !value.is_finite()) {
                return Err(CurveError::Value {
                    curve: curve(),
                    key: key.clone(),
                    index,
                    found: series[index].to_string(),
                    allowed: "a finite number",
                });
            }
        }
        Ok(self)
    }

    /// The curve in this text.
    ///
    /// # Errors
    /// When the text is no JSON of this form, or [`Curve::new`] would refuse its series.
    pub fn from_json(text: &str) -> Result<Curve, CurveError> {
        let file: File = serde_json::from_str(text).map_err(|error| CurveError::Document {
            found: error.to_string(),
        })?;
        let results = file
            .results
            .iter()
            .map(|(key, series)| Ok((key.clone(), numbers(&file.name, key, series)?)))
            .collect::<Result<_, CurveError>>()?;
        let curve = Curve {
            name: file.name,
            description: file.description,
            results,
            other: file.other,
        };
        curve.checked()
    }

    /// The text of the file, indented, with a line end.
    #[must_use]
    pub fn to_json(&self) -> String {
        let results = self.results.iter();
        let value = serde_json::json!(File {
            name: self.name.clone(),
            description: self.description.clone(),
            results: results
                .map(|(key, series)| (key.clone(), series.clone().into()))
                .collect(),
            other: self.other.clone(),
        });
        format!("{value:#}\n")
    }

    /// The name, as a legend shows it.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// What the file says about itself.
    #[must_use]
    pub fn description(&self) -> Option<&str> {
        self.description.as_deref()
    }

    /// The series by key.
    #[must_use]
    pub fn results(&self) -> &BTreeMap<String, Vec<f64>> {
        &self.results
    }

    /// Two of the series as points, rates ascending.
    ///
    /// # Errors
    /// When a series is missing, or a rate is not above 0.
    pub fn points(&self, axes: &Axes) -> Result<Points, CurveError> {
        let rates = self.series(&axes.rate)?;
        let metric = self.series(&axes.metric)?;
        let pairs = rates.iter().copied().zip(metric.iter().copied());
        let points = Points::new(self.name.clone(), pairs.collect())?;
        Ok(points.with_metric(axes.metric.clone()))
    }

    fn series(&self, key: &str) -> Result<&[f64], CurveError> {
        let found = self.results.get(key).map(Vec::as_slice);
        found.ok_or_else(|| CurveError::Key {
            curve: self.name.clone(),
            found: key.to_owned(),
            allowed: self.results.keys().cloned().collect(),
        })
    }
}

/// The numbers of a series; whether they are finite is checked with the rest.
fn numbers(curve: &str, key: &str, series: &Value) -> Result<Vec<f64>, CurveError> {
    let Value::Array(series) = series else {
        return Err(CurveError::Series {
            curve: curve.to_owned(),
            key: key.to_owned(),
            found: kind(series),
        });
    };
    let number = |(index, value): (usize, &Value)| {
        value.as_f64().ok_or_else(|| CurveError::Value {
            curve: curve.to_owned(),
            key: key.to_owned(),
            index,
            found: kind(value).to_owned(),
            allowed: "a number",
        })
    };
    series.iter().enumerate().map(number).collect()
}

fn kind(value: &Value) -> &'static str {
    match value {
        Value::Null => "null",
        Value::Bool(_) => "a truth value",
        Value::Number(_) => "a number",
        Value::String(_) => "a text",
        Value::Array(_) => "an array",
        Value::Object(_) => "an object",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `results/image/kodak/paper-elic2022_mse.json` of CompressAI, its first two points.
    const ELIC: &str = r#"{"name": "ELIC", "description": "read off the paper",
        "meta": {"dataset": "kodak"}, "licence": "as found",
        "results": {"bpp": [0.1235, 0.1965], "psnr-rgb": [29.113, 30.698]}}"#;

    #[test]
    fn a_curve_of_compressai_is_read_and_written_back_whole() {
        let curve = Curve::from_json(ELIC).unwrap();
        assert_eq!(
            (curve.name(), curve.description()),
            ("ELIC", Some("read off the paper"))
        );
        let written: Value = serde_json::from_str(&curve.to_json()).unwrap();
        assert_eq!(written, serde_json::from_str::<Value>(ELIC).unwrap());
        assert_eq!(Curve::from_json(&curve.to_json()).unwrap(), curve);
    }

    #[test]
    fn points_are_sorted_by_rate() {
        let text = r#"{"name": "c", "results": {"bpp": [2, 1], "psnr": [40, 30]}}"#;
        let points = Curve::from_json(text)
            .unwrap()
            .points(&Axes::default())
            .unwrap();
        assert_eq!(points.pairs(), [(1.0, 30.0), (2.0, 40.0)]);
        assert_eq!(points.name(), "c");
    }

    #[test]
    fn what_is_no_curve_is_refused_with_what_was_found() {
        let message = |text: &str| Curve::from_json(text).unwrap_err().to_string();
        assert!(message("[]").contains("allowed: an object with `name`"));
        assert!(message("{\"name\": \"c\"}").contains("missing field `results`"));
        assert!(message(r#"{"name": "c", "results": {}}"#).contains("found no point"));
        assert!(message(r#"{"name": "c", "results": {"bpp": []}}"#).contains("found no point"));
        assert!(message(r#"{"name": "c", "results": {"bpp": 1}}"#).contains("found a number"));
        assert!(
            message(r#"{"name": "c", "results": {"bpp": [1, "x"]}}"#)
                .contains("point 1: found a text; allowed: a number")
        );
        assert!(
            message(r#"{"name": "c", "results": {"bpp": [1], "psnr": [1, 2]}}"#)
                .contains("found 2 points; allowed: 1")
        );
        assert!(message(r#"{"name": "c", "results": {"bpp": [NaN]}}"#).contains("line 1"));
    }

    #[test]
    fn numbers_that_are_not_finite_are_refused() {
        let results = BTreeMap::from([("bpp".to_owned(), vec![1.0, f64::INFINITY])]);
        let error = Curve::new("c", "", results).unwrap_err().to_string();
        assert!(
            error.contains("point 1: found inf; allowed: a finite number"),
            "{error}"
        );
    }

    #[test]
    fn a_missing_series_and_a_rate_of_zero_are_refused() {
        let curve = Curve::from_json(ELIC).unwrap();
        let error = curve.points(&Axes::default()).unwrap_err().to_string();
        assert!(
            error.contains("found no series \"psnr\"; allowed: bpp, psnr-rgb"),
            "{error}"
        );
        let free = r#"{"name": "c", "results": {"bpp": [1, 0], "psnr": [2, 1]}}"#;
        let error = Curve::from_json(free).unwrap().points(&Axes::default());
        assert!(error.unwrap_err().to_string().contains("found 0"));
    }
}
