//! The table: curves as Markdown.

use super::document::Curve;
use std::collections::BTreeSet;

/// Every point of every curve, a column for each series that any of them has: rates first, the
/// others by name.
#[must_use]
pub fn markdown(curves: &[Curve]) -> String {
    let keys: BTreeSet<&str> = curves
        .iter()
        .flat_map(|curve| curve.results().keys().map(String::as_str))
        .collect();
    let (rates, others): (Vec<&str>, Vec<&str>) = keys
        .into_iter()
        .partition(|key| ["bpp", "bppc"].contains(key));
    let keys = [rates, others].concat();
    let heads: Vec<String> = keys.iter().map(|key| cell(key)).collect();
    let mut text = format!("| Curve | Point | {} |\n", heads.join(" | "));
    text += &format!("|---|---:|{}\n", "---:|".repeat(keys.len()));
    for curve in curves {
        let count = curve.results().values().next().map_or(0, Vec::len);
        for point in 0..count {
            let numbers: Vec<String> = keys
                .iter()
                .map(|key| match curve.results().get(*key) {
                    Some(series) => number(series[point]),
                    None => "—".to_owned(),
                })
                .collect();
            text += &format!(
                "| {} | {point} | {} |\n",
                cell(curve.name()),
                numbers.join(" | ")
            );
        }
    }
    text
}

/// Four digits after the point.
fn number(value: f64) -> String {
    format!("{value:.4}")
}

/// A text that stays inside its cell.
pub(crate) fn cell(text: &str) -> String {
    text.replace('|', "\\|").replace(['\n', '\r'], " ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_come_first_and_a_series_that_is_missing_is_a_dash() {
        let curve = |text| Curve::from_json(text).unwrap();
        let curves = [
            curve(r#"{"name": "a|b", "results": {"bpp": [0.25], "a-first": [1.5]}}"#),
            curve(r#"{"name": "c", "results": {"bpp": [1], "psnr": [30]}}"#),
        ];
        assert_eq!(
            markdown(&curves),
            "| Curve | Point | bpp | a-first | psnr |\n|---|---:|---:|---:|---:|\n\
             | a\\|b | 0 | 0.2500 | 1.5000 | — |\n| c | 0 | 1.0000 | — | 30.0000 |\n"
        );
    }
}
