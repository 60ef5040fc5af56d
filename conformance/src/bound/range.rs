//! Where the oracle's real can lie, and how far the model's value may lie from it.

use super::float_error;

/// A lane: an interval of reals and a radius around each of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Lane {
    /// The smallest and the largest real; the same for a texel that is known.
    pub(super) real: (f64, f64),
    /// |model − oracle| is at most this.
    pub(super) radius: f64,
}

impl Lane {
    /// A known real.
    pub(super) fn point(real: f64, radius: f64) -> Lane {
        Lane {
            real: (real, real),
            radius,
        }
    }

    /// The largest magnitude of the model's value.
    pub(super) fn magnitude(self) -> f64 {
        self.real.0.abs().max(self.real.1.abs()) + self.radius
    }

    /// Through a function that never falls and has at most this slope, which both sides compute
    /// exactly.
    pub(super) fn rising(self, slope: f64, function: impl Fn(f64) -> f64) -> Lane {
        let (low, high) = self.real;
        let radius = if low == high {
            let ends = [low - self.radius, low + self.radius];
            let moved = ends.map(|end| (function(end) - function(low)).abs());
            moved[0].max(moved[1])
        } else {
            // No reals farther apart than the radius allows, and none outside the range.
            let beyond = self.radius + float_error(self.magnitude());
            let reach = function(high + beyond) - function(low - beyond);
            (self.radius * slope).min(reach)
        };
        Lane {
            real: (function(low), function(high)),
            radius,
        }
    }

    /// With the oracle's own real, where it is known.
    pub(super) fn known(self, real: Option<f64>) -> Lane {
        Lane {
            real: real.map_or(self.real, |real| (real, real)),
            ..self
        }
    }

    /// With an interval of reals that is wider by this at both ends; a known real stays.
    pub(super) fn loosened(self, more: f64) -> Lane {
        let (low, high) = self.real;
        if low == high {
            return self;
        }
        Lane {
            real: (low - more, high + more),
            ..self
        }
    }

    /// With more radius.
    pub(super) fn widened(self, more: f64) -> Lane {
        Lane {
            radius: self.radius + more,
            ..self
        }
    }

    /// The sum of two lanes.
    pub(super) fn plus(self, other: Lane) -> Lane {
        Lane {
            real: (self.real.0 + other.real.0, self.real.1 + other.real.1),
            radius: self.radius + other.radius,
        }
    }

    /// Through a clamp on both sides.
    pub(super) fn clamped(self, (low, high): (f64, f64)) -> Lane {
        let lane = self.rising(1.0, |real| real.clamp(low, high));
        // The way to an end is a difference of floats, and so is what it is compared with.
        let largest = lane.magnitude();
        lane.widened(if lane.radius == 0.0 {
            0.0
        } else {
            float_error(largest)
        })
    }
}
