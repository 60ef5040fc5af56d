//! Curves: a chart of several lines over powers of two, each labelled at its end.

use super::lines::{marker, path};
use super::number::{decimal, significant};
use super::svg::{Axis, COLOURS, px, round_step};
use maud::{Markup, html};

/// One curve.
pub(super) struct Curve {
    /// What stands at its end.
    pub(super) label: String,
    /// Which of the page's colours.
    pub(super) colour: usize,
    /// Whether it is dashed, as the counterpart of one of the same colour.
    pub(super) is_dashed: bool,
    /// Its points, x ascending and positive; those that are not finite are left out.
    pub(super) points: Vec<(f64, f64)>,
}

/// What the vertical axis looks like.
#[derive(Clone, Copy)]
pub(super) enum Up {
    /// From zero.
    FromZero,
    /// Logarithmic, as far as the points go.
    Logarithmic,
}

/// A chart.
pub(super) struct Curves {
    /// What it shows, for readers who cannot see it.
    pub(super) title: String,
    /// What the horizontal axis counts.
    pub(super) along: &'static str,
    /// What the vertical axis counts.
    pub(super) up: &'static str,
    /// Its kind.
    pub(super) scale: Up,
    /// Where the horizontal axis has marks, ascending, with their labels.
    pub(super) ticks: Vec<(f64, String)>,
    /// A height worth a line of its own, and what it is.
    pub(super) reference: Option<(f64, &'static str)>,
    /// The curves.
    pub(super) curves: Vec<Curve>,
}

/// Left, right, top and bottom of the drawing, in pixels.
const BOX: (f64, f64, f64, f64) = (52.0, 440.0, 26.0, 250.0);

/// A curve as drawn.
type Drawn<'a> = (&'a Curve, Vec<(f64, f64)>);

impl Curves {
    /// The chart, unless no point is finite or the axis has no mark.
    pub(super) fn draw(&self) -> Option<Markup> {
        let all = self.curves.iter().flat_map(|curve| &curve.points);
        let heights: Vec<f64> = all.map(|(_, y)| *y).filter(|y| self.is_shown(*y)).collect();
        let (first, last) = (self.ticks.first()?.0, self.ticks.last()?.0);
        let low = heights.iter().copied().reduce(f64::min)?;
        let high = heights.iter().copied().fold(low, f64::max);
        let (values, marks) = match self.scale {
            Up::FromZero => {
                let step = round_step(high.max(f64::MIN_POSITIVE) / 5.0);
                let up = Axis {
                    values: (0.0, (high / step).ceil() * step),
                    pixels: (0.0, 1.0),
                };
                (up.values, up.ticks(5))
            }
            Up::Logarithmic => {
                let (low, high) = (low.log10() - 0.05, high.log10() + 0.05);
                ((low, high), logarithmic_ticks(low, high))
            }
        };
        let up = Axis {
            values,
            pixels: (BOX.3, BOX.2),
        };
        let along = Axis {
            values: (first.log2() - 0.2, last.log2() + 0.2),
            pixels: (BOX.0, BOX.1),
        };
        let mut drawn: Vec<Drawn<'_>> = Vec::new();
        for curve in &self.curves {
            let shown = curve.points.iter().filter(|(_, y)| self.is_shown(*y));
            let at = |&(x, y): &(f64, f64)| (along.at(f64::log2(x)), up.at(self.height(y)));
            drawn.push((curve, shown.map(at).collect()));
        }
        drawn.retain(|(_, points)| !points.is_empty());
        Some(self.svg(&drawn, along, up, &marks))
    }

    fn is_shown(&self, y: f64) -> bool {
        match self.scale {
            Up::FromZero => y.is_finite(),
            Up::Logarithmic => y.is_finite() && y > 0.0,
        }
    }

    fn height(&self, y: f64) -> f64 {
        match self.scale {
            Up::FromZero => y,
            Up::Logarithmic => y.log10(),
        }
    }

