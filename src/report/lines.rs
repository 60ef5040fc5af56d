//! Lines: a chart of several lines over a common axis, each labelled at its end.

use super::svg::{Axis, COLOURS, px, round_step};
use maud::{Markup, html};

/// One line.
pub(super) struct Series {
    /// What stands at its end.
    pub(super) label: String,
    /// Its points, along the axis; those that are not finite are left out.
    pub(super) points: Vec<(f64, f64)>,
}

/// A chart.
pub(super) struct Lines {
    /// What it shows, for readers who cannot see it.
    pub(super) title: &'static str,
    /// What the horizontal axis counts.
    pub(super) along: &'static str,
    /// What the vertical axis counts.
    pub(super) up: &'static str,
    /// Where the horizontal axis has marks, ascending.
    pub(super) ticks: Vec<f64>,
    /// The lines.
    pub(super) series: Vec<Series>,
}

/// The colours that lines use, in order: far apart for every kind of colour vision.
const LINES: [usize; 5] = [0, 3, 4, 1, 6];

impl Lines {
    /// The chart, unless no point is finite or the axis has no mark.
    pub(super) fn draw(&self) -> Option<Markup> {
        let all = self.series.iter().flat_map(|series| &series.points);
        let heights: Vec<f64> = all.map(|(_, y)| *y).filter(|y| y.is_finite()).collect();
        let (&first, &last) = (self.ticks.first()?, self.ticks.last()?);
        let low = heights.iter().copied().reduce(f64::min)?;
        let high = heights.iter().copied().fold(low, f64::max);
        let step = round_step(((high - low) / 5.0).max(0.05));
        let bottom = ((low - step * 0.25) / step).floor() * step;
        let top = ((high + step * 0.25) / step).ceil() * step;
        let up = Axis {
            values: (bottom, top),
            pixels: (250.0, 26.0),
        };
        let margin = if first == last {
            1.0
        } else {
            0.05 * (last - first)
        };
        let along = Axis {
            values: (first - margin, last + margin),
            pixels: (52.0, 450.0),
        };
        let drawn: Vec<(&str, Vec<(f64, f64)>)> = self
            .series
            .iter()
            .map(|series| {
                let finite = series.points.iter().filter(|(_, y)| y.is_finite());
                let points = finite.map(|&(x, y)| (along.at(x), up.at(y))).collect();
                (series.label.as_str(), points)
            })
            .collect();
        Some(self.svg(&drawn, along, up))
    }

    fn svg(&self, drawn: &[(&str, Vec<(f64, f64)>)], along: Axis, up: Axis) -> Markup {
        let ends = drawn.iter().filter_map(|(_, line)| line.last());
        let labels = spread(ends.map(|end| end.1).collect());
        let lines = drawn.iter().filter(|(_, line)| !line.is_empty());
        html! {
            svg viewBox="0 0 640 300" role="img" aria-label=(self.title) {
                @for (value, label) in up.ticks(5) {
                    @let y = px(up.at(value));
                    line.gridline x1="52" x2="450" y1=(y) y2=(y) {}
                    text.tick x="46" y=(y) dy="4" text-anchor="end" { (label) }
                }
                @for tick in &self.ticks {
                    text.tick x=(px(along.at(*tick))) y="267" text-anchor="middle" { (tick) }
                }
                line.baseline x1="52" x2="450" y1="250" y2="250" {}
                text.axis x="251" y="292" text-anchor="middle" { (self.along) }
                text.axis x="4" y="12" { (self.up) }
                @for (index, ((name, line), label)) in lines.zip(labels).enumerate() {
                    @let colour = LINES[index % LINES.len()] % COLOURS;
                    polyline class={ "line stroke" (colour) } points=(path(line)) {}
                    @for (x, y) in line { (marker(index, colour, *x, *y)) }
                    @if let Some((x, y)) = line.last() {
                        line.leader x1=(px(x + 6.0)) x2="462" y1=(px(*y)) y2=(px(label - 4.0)) {}
                    }
                    text.value x="466" y=(px(label)) { (name) }
                }
            }
        }
    }
}

/// Points as an attribute.
pub(super) fn path(line: &[(f64, f64)]) -> String {
    line.iter()
        .map(|(x, y)| format!("{},{}", px(*x), px(*y)))
        .collect::<Vec<_>>()
        .join(" ")
}

/// A shape per line, so that lines differ without colour.
pub(super) fn marker(index: usize, colour: usize, x: f64, y: f64) -> Markup {
    let class = format!("fill{colour}");
    let shape = |corners: &[(f64, f64)]| {
        path(
            &corners
                .iter()
                .map(|(dx, dy)| (x + dx, y + dy))
                .collect::<Vec<_>>(),
        )
    };
    html! {
        @match index % 4 {
            0 => { circle class=(class) cx=(px(x)) cy=(px(y)) r="4.5" {} }
            1 => { polygon class=(class) points=(shape(&[(-4.2, -4.2), (4.2, -4.2), (4.2, 4.2), (-4.2, 4.2)])) {} }
            2 => { polygon class=(class) points=(shape(&[(0.0, -5.5), (5.2, 4.2), (-5.2, 4.2)])) {} }
            _ => { polygon class=(class) points=(shape(&[(0.0, -5.8), (5.8, 0.0), (0.0, 5.8), (-5.8, 0.0)])) {} }
        }
    }
}

/// Baselines of labels for lines that end at these heights: at least one text line apart.
fn spread(ends: Vec<f64>) -> Vec<f64> {
    let mut order: Vec<usize> = (0..ends.len()).collect();
    order.sort_by(|a, b| ends[*a].total_cmp(&ends[*b]));
    let mut labels = vec![0.0; ends.len()];
    let mut above = f64::NEG_INFINITY;
    for index in order {
        labels[index] = (ends[index] + 4.0).max(above + 16.0);
        above = labels[index];
    }
    labels
}
