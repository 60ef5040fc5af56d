//! The interpolant: a curve through points, from cubics that agree in value and slope.

use serde::Serialize;

/// How the slopes at the points are chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Monotone: the weighted harmonic mean of the slopes on both sides (Fritsch and Butland 1984,
    /// in the family of Fritsch and Carlson 1980), three-point ends kept in shape. What
    /// SciPy's `PchipInterpolator`, MATLAB's `pchip` and JVET's sheet do.
    #[default]
    Pchip,
    /// After Akima (J. ACM 17, 1970): slopes weighted by how much the others bend. What SciPy's
    /// `Akima1DInterpolator` does.
    Akima,
}

impl Method {
    /// Every method.
    pub const ALL: [Method; 2] = [Method::Pchip, Method::Akima];

    /// The name in options, tables and JSON.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Method::Pchip => "pchip",
            Method::Akima => "akima",
        }
    }

    /// Points that it takes: two have a line between them, which is all that PCHIP needs; Akima
    /// continues the bend of three beyond the ends.
    #[must_use]
    pub const fn least_points(self) -> usize {
        match self {
            Method::Pchip => 2,
            Method::Akima => 3,
        }
    }
}

/// Cubics between knots (x, y), x ascending.
#[derive(Clone, Debug)]
pub(super) struct Interpolant {
    knots: Vec<(f64, f64)>,
    slopes: Vec<f64>,
}

impl Interpolant {
    /// Through at least [`Method::least_points`] knots, x strictly ascending.
    pub(super) fn new(knots: Vec<(f64, f64)>, method: Method) -> Interpolant {
        let widths: Vec<f64> = knots.windows(2).map(|k| k[1].0 - k[0].0).collect();
        let rises = knots.windows(2).map(|k| k[1].1 - k[0].1);
        let secants: Vec<f64> = rises
            .zip(&widths)
            .map(|(rise, width)| rise / width)
            .collect();
        let slopes = match method {
            Method::Pchip => pchip_slopes(&widths, &secants),
            Method::Akima => akima_slopes(&secants),
        };
        Interpolant { knots, slopes }
    }

    /// The integral from `low` to `high`, both between the first and the last knot.
    pub(super) fn integral(&self, low: f64, high: f64) -> f64 {
        let pieces = self.knots.windows(2).zip(self.slopes.windows(2));
        pieces
            .map(|(knots, slopes)| {
                let (start, end) = (low.max(knots[0].0), high.min(knots[1].0));
                if start < end {
                    piece_integral(knots, slopes, start, end)
                } else {
                    0.0
                }
            })
            .sum()
    }
}

/// The integral of one cubic, from its coefficients about the left knot.
fn piece_integral(knots: &[(f64, f64)], slopes: &[f64], start: f64, end: f64) -> f64 {
    let ((x, y), width) = (knots[0], knots[1].0 - knots[0].0);
    let secant = (knots[1].1 - y) / width;
    let bend = slopes[0] + slopes[1] - 2.0 * secant;
    let coefficients = [
        y,
        slopes[0],
        (secant - slopes[0] - bend) / width,
        bend / (width * width),
    ];
    let upto = |place: f64| {
        let t = place - x;
        // y·t + s·t²/2 + …, innermost first.
        let terms = coefficients.iter().zip([1.0, 2.0, 3.0, 4.0]).rev();
        terms.fold(0.0, |sum, (coefficient, order)| {
            t * (coefficient / order + sum)
        })
    };
    upto(end) - upto(start)
}

fn pchip_slopes(widths: &[f64], secants: &[f64]) -> Vec<f64> {
    if let [only] = secants {
        return vec![*only; 2];
    }
    let inner = widths.windows(2).zip(secants.windows(2)).map(|(h, m)| {
        // A turn or a level stretch has slope 0.
        if m[0] * m[1] <= 0.0 {
            return 0.0;
        }
        let (before, after) = (2.0 * h[1] + h[0], h[1] + 2.0 * h[0]);
        (before + after) / (before / m[0] + after / m[1])
    });
    let last = secants.len() - 1;
    let first = end_slope([widths[0], widths[1]], [secants[0], secants[1]]);
    let mut slopes = vec![first];
    slopes.extend(inner);
    slopes.push(end_slope(
        [widths[last], widths[last - 1]],
        [secants[last], secants[last - 1]],
    ));
    slopes
}

