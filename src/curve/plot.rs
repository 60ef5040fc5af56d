//! The plot: curves over a logarithmic rate, with a legend beside them.

use super::error::CurveError;
use super::points::Points;
use crate::drawing::{Anchor, CURVES, Drawing, INK, Item, LETTER, Marker, RULE, SOFT};
use crate::report::{Axis, logarithmic_ticks, shortened};

/// What stands at the chart's axes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Labels {
    /// Above the chart.
    pub title: String,
    /// Below the rates.
    pub rate: String,
    /// Above the metric.
    pub metric: String,
}

/// Left, right, top and bottom of the drawing.
const BOX: (f64, f64, f64, f64) = (60.0, 500.0, 52.0, 350.0);
const SIZE: (u32, u32) = (720, 400);
/// Letters that a name in the legend may have.
const NAME: usize = 36;
/// Rates are at least this far apart from end to end, in powers of ten.
const MARGIN: f64 = 0.05;

/// The chart as a file that needs nothing else.
///
/// # Errors
/// When there is no curve.
pub fn plot_svg(curves: &[Points], labels: &Labels) -> Result<String, CurveError> {
    Ok(chart(curves, labels)?.svg())
}

/// The chart as a PNG of 1440 × 800 pixels; taller where the legend needs it.
///
/// # Errors
/// When there is no curve, or the picture cannot be encoded.
pub fn plot_png(curves: &[Points], labels: &Labels) -> Result<Vec<u8>, CurveError> {
    let encoded = chart(curves, labels)?.png();
    encoded.map_err(|error| CurveError::Picture {
        found: error.to_string(),
    })
}

fn chart(curves: &[Points], labels: &Labels) -> Result<Drawing, CurveError> {
    let all = || curves.iter().flat_map(Points::pairs);
    let (along, along_ticks) =
        rate_axis(all().map(|pair| pair.0.log10())).ok_or(CurveError::Nothing)?;
    let (up, up_ticks) = metric_axis(all().map(|pair| pair.1)).ok_or(CurveError::Nothing)?;
    let legend_bottom = BOX.2 + 16.0 * curves.len() as f64;
    let height = SIZE.1.max(legend_bottom.ceil() as u32);
    let mut chart = Drawing::new(labels.title.clone(), (SIZE.0, height));
    let (left, right, top, bottom) = BOX;
    for (place, label) in up_ticks {
        let y = up.at(place);
        chart.line((left, y), (right, y), RULE);
        chart.text((left - 6.0, y + 3.5), label, Anchor::End, SOFT);
    }
    for (place, label) in along_ticks {
        let x = along.at(place);
        chart.line((x, top), (x, bottom), RULE);
        chart.text((x, bottom + 16.0), label, Anchor::Middle, SOFT);
    }
    chart.line((left, bottom), (right, bottom), SOFT);
    chart.text((left, 20.0), labels.title.clone(), Anchor::Start, INK);
    chart.text((left, 42.0), labels.metric.clone(), Anchor::Start, SOFT);
    let middle = (left + right) / 2.0;
    chart.text(
        (middle, bottom + 36.0),
        labels.rate.clone(),
        Anchor::Middle,
        SOFT,
    );
    for (index, curve) in curves.iter().enumerate() {
        let colour = CURVES[index % CURVES.len()];
        let marker = Marker::ALL[index % Marker::ALL.len()];
        let pairs = curve.pairs().iter();
        let points: Vec<(f64, f64)> = pairs
            .map(|(rate, metric)| (along.at(rate.log10()), up.at(*metric)))
            .collect();
        let marks = points.iter().map(|at| Item::Mark {
            at: *at,
            marker,
            colour,
        });
        let marks: Vec<Item> = marks.collect();
        chart.items.push(Item::Path {
            points,
            colour,
            width: 2.0,
        });
        chart.items.extend(marks);
        let at = (right + 18.0, BOX.2 + 16.0 * index as f64);
        chart.items.push(Item::Mark { at, marker, colour });
        let name = shortened(curve.name(), NAME);
        chart.text((at.0 + 2.0 * LETTER, at.1 + 3.5), name, Anchor::Start, INK);
    }
    Ok(chart)
}

type Ticks = Vec<(f64, String)>;

