//! What the bits on a wire mean, in reals.

use ntmu_isa::half::Half;
use ntmu_isa::layer::{Layer, Parameters};
use ntmu_isa::shape::{LaneFormat, OutputFormat};

/// The largest finite fp16 number; what is larger saturates there.
pub const LARGEST_HALF: f64 = 65_504.0;

/// Units of a `Float16` channel: 2^10 to the real 1, the steps of fp16 between 1 and 2.
pub const HALF_UNITS: f64 = 1024.0;

/// The real of a finite fp16 number, from its fields.
#[must_use]
pub fn half(half: Half) -> f64 {
    let bits = half.bits();
    let exponent = i32::from(bits >> 10 & 0x1f);
    let fraction = f64::from(bits & 0x3ff) / 1024.0;
    let magnitude = if exponent == 0 {
        fraction * 2_f64.powi(-14)
    } else {
        (1.0 + fraction) * 2_f64.powi(exponent - 15)
    };
    if bits >> 15 == 1 {
        -magnitude
    } else {
        magnitude
    }
}

/// Accumulators of an integer layer as reals; sums of an fp16 layer from their f32 bits.
#[must_use]
pub fn sums(layer: &Layer, values: &[i32]) -> Vec<f64> {
    values
        .iter()
        .map(|&value| match layer.parameters {
            Parameters::Integer(_) => f64::from(value),
            Parameters::Half(_) => f64::from(f32::from_bits(value as u32)),
        })
        .collect()
}

/// The lanes of a register as reals: integers as they are, halves by what they mean.
#[must_use]
pub fn lanes(format: LaneFormat, values: &[i16]) -> Vec<f64> {
    values
        .iter()
        .map(|&value| match format {
            LaneFormat::Integer { .. } => f64::from(value),
            LaneFormat::Half => half(Half::from_bits(value as u16)),
        })
        .collect()
}

/// The smallest and the largest integer of `bits` bits.
#[must_use]
pub fn signed(bits: u8) -> (f64, f64) {
    let half = 2_f64.powi(i32::from(bits) - 1);
    (-half, half - 1.0)
}

/// The smallest and the largest real of a lane.
#[must_use]
pub fn lane_range(format: LaneFormat) -> (f64, f64) {
    match format {
        LaneFormat::Integer { bits, .. } => signed(bits),
        LaneFormat::Half => (-LARGEST_HALF, LARGEST_HALF),
    }
}

/// A channel code in the units in which channels are compared: the code itself, or for `Float16`
/// 2^10 times the number, so that a unit is a step of fp16 between 1 and 2.
#[must_use]
pub fn channel(format: OutputFormat, code: i32) -> f64 {
    match format {
        OutputFormat::Unorm8 | OutputFormat::Unorm16 | OutputFormat::Snorm8 => f64::from(code),
        OutputFormat::Float16 => half(Half::from_bits(code as u16)) * HALF_UNITS,
    }
}

/// The smallest and the largest channel, in the units of [`channel`].
#[must_use]
pub fn channel_range(format: OutputFormat) -> (f64, f64) {
    match format {
        OutputFormat::Unorm8 => (0.0, 255.0),
        OutputFormat::Unorm16 => (0.0, 65_535.0),
        OutputFormat::Snorm8 => (-127.0, 127.0),
        OutputFormat::Float16 => (-LARGEST_HALF * HALF_UNITS, LARGEST_HALF * HALF_UNITS),
    }
}

/// The units of a channel to the real 1, where an fp16 layer gives channels.
#[must_use]
pub fn channel_units(format: OutputFormat) -> f64 {
    match format {
        OutputFormat::Unorm8 | OutputFormat::Unorm16 | OutputFormat::Snorm8 => {
            channel_range(format).1
        }
        OutputFormat::Float16 => HALF_UNITS,
    }
}
