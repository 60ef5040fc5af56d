//! Ranges: what a value can be.

use serde::Serialize;

/// Integers from `low` to `high`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Range {
    /// The smallest.
    pub low: i64,
    /// The largest.
    pub high: i64,
}

impl Range {
    /// One integer.
    #[must_use]
    pub const fn point(value: i64) -> Range {
        Range {
            low: value,
            high: value,
        }
    }

    /// All of both, and what lies between.
    #[must_use]
    pub fn union(self, other: Range) -> Range {
        Range {
            low: self.low.min(other.low),
            high: self.high.max(other.high),
        }
    }

    /// Sums.
    #[must_use]
    pub const fn plus(self, other: Range) -> Range {
        Range {
            low: self.low + other.low,
            high: self.high + other.high,
        }
    }

    /// Products with a weight.
    #[must_use]
    pub fn times(self, weight: i64) -> Range {
        let ends = [self.low * weight, self.high * weight];
        Range {
            low: ends[0].min(ends[1]),
            high: ends[0].max(ends[1]),
        }
    }

    /// Through a function that never falls.
    #[must_use]
    pub fn rising(self, function: impl Fn(i64) -> i64) -> Range {
        Range {
            low: function(self.low),
            high: function(self.high),
        }
    }

    /// The smallest number of signed bits that holds all of it.
    #[must_use]
    pub fn bits(self) -> u8 {
        // A negative number needs as many bits as the one's complement of it.
        let magnitude = self.high.max(!self.low).max(0) as u64;
        (65 - magnitude.leading_zeros()) as u8
    }

    /// Whether the other range lies within this one.
    #[must_use]
    pub fn holds(self, other: Range) -> bool {
        self.low <= other.low && other.high <= self.high
    }

    /// All that `bits` signed bits hold.
    #[must_use]
    pub const fn signed(bits: u8) -> Range {
        let half = 1_i64 << (bits - 1);
        Range {
            low: -half,
            high: half - 1,
        }
    }

    /// The largest magnitude.
    #[must_use]
    pub fn magnitude(self) -> i64 {
        self.low.abs().max(self.high.abs())
    }
}

/// Reals from `low` to `high`: the lanes of a register, integers or what halves mean.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RealRange {
    /// The smallest.
    pub low: f64,
    /// The largest.
    pub high: f64,
}

impl RealRange {
    /// The largest magnitude.
    #[must_use]
    pub fn magnitude(self) -> f64 {
        self.low.abs().max(self.high.abs())
    }

    /// The same for integers.
    #[must_use]
    pub fn integers(self) -> Range {
        Range {
            low: self.low as i64,
            high: self.high as i64,
        }
    }
}

impl From<Range> for RealRange {
    fn from(range: Range) -> RealRange {
        RealRange {
            low: range.low as f64,
            high: range.high as f64,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_width_holds_its_range_and_one_bit_less_does_not() {
        for bits in 2..=40 {
            let all = Range::signed(bits);
            assert_eq!(all.bits(), bits);
            for end in [all.low, all.high] {
                assert_eq!(Range::point(end).bits(), bits);
            }
            assert_eq!(Range::point(all.high + 1).bits(), bits + 1);
            assert_eq!(Range::point(all.low - 1).bits(), bits + 1);
        }
    }
}