    fn svg(&self, drawn: &[Drawn<'_>], along: Axis, up: Axis, marks: &[(f64, String)]) -> Markup {
        let (left, right, _, bottom) = BOX;
        let ends = drawn.iter().filter_map(|(_, points)| points.last());
        let labels = spaced(ends.map(|end| end.1 + 4.0).collect());
        html! {
            svg viewBox="0 0 640 300" role="img" aria-label=(self.title) {
                @for (value, label) in marks {
                    @let y = px(up.at(*value));
                    line.gridline x1=(px(left)) x2=(px(right)) y1=(y) y2=(y) {}
                    text.tick x=(px(left - 6.0)) y=(y) dy="4" text-anchor="end" { (label) }
                }
                @for (value, label) in &self.ticks {
                    text.tick x=(px(along.at(value.log2()))) y="267" text-anchor="middle" { (label) }
                }
                line.baseline x1=(px(left)) x2=(px(right)) y1=(px(bottom)) y2=(px(bottom)) {}
                text.axis x=(px((left + right) / 2.0)) y="292" text-anchor="middle" { (self.along) }
                text.axis x="4" y="12" { (self.up) }
                @if let Some((height, name)) = self.reference {
                    @let y = up.at(self.height(height));
                    line.reference x1=(px(left)) x2=(px(right)) y1=(px(y)) y2=(px(y)) {}
                    text.tick x=(px(left + 4.0)) y=(px(y - 5.0)) { (name) }
                }
                @for (index, ((curve, points), label)) in drawn.iter().zip(labels).enumerate() {
                    @let colour = curve.colour % COLOURS;
                    polyline class=(line_class(colour, curve.is_dashed)) points=(path(points)) {}
                    @for (x, y) in points { (marker(index, colour, *x, *y)) }
                    @if let Some((x, y)) = points.last() {
                        line.leader x1=(px(x + 6.0)) x2="456" y1=(px(*y)) y2=(px(label - 4.0)) {}
                    }
                    text.value x="460" y=(px(label)) { (curve.label) }
                }
            }
        }
    }
}

/// The class of a line in a colour, whole or dashed.
pub(super) fn line_class(colour: usize, is_dashed: bool) -> String {
    let dashed = if is_dashed { " dashed" } else { "" };
    format!("line stroke{colour}{dashed}")
}

/// Marks at 1, 2 and 5 times powers of ten, or at powers of ten alone where that would be many.
pub(crate) fn logarithmic_ticks(low: f64, high: f64) -> Vec<(f64, String)> {
    let factors: &[f64] = if high - low > 2.5 {
        &[1.0]
    } else {
        &[1.0, 2.0, 5.0]
    };
    (low.floor() as i32..=high.ceil() as i32)
        .flat_map(|power| {
            factors
                .iter()
                .map(move |factor| factor * 10_f64.powi(power))
        })
        .map(|value| (value.log10(), power_label(value)))
        .filter(|(place, _)| (low..=high).contains(place))
        .collect()
}

/// A round number without digits that say nothing.
fn power_label(value: f64) -> String {
    if value >= 1.0 {
        decimal(value, 0)
    } else {
        let digits = (-value.log10()).ceil().clamp(0.0, 9.0);
        let text = decimal(value, digits as usize);
        if text.parse::<f64>() == Ok(0.0) {
            significant(value)
        } else {
            text
        }
    }
}

/// Pixels from one label's baseline to the next.
const LABEL: f64 = 16.0;

/// Baselines near these heights: one text line apart, none below the drawing if there is room above.
fn spaced(ends: Vec<f64>) -> Vec<f64> {
    let mut order: Vec<usize> = (0..ends.len()).collect();
    order.sort_by(|a, b| ends[*a].total_cmp(&ends[*b]));
    let mut labels = ends;
    let mut above = f64::NEG_INFINITY;
    for &index in &order {
        labels[index] = labels[index].max(above + LABEL);
        above = labels[index];
    }
    let mut below = BOX.3 + LABEL;
    for &index in order.iter().rev() {
        labels[index] = labels[index].min(below - LABEL);
        below = labels[index];
    }
    labels
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_are_a_line_apart_and_within_the_drawing_while_there_is_room() {
        for count in 1..14_usize {
            let labels = spaced(vec![BOX.3; count]);
            let mut sorted = labels;
            sorted.sort_by(f64::total_cmp);
            assert_eq!(sorted[count - 1], BOX.3);
            assert!(sorted.windows(2).all(|pair| pair[1] - pair[0] == LABEL));
        }
    }

    #[test]
    fn logarithmic_marks_are_round_and_within_the_axis() {
        let labels = |low, high| -> Vec<String> {
            let ticks = logarithmic_ticks(low, high).into_iter();
            ticks.map(|(_, label)| label).collect()
        };
        assert_eq!(
            labels(-1.0, 1.0),
            ["0.1", "0.2", "0.5", "1", "2", "5", "10"]
        );
        assert_eq!(labels(-0.5, 3.1), ["1", "10", "100", "1,000"]);
    }
}
