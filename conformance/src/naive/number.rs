//! Integers: quotients, widths and rescalings, by their definitions on `i128`.

use ntmu_isa::filter::FilterRule;
use ntmu_isa::profile::Profile;
use ntmu_isa::rescale::{Multiplier, Requantizer};
use ntmu_isa::round::Rounding;

/// The integer that `dividend / divisor` becomes; the divisor is positive.
#[must_use]
pub fn divide(dividend: i128, divisor: i128, mode: Rounding) -> i128 {
    let below = dividend.div_euclid(divisor);
    let twice = 2 * dividend.rem_euclid(divisor);
    let is_up = match mode {
        Rounding::Floor => false,
        Rounding::HalfUp => twice >= divisor,
        Rounding::HalfEven => twice > divisor || (twice == divisor && below.rem_euclid(2) == 1),
        Rounding::HalfAway => twice > divisor || (twice == divisor && dividend > 0),
    };
    if is_up { below + 1 } else { below }
}

/// 2^n.
#[must_use]
pub fn power(n: u32) -> i128 {
    (0..n).fold(1, |power, _| power * 2)
}

/// The number limited to what `bits` signed bits hold.
#[must_use]
pub fn limited(value: i128, bits: u8) -> i128 {
    let half = power(u32::from(bits) - 1);
    value.clamp(-half, half - 1)
}

/// Whether `bits` signed bits hold the number.
#[must_use]
pub fn fits(value: i128, bits: u8) -> bool {
    limited(value, bits) == value
}

/// The number of `bits` signed bits that differs from `value` by a multiple of 2^bits.
#[must_use]
pub fn wrapped(value: i128, bits: u8) -> i128 {
    let half = power(u32::from(bits) - 1);
    (value + half).rem_euclid(2 * half) - half
}

/// value · mantissa / 2^shift by a requantiser, limited to 32 bits.
#[must_use]
pub fn rescale(requantizer: Requantizer, value: i128, scale: Multiplier) -> i128 {
    let (mantissa, shift) = (i128::from(scale.mantissa()), u32::from(scale.shift()));
    let (product, unit) = (value * mantissa, power(shift));
    let rounded = match requantizer {
        Requantizer::Single => divide(product, unit, Rounding::HalfUp),
        Requantizer::HalfEven => divide(product, unit, Rounding::HalfEven),
        Requantizer::HalfAway => divide(product, unit, Rounding::HalfAway),
        // gemmlowp: the doubled product's high word, then a division that rounds ties away.
        Requantizer::Double if shift > 31 => {
            let high = divide(product, power(31), Rounding::HalfUp);
            divide(high, power(shift - 31), Rounding::HalfAway)
        }
        Requantizer::Double => divide(product, unit, Rounding::HalfUp),
        Requantizer::Narrow => {
            let upper = divide(mantissa, power(16), Rounding::HalfUp).min(32_767);
            divide(value * upper * power(16), unit, Rounding::HalfUp)
        }
    };
    limited(rounded, 32)
}

/// A real `numerator / denominator` as an input of `bits` bits: 2^(bits − 1) to the real 1.
#[must_use]
pub fn input(numerator: i128, denominator: i128, bits: u8, mode: Rounding) -> i128 {
    let scaled = numerator * power(u32::from(bits) - 1);
    limited(divide(scaled, denominator, mode), bits)
}

/// The interpolation of four latents in 1/2^`latent_bits`, at `phases` sixteenths, as an input.
#[must_use]
pub fn interpolate(
    profile: &Profile,
    corners: [i128; 4],
    phases: [i128; 2],
    latent_bits: u8,
    input_bits: u8,
) -> i128 {
    let latent_one = power(u32::from(latent_bits));
    let (mode, b) = (profile.input, u32::from(profile.subtexel_bits));
    let one = power(b);
    let sum =
        |weights: [i128; 4]| -> i128 { weights.iter().zip(corners).map(|(w, v)| w * v).sum() };
    let [x, y] = phases;
    let fractions = phases.map(|phase| phase * one / 16);
    match profile.interpolate {
        FilterRule::Exact => {
            let weights = [(16 - x) * (16 - y), x * (16 - y), (16 - x) * y, x * y];
            input(sum(weights), 256 * latent_one, input_bits, mode)
        }
        FilterRule::Factored => {
            let [x, y] = fractions;
            let both = divide(x * y, one, Rounding::HalfUp);
            let weights = [one - x - y + both, x - both, y - both, both];
            input(sum(weights), one * latent_one, input_bits, mode)
        }
        FilterRule::Separable | FilterRule::AllOnes => {
            let is_separable = profile.interpolate == FilterRule::Separable;
            let (unit, mode) = if is_separable {
                (one, mode)
            } else {
                (one - 1, Rounding::HalfUp)
            };
            let inputs = corners.map(|v| input(v, latent_one, input_bits, profile.input));
            let between =
                |ends: [i128; 2], f: i128| divide(ends[0] * (unit - f) + ends[1] * f, unit, mode);
            let [x, y] = fractions;
            let rows = [
                between([inputs[0], inputs[1]], x),
                between([inputs[2], inputs[3]], x),
            ];
            limited(between(rows, y), input_bits)
        }
    }
}
