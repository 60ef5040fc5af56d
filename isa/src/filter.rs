//! Filter: how numbers between two, or four, neighbours are made.
//!
//! No two vendors agree on it, and graphics APIs allow all of them. Of the rules below only
//! [`FilterRule::Exact`] is monotone along both axes, as Direct3D 11.3 section 7.18.16.3 wants it.

use crate::round::Rounding;

/// How weights are formed and where a bilinear filter rounds. A fraction has b bits.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, serde::Serialize, serde::Deserialize,
)]
#[serde(rename_all = "kebab-case")]
pub enum FilterRule {
    /// Products of axis weights in full width, one rounding at the end. Normative.
    Exact,
    /// Weights in 1/2^b from one rounded product: w11 = (wx·wy + half) >> b, w10 = wx − w11,
    /// w01 = wy − w11, w00 = 2^b − wx − wy + w11; one rounding at the end. Reproduces published
    /// samples of NVIDIA's CUDA textures with b = 8.
    Factored,
    /// Along u, rounded; then along v, rounded.
    Separable,
    /// As separable, with weights k / (2^b − 1) to the nearest, so that the largest fraction is the
    /// next neighbour. Vortex and Skybox with b = 8.
    AllOnes,
}

/// A sum of weighted neighbours before its one rounding: real = `sum` / 2^`fraction_bits`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Weighted {
    /// In units of 2^−`fraction_bits` of the neighbours' unit.
    pub sum: i64,
    /// Bits below the neighbours' unit; 0 where the rule has rounded already.
    pub fraction_bits: u32,
}

impl FilterRule {
    /// Every rule, in the order of its code in a file.
    pub const ALL: [FilterRule; 4] = [
        FilterRule::Exact,
        FilterRule::Factored,
        FilterRule::Separable,
        FilterRule::AllOnes,
    ];