fn ends(values: impl Iterator<Item = f64> + Clone) -> Option<(f64, f64)> {
    let low = values.clone().reduce(f64::min)?;
    Some((low, values.fold(low, f64::max)))
}

/// The axis of log10 rate. Where round numbers to the power of ten are too far apart, it has linear
/// ones.
fn rate_axis(logs: impl Iterator<Item = f64> + Clone) -> Option<(Axis, Ticks)> {
    let (low, high) = ends(logs)?;
    let values = (low - MARGIN, high + MARGIN);
    let axis = Axis {
        values,
        pixels: (BOX.0, BOX.1),
    };
    let ticks = logarithmic_ticks(values.0, values.1);
    if ticks.len() > 1 {
        return Some((axis, ticks));
    }
    let linear = Axis {
        values: (10_f64.powf(values.0), 10_f64.powf(values.1)),
        pixels: axis.pixels,
    };
    let ticks = linear.ticks(5).into_iter();
    Some((
        axis,
        ticks.map(|(rate, label)| (rate.log10(), label)).collect(),
    ))
}

fn metric_axis(metrics: impl Iterator<Item = f64> + Clone) -> Option<(Axis, Ticks)> {
    let (low, high) = ends(metrics)?;
    // One metric for all is still drawn in the middle of something.
    let margin = if high > low {
        0.05 * (high - low)
    } else {
        low.abs().max(1.0) * 0.01
    };
    let axis = Axis {
        values: (low - margin, high + margin),
        pixels: (BOX.3, BOX.2),
    };
    let ticks = axis.ticks(6);
    Some((axis, ticks))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels() -> Labels {
        Labels {
            title: "a < b".to_owned(),
            rate: "bits".to_owned(),
            metric: "dB".to_owned(),
        }
    }

    fn curve(name: &str, pairs: &[(f64, f64)]) -> Points {
        Points::new(name, pairs.to_vec()).unwrap()
    }

    #[test]
    fn equal_steps_of_rate_are_equal_ratios() {
        let chart = chart(
            &[curve("c", &[(0.1, 30.0), (0.2, 31.0), (0.4, 33.0)])],
            &labels(),
        )
        .unwrap();
        let path = chart.items.iter().find_map(|item| match item {
            Item::Path { points, width, .. } if *width == 2.0 => Some(points.clone()),
            Item::Path { .. } | Item::Mark { .. } | Item::Box { .. } | Item::Text { .. } => None,
        });
        let path = path.unwrap();
        let (first, second) = (path[1].0 - path[0].0, path[2].0 - path[1].0);
        // Coordinates below 1000, a dozen roundings.
        assert!((first - second).abs() < 12.0 * 1000.0 * f64::EPSILON);
        assert!(path.windows(2).all(|p| p[1].1 < p[0].1), "better is higher");
    }

    #[test]
    fn every_curve_is_named_and_nothing_leaves_the_page() {
        let curves: Vec<Points> = (0..30)
            .map(|i| curve(&format!("curve {i}"), &[(1.0 + f64::from(i), 30.0)]))
            .collect();
        let svg = plot_svg(&curves, &labels()).unwrap();
        assert!((0..30).all(|i| svg.contains(&format!(">curve {i}<"))));
        assert!(svg.contains("a &lt; b"));
        let drawn = chart(&curves, &labels()).unwrap();
        for item in &drawn.items {
            if let Item::Text { at, .. } = item {
                assert!((0.0..f64::from(drawn.size.0)).contains(&at.0));
                assert!((0.0..f64::from(drawn.size.1)).contains(&at.1));
            }
        }
    }

    #[test]
    fn narrow_ranges_of_rate_have_marks_too() {
        let drawn = rate_axis([0.30_f64.log10(), 0.31_f64.log10()].into_iter()).unwrap();
        assert!(drawn.1.len() > 1);
        assert_eq!(plot_svg(&[], &labels()), Err(CurveError::Nothing));
    }

    #[test]
    fn a_png_has_two_pixels_a_unit() {
        let png = plot_png(&[curve("c", &[(1.0, 30.0)])], &labels()).unwrap();
        let picture = image::load_from_memory(&png).unwrap();
        assert_eq!(
            (picture.width(), picture.height()),
            (2 * SIZE.0, 2 * SIZE.1)
        );
    }
}