/// The slope of the parabola through the three outermost points, cut back where it would leave
/// the shape of the data. The outermost interval comes first.
fn end_slope(widths: [f64; 2], secants: [f64; 2]) -> f64 {
    let sum = widths[0] + widths[1];
    let slope = ((widths[0] + sum) * secants[0] - widths[0] * secants[1]) / sum;
    if slope * secants[0] <= 0.0 {
        0.0
    } else if secants[0] * secants[1] <= 0.0 && slope.abs() > 3.0 * secants[0].abs() {
        3.0 * secants[0]
    } else {
        slope
    }
}

fn akima_slopes(secants: &[f64]) -> Vec<f64> {
    // Two more secants on either side, each continuing the bend of the two before it.
    let [first, second] = [secants[0], secants[1]];
    let [last, before] = [secants[secants.len() - 1], secants[secants.len() - 2]];
    let mut m = vec![3.0 * first - 2.0 * second, 2.0 * first - second];
    m.extend_from_slice(secants);
    m.extend([2.0 * last - before, 3.0 * last - 2.0 * before]);
    let weights: Vec<[f64; 2]> = m
        .windows(4)
        .map(|m| [(m[3] - m[2]).abs(), (m[1] - m[0]).abs()])
        .collect();
    let most = weights.iter().map(|[a, b]| a + b).fold(0.0, f64::max);
    // Where neither side bends the weights say nothing; SciPy's threshold for that.
    let least = 1e-9 * most;
    m.windows(4)
        .zip(&weights)
        .map(|(m, [after, before])| {
            if after + before > least {
                m[1] + before / (after + before) * (m[2] - m[1])
            } else {
                0.5 * (m[0] + m[3])
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_reproduced_by_every_method() {
        // Dyadic numbers: every step is exact.
        let knots: Vec<(f64, f64)> = [0.0, 1.0, 2.0, 4.0, 8.0].map(|x| (x, 2.0 * x + 1.0)).into();
        for method in Method::ALL {
            let line = Interpolant::new(knots.clone(), method);
            assert_eq!(line.integral(0.0, 8.0), 72.0, "{method:?}");
            assert_eq!(line.integral(1.0, 2.0), 4.0, "{method:?}");
            assert_eq!(line.integral(0.5, 6.0), 41.25, "{method:?}");
            assert_eq!(line.integral(3.0, 3.0), 0.0, "{method:?}");
        }
    }

    #[test]
    fn slopes_are_those_of_the_formulas() {
        // Secants 1 and 3 of width 1: harmonic mean 3/2; ends 3/2·1 − 1/2·3 = 0 and 3/2·3 − 1/2.
        let bent = vec![(0.0, 0.0), (1.0, 1.0), (2.0, 4.0)];
        let pchip = Interpolant::new(bent.clone(), Method::Pchip);
        assert_eq!(pchip.slopes, [0.0, 1.5, 4.0]);
        // Akima: the parabola's own slopes, since every bend is the same.
        let akima = Interpolant::new(bent, Method::Akima);
        assert_eq!(akima.slopes, [0.0, 2.0, 4.0]);
    }

    #[test]
    fn two_points_are_a_line_for_pchip() {
        let line = Interpolant::new(vec![(1.0, 1.0), (3.0, 2.0)], Method::Pchip);
        assert_eq!(line.slopes, [0.5, 0.5]);
        assert_eq!(line.integral(1.0, 3.0), 3.0);
    }

    #[test]
    fn akima_is_level_where_the_data_are() {
        let step = [0.0, 0.0, 0.0, 1.0, 1.0, 1.0];
        let knots = step.iter().enumerate().map(|(x, y)| (x as f64, *y));
        let akima = Interpolant::new(knots.collect(), Method::Akima);
        assert_eq!(akima.slopes[1..5], [0.0; 4]);
    }
}
