//! The roundings of a grid's interpolation, rule by rule.

use super::{float_error, rounding};
use ntmu_isa::filter::FilterRule;
use ntmu_isa::position::PHASE_BITS;
use ntmu_isa::profile::Profile;
use ntmu_isa::round::Rounding;
use ntmu_isa::shape::{GridShape, Sampling};

/// How far an interpolated latent, or a corner, may lie from its real: in units of an input of
/// `input_bits` bits.
///
/// * A corner of B bits drops what an input of A bits does not have, B − (A − 1) bits.
/// * Exact: the products of two axis weights have 8 bits at texel centres, whatever the profile's
///   subtexel bits; Σ weight·value has B + 8 fractional bits, one rounding drops the rest.
/// * Factored: with b < 8 subtexel bits the product of two weights is itself rounded to b bits, and
///   the three other weights move with it; that moves the sum by half a weight's step times
///   v00 − v10 − v01 + v11, at most twice the latents' range. Then one rounding.
/// * Separable: corners are inputs first; then one rounding along each axis, of four bits.
/// * All ones: the same, but a quotient by the odd 2^b − 1 has no ties and stays below half.
pub(super) fn bound(grid: GridShape, profile: &Profile, input_bits: u8) -> f64 {
    let (corner, axes) = parts(grid, profile, input_bits);
    // Weights of k / (2^b − 1) are no dyadic numbers, so the oracle rounds too.
    let is_dyadic =
        grid.sampling == Sampling::Corners || profile.interpolate != FilterRule::AllOnes;
    let own = if is_dyadic {
        0.0
    } else {
        4.0 * float_error(2_f64.powi(i32::from(input_bits)))
    };
    corner + axes.weights + axes.roundings.iter().map(|r| r.bound).sum::<f64>() + own
}

/// The roundings of an interpolation after those of its corners.
pub(super) struct Axes {
    /// What rounded weights move.
    pub(super) weights: f64,
    /// One for each rounding of a sum.
    pub(super) roundings: Vec<Step>,
}

/// One rounding of a sum.
#[derive(Clone, Copy)]
pub(super) struct Step {
    /// The most that it moves.
    pub(super) bound: f64,
    /// What it moves on average.
    pub(super) mean: f64,
}

impl Step {
    fn shift(mode: Rounding, dropped: u32) -> Step {
        Step {
            bound: rounding(mode, dropped),
            mean: rounding_mean(mode, dropped),
        }
    }
}

/// The bound of a corner's own rounding, and the roundings after it.
pub(super) fn parts(grid: GridShape, profile: &Profile, input_bits: u8) -> (f64, Axes) {
    let (b, latent) = (
        u32::from(profile.subtexel_bits),
        u32::from(grid.format.bits()),
    );
    let fraction = u32::from(input_bits) - 1;
    let dropped = |more: u32| (latent + more).saturating_sub(fraction);
    let corner = rounding(profile.input, dropped(0));
    let none = Axes {
        weights: 0.0,
        roundings: Vec::new(),
    };
    if grid.sampling == Sampling::Corners {
        return (corner, none);
    }
    let weight_bits = 2 * u32::from(PHASE_BITS);
    match profile.interpolate {
        FilterRule::Exact => (
            0.0,
            Axes {
                roundings: vec![Step::shift(profile.input, dropped(weight_bits))],
                ..none
            },
        ),
        FilterRule::Factored => (
            0.0,
            Axes {
                weights: if b < weight_bits {
                    0.5 * 2_f64.powi(-(b as i32)) * 2.0 * latent_span(grid, input_bits)
                } else {
                    0.0
                },
                roundings: vec![Step::shift(profile.input, dropped(b.min(weight_bits)))],
            },
        ),
        FilterRule::Separable => (
            corner,
            Axes {
                roundings: vec![Step::shift(profile.input, u32::from(PHASE_BITS)); 2],
                ..none
            },
        ),
        FilterRule::AllOnes => {
            let ones = 2_f64.powi(b as i32) - 1.0;
            let step = Step {
                bound: 0.5 - 0.5 / ones,
                mean: 0.0,
            };
            (
                corner,
                Axes {
                    roundings: vec![step; 2],
                    ..none
                },
            )
        }
    }
}

/// From the smallest to the largest latent, in units of an input: (2^B − 1) / 2^B of 2^(A−1).
pub(super) fn latent_span(grid: GridShape, input_bits: u8) -> f64 {
    let codes = 2_f64.powi(i32::from(grid.format.bits()));
    (codes - 1.0) / codes * 2_f64.powi(i32::from(input_bits) - 1)
}

/// The mean of a rounding that drops this many bits.
pub(super) fn rounding_mean(mode: Rounding, dropped_bits: u32) -> f64 {
    match mode {
        Rounding::HalfUp | Rounding::HalfEven | Rounding::HalfAway => 0.0,
        Rounding::Floor => -rounding(mode, dropped_bits) / 2.0,
    }
}
