//! The matrix: every curve against every other.

use super::delta::{Delta, bd_psnr, bd_rate};
use super::error::CurveError;
use super::interpolant::Method;
use super::points::Points;
use serde::Serialize;

/// One pair of curves.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Cell {
    /// Their delta.
    Delta(Delta),
    /// Why they have none.
    None {
        /// What is wrong with the pair.
        reason: String,
    },
}

impl Cell {
    fn of(delta: Result<Delta, CurveError>) -> Cell {
        match delta {
            Ok(delta) => Cell::Delta(delta),
            Err(error) => Cell::None {
                reason: error.to_string(),
            },
        }
    }

    /// The delta, where there is one.
    #[must_use]
    pub fn value(&self) -> Option<f64> {
        match self {
            Cell::Delta(delta) => Some(delta.value),
            Cell::None { .. } => None,
        }
    }
}

/// Every curve against every other: a row an anchor, a column a test.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Matrix {
    /// How the curves were interpolated.
    pub method: Method,
    /// The metric of the curves.
    pub metric: String,
    /// The curves, in the order of rows and columns.
    pub names: Vec<String>,
    /// BD-rates in percent, \[anchor\]\[test\].
    pub rates: Vec<Vec<Cell>>,
    /// BD-PSNRs in the metric's unit, \[anchor\]\[test\].
    pub psnrs: Vec<Vec<Cell>>,
}

/// The deltas of every pair; a curve against itself included, which is 0 where it has one at all.
#[must_use]
pub fn matrix(curves: &[Points], method: Method) -> Matrix {
    let all = |delta: fn(&Points, &Points, Method) -> Result<Delta, CurveError>| {
        let row = |anchor| {
            let tests = curves.iter();
            tests
                .map(|test| Cell::of(delta(anchor, test, method)))
                .collect()
        };
        curves.iter().map(row).collect()
    };
    Matrix {
        method,
        metric: curves
            .first()
            .map_or_else(String::new, |curve| curve.metric().to_owned()),
        names: curves.iter().map(|curve| curve.name().to_owned()).collect(),
        rates: all(bd_rate),
        psnrs: all(bd_psnr),
    }
}

impl Matrix {
    /// Both tables, with what stands behind a dash below.
    #[must_use]
    pub fn markdown(&self) -> String {
        let mut text = String::new();
        let mut reasons = Vec::new();
        let (metric, unit, digits) = metric_terms(&self.metric);
        for (title, cells, unit, digits) in [
            ("BD-rate", &self.rates, "%", 2),
            (metric.as_str(), &self.psnrs, unit, digits),
        ] {
            text += &format!(
                "| {title} ({}), anchor | {} |\n",
                self.method.name(),
                self.heads()
            );
            text += &format!("|---|{}\n", "---:|".repeat(self.names.len()));
            for (anchor, (name, row)) in self.names.iter().zip(cells).enumerate() {
                let cells: Vec<String> = row.iter().map(|cell| shown(cell, unit, digits)).collect();
                text += &format!("| {} | {} |\n", super::table::cell(name), cells.join(" | "));
                // The pair the other way round has none for the same reason.
                for cell in &row[anchor..] {
                    if let Cell::None { reason } = cell
                        && !reasons.contains(reason)
                    {
                        reasons.push(reason.clone());
                    }
                }
            }
            text.push('\n');
        }
        for reason in reasons {
            text += &format!("- {reason}\n");
        }
        text.trim_end().to_owned() + "\n"
    }

    fn heads(&self) -> String {
        let names: Vec<String> = self.names.iter().map(|n| super::table::cell(n)).collect();
        names.join(" | ")
    }
}

/// The name of a delta of a metric, its unit, and digits after the point.
fn metric_terms(metric: &str) -> (String, &'static str, usize) {
    if metric == "psnr" {
        ("BD-PSNR".to_owned(), " dB", 2)
    } else {
        (format!("BD of {}", super::table::cell(metric)), "", 4)
    }
}

/// A delta with its sign, and the overlap where it is below the three quarters under which PyPI's
/// bjontegaard warns.
fn shown(cell: &Cell, unit: &str, digits: usize) -> String {
    match cell {
        Cell::None { .. } => "—".to_owned(),
        Cell::Delta(delta) if delta.overlap_share < 0.75 => format!(
            "{:+.digits$}{unit} (overlap {:.0}%)",
            delta.value,
            100.0 * delta.overlap_share
        ),
        Cell::Delta(delta) => format!("{:+.digits$}{unit}", delta.value),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pair_stands_in_its_row_and_column() {
        let points = |name: &str, scale: f64| {
            Points::new(name, vec![(scale, 30.0), (2.0 * scale, 33.0)]).unwrap()
        };
        let alone = Points::new("alone", vec![(1.0, 30.0)]).unwrap();
        let curves = [points("a", 1.0), points("b", 2.0), alone];
        let found = matrix(&curves, Method::Pchip);
        assert_eq!(found.names, ["a", "b", "alone"]);
        for (row, anchor) in curves.iter().enumerate() {
            for (column, test) in curves.iter().enumerate() {
                let rate = bd_rate(anchor, test, Method::Pchip).ok();
                let psnr = bd_psnr(anchor, test, Method::Pchip).ok();
                assert_eq!(found.rates[row][column].value(), rate.map(|d| d.value));
                assert_eq!(found.psnrs[row][column].value(), psnr.map(|d| d.value));
            }
        }
        let text = found.markdown();
        assert!(text.contains("| a | +0.00% | +100.00% | — |"), "{text}");
        assert!(
            text.contains("found 1 points; allowed with pchip: at least 2"),
            "{text}"
        );
    }

    #[test]
    fn a_pair_without_overlap_is_explained_once_for_each_axis() {
        let points = |name: &str, rate: f64, metric: f64| {
            Points::new(name, vec![(rate, metric), (2.0 * rate, metric + 1.0)]).unwrap()
        };
        let curves = [points("a", 0.5, 30.0), points("b", 4.0, 40.0)];
        let text = matrix(&curves, Method::Pchip).markdown();
        let reasons: Vec<&str> = text.lines().filter(|l| l.starts_with("- ")).collect();
        let of = |along: &str| {
            format!("- curves \"a\" and \"b\": found {along}; allowed: intervals that overlap")
        };
        let expected = [
            of("metric from 30.0000 to 31.0000 and from 40.0000 to 41.0000"),
            of("rate from 0.5000 to 1.0000 and from 4.0000 to 8.0000"),
        ];
        assert_eq!(reasons, expected);
    }
}