    /// The name in tables and profiles.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            FilterRule::Exact => "exact",
            FilterRule::Factored => "factored",
            FilterRule::Separable => "separable",
            FilterRule::AllOnes => "all-ones",
        }
    }

    /// The code in a file.
    #[must_use]
    pub const fn code(self) -> u8 {
        self as u8
    }

    /// The rule with this code, if there is one.
    #[must_use]
    pub fn from_code(code: u8) -> Option<FilterRule> {
        FilterRule::ALL.get(usize::from(code)).copied()
    }

    /// Whether a bilinear filter is one sum with one rounding at the end.
    #[must_use]
    pub const fn is_single_rounded(self) -> bool {
        match self {
            FilterRule::Exact | FilterRule::Factored => true,
            FilterRule::Separable | FilterRule::AllOnes => false,
        }
    }

    /// Between two neighbours at `fraction`/2^`bits`; rounded by the rules that round per axis.
    ///
    /// `bits` is at most 12 and neighbours are below 2^40.
    #[must_use]
    pub const fn linear(
        self,
        ends: [i64; 2],
        fraction: u32,
        bits: u32,
        rounding: Rounding,
    ) -> Weighted {
        let (one, w) = (1_i64 << bits, fraction as i64);
        match self {
            FilterRule::Exact | FilterRule::Factored => Weighted {
                sum: ends[0] * (one - w) + ends[1] * w,
                fraction_bits: bits,
            },
            FilterRule::Separable => Weighted {
                sum: rounding.shift(ends[0] * (one - w) + ends[1] * w, bits),
                fraction_bits: 0,
            },
            FilterRule::AllOnes => {
                // 2^b − 1 is odd: there are no ties.
                let ones = one - 1;
                let sum = ends[0] * (ones - w) + ends[1] * w;
                Weighted {
                    sum: (sum + ones / 2).div_euclid(ones),
                    fraction_bits: 0,
                }
            }
        }
    }

    /// Among the corners (0,0), (1,0), (0,1), (1,1) at (`x`, `y`)/2^`bits`.
    ///
    /// `bits` is at most 12 and corners are below 2^32.
    #[must_use]
    pub const fn bilinear(
        self,
        corners: [i64; 4],
        [x, y]: [u32; 2],
        bits: u32,
        rounding: Rounding,
    ) -> Weighted {
        match self {
            FilterRule::Exact | FilterRule::Factored => {
                let weights = self.weights([x, y], bits);
                let mut sum = 0;
                let mut corner = 0;
                while corner < 4 {
                    sum += weights[corner] * corners[corner];
                    corner += 1;
                }
                let fraction_bits = match self {
                    FilterRule::Factored => bits,
                    FilterRule::Exact | FilterRule::Separable | FilterRule::AllOnes => 2 * bits,
                };
                Weighted { sum, fraction_bits }
            }
            FilterRule::Separable | FilterRule::AllOnes => {
                let top = self.linear([corners[0], corners[1]], x, bits, rounding);
                let bottom = self.linear([corners[2], corners[3]], x, bits, rounding);
                self.linear([top.sum, bottom.sum], y, bits, rounding)
            }
        }
    }

    /// The weights of the four corners: in 1/2^bits where factored, else products in 1/2^(2·bits).
    /// Those of the other rules are not applied as one sum; see [`FilterRule::is_single_rounded`].
    #[must_use]
    pub const fn weights(self, [x, y]: [u32; 2], bits: u32) -> [i64; 4] {
        let (one, x, y) = (1_i64 << bits, x as i64, y as i64);
        match self {
            FilterRule::Factored => {
                let both = (x * y + one / 2) >> bits;
                [one - x - y + both, x - both, y - both, both]
            }
            FilterRule::Exact | FilterRule::Separable | FilterRule::AllOnes => {
                [(one - x) * (one - y), x * (one - y), (one - x) * y, x * y]
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_of_single_rounded_rules_add_up_to_one() {
        for bits in 4..=8 {
            for (x, y) in (0..1 << bits).flat_map(|x| (0..1 << bits).map(move |y| (x, y))) {
                let sum = |rule: FilterRule| rule.weights([x, y], bits).iter().sum::<i64>();
                assert_eq!(sum(FilterRule::Exact), 1 << (2 * bits));
                assert_eq!(sum(FilterRule::Factored), 1 << bits);
                assert!(
                    FilterRule::Factored
                        .weights([x, y], bits)
                        .iter()
                        .all(|&w| w >= 0)
                );
            }
        }
    }

    #[test]
    fn every_rule_keeps_a_constant_and_stays_within_its_neighbours() {
        let corner_sets = [[77; 4], [0, 255, 255, 0], [-7, 8, 3, -2], [12, 13, 12, 13]];
        for rule in FilterRule::ALL {
            for corners in corner_sets {
                let (low, high) = (corners.iter().min().unwrap(), corners.iter().max().unwrap());
                for (x, y) in (0..256).flat_map(|x| (0..256).map(move |y| (x, y))) {
                    let result = rule.bilinear(corners, [x, y], 8, Rounding::HalfUp);
                    let rounded = Rounding::HalfUp.shift(result.sum, result.fraction_bits);
                    assert!(
                        rounded >= *low && rounded <= *high,
                        "{} {x} {y}",
                        rule.name()
                    );
                }
            }
        }
    }

    #[test]
    fn only_the_exact_rule_is_monotone_along_an_axis() {
        // Along one axis the real is linear: it may rise or fall, never both.
        let corner_sets = [
            [0, 255, 200, 0],
            [9, 17, 255, 3],
            [255, 0, 40, 250],
            [30, 60, 90, 0],
        ];
        let turns = |rule: FilterRule| {
            corner_sets.iter().any(|&corners| {
                (0..256).any(|y| {
                    let at = |x| rule.bilinear(corners, [x, y], 8, Rounding::HalfUp).sum;
                    let steps: Vec<i64> = (1..256).map(|x| at(x) - at(x - 1)).collect();
                    steps.iter().any(|&s| s > 0) && steps.iter().any(|&s| s < 0)
                })
            })
        };
        assert_eq!(
            FilterRule::ALL.map(turns),
            [false, true, true, true],
            "exact, factored, separable, all-ones"
        );
    }

    #[test]
    fn the_largest_fraction_of_all_ones_is_the_neighbour() {
        let at = |rule: FilterRule| rule.linear([0, 255], 255, 8, Rounding::HalfUp);
        assert_eq!(at(FilterRule::AllOnes).sum, 255);
        assert_eq!(at(FilterRule::Separable).sum, 254);
    }
}
