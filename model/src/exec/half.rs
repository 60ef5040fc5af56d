//! Half: what an fp16 layer does. Its numbers, and the order of its sums, are in `ntmu_isa::half`.

use ntmu_isa::accumulate::signed_range;
use ntmu_isa::half::{Half, SumOrder, activation, to_integer};
use ntmu_isa::layer::{HalfParameters, Quantize, integer_as_half};
use ntmu_isa::profile::Profile;
use ntmu_isa::round::{Rounding, saturate};
use ntmu_isa::shape::{LaneFormat, OutputFormat};

/// The lanes of a register as an fp16 layer reads them.
pub(super) fn read(lanes: &[i16], format: LaneFormat) -> Vec<Half> {
    lanes
        .iter()
        .map(|&lane| match format {
            LaneFormat::Integer { bits, zero_point } => integer_as_half(lane, bits, zero_point),
            LaneFormat::Half => half(lane),
        })
        .collect()
}

/// A lane of a register of halves.
fn half(lane: i16) -> Half {
    Half::from_bits(lane as u16)
}

/// Bias plus products, in the profile's order.
pub(super) fn dense(
    parameters: &HalfParameters,
    order: SumOrder,
    input: &[Half],
    sums: &mut [f32],
) {
    let rows = parameters.weights.chunks_exact(input.len());
    for ((sum, row), &bias) in sums.iter_mut().zip(rows).zip(&parameters.bias) {
        *sum = order.dot(bias, row, input);
    }
}

pub(super) fn relu(sums: &mut [f32]) {
    for sum in sums {
        *sum = activation::relu(*sum);
    }
}

pub(super) fn leaky(sums: &mut [f32], shift: u16) {
    for sum in sums {
        *sum = activation::leaky(*sum, shift as u8);
    }
}

pub(super) fn gate(sums: &mut [f32], is_clamped: bool) {
    for sum in sums {
        *sum = activation::hard_gelu(*sum, is_clamped);
    }
}

/// Adds a register of halves to the sums.
pub(super) fn add_skip(sums: &mut [f32], source: &[i16]) {
    for (sum, &lane) in sums.iter_mut().zip(source) {
        *sum += half(lane).to_f32();
    }
}

/// Sums to halves.
pub(super) fn round(sums: &[f32], lanes: &mut [i16]) {
    for (lane, &sum) in lanes.iter_mut().zip(sums) {
        *lane = Half::round(sum).bits() as i16;
    }
}

/// Sums to integers.
pub(super) fn quantize(sums: &[f32], quantize: Quantize, rounding: Rounding, lanes: &mut [i16]) {
    let (low, high) = signed_range(quantize.bits);
    for (lane, &sum) in lanes.iter_mut().zip(sums) {
        let value = to_integer(sum, 1, i32::from(quantize.exponent), rounding);
        *lane = saturate(value + i64::from(quantize.zero_point), low, high) as i16;
    }
}

/// Sums to channel codes.
pub(super) fn emit(sums: &[f32], formats: &[OutputFormat], profile: &Profile, codes: &mut [i32]) {
    for (code, (&sum, format)) in codes.iter_mut().zip(sums.iter().zip(formats)) {
        let (low, high) = format.range();
        *code = match format {
            OutputFormat::Unorm8 | OutputFormat::Unorm16 | OutputFormat::Snorm8 => {
                // Every largest code has at most 16 bits.
                saturate(to_integer(sum, high as u16, 0, profile.convert), low, high)
            }
            OutputFormat::Float16 => i32::from(Half::round(sum).bits()),
        };
    }
}
