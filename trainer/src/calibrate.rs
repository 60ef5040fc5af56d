//! Calibration: the scale and zero point of every hidden layer, from a run in reals.

use crate::choices::{ActivationKind, Precision};
use crate::config::TILE;
use crate::engine::{GatherTile, View};
use crate::kernel::vectorised;
use crate::quantise::Range;
use crate::sampler::Texel;
use crate::tile::Workspace;
use crate::topology::Topology;
use ntmu_isa::accumulate::signed_range;
use ntmu_isa::limits::QUANTIZE_EXPONENT;

/// How much of the range's extremes may be cut, from nothing to 60 %, in equal steps.
const CUTS: u32 = 25;
const LARGEST_CUT: f32 = 0.6;

/// The smallest scale, for a layer that is zero everywhere.
const LEAST: f32 = 1e-6;

/// The outputs of a clamped hard GELU, whose clamp is there to bound them. With eight bits the
/// scale is 1/80 and the zero point −113, as in NVIDIA's RTX SDK.
const CLAMPED: (f32, f32) = (-3.0 / 16.0, 3.0);

/// The range of each hidden layer that gives the least squared rounding error on `texels`, with
/// activations of `bits` bits; that of a clamped hard GELU is known.
pub(crate) fn calibrate(
    topology: &Topology,
    view: View<'_>,
    texels: &[Texel],
    bits: u8,
) -> Vec<Range> {
    let outputs = hidden_outputs(topology, view, texels);
    let ranges = outputs.iter().enumerate().map(|(index, values)| {
        let layer = topology.layers[index];
        let is_clamped = layer.activated && topology.activation == ActivationKind::ClampedHardGelu;
        match layer.precision {
            Precision::Int8 if is_clamped => range_between(CLAMPED.0, CLAMPED.1, bits),
            Precision::Int8 => best_range(values, bits),
            Precision::Fp16 if topology.writes_halves(index) => Range::HALVES,
            Precision::Fp16 => best_power(values, bits),
        }
    });
    ranges.collect()
}

/// How far each neuron of each hidden layer goes from zero.
pub(crate) fn extents(topology: &Topology, view: View<'_>, texels: &[Texel]) -> Vec<Vec<f32>> {
    let outputs = hidden_outputs(topology, view, texels);
    let layers = outputs.iter().zip(&topology.layers);
    let of_layer = layers.map(|(values, layer)| {
        let mut most = vec![0.0_f32; layer.outputs];
        for row in values.chunks_exact(layer.outputs) {
            for (most, value) in most.iter_mut().zip(row) {
                *most = most.max(value.abs());
            }
        }
        most
    });
    of_layer.collect()
}

/// What each hidden layer puts out: texels × outputs.
fn hidden_outputs(topology: &Topology, view: View<'_>, texels: &[Texel]) -> Vec<Vec<f32>> {
    let hidden = topology.layers.len() - 1;
    let mut outputs: Vec<Vec<f32>> = vec![Vec::new(); hidden];
    let mut workspace = Workspace::new(topology);
    for tile in texels.chunks(TILE) {
        forward(view, &mut workspace, tile);
        for (index, out) in outputs.iter_mut().enumerate() {
            let shape = topology.layers[index];
            for row in workspace
                .layer_output(index)
                .chunks_exact(shape.columns())
                .take(tile.len())
            {
                out.extend_from_slice(&row[..shape.outputs]);
            }
        }
    }
    outputs
}

/// One tile forward, without targets.
pub(crate) fn forward(view: View<'_>, workspace: &mut Workspace, texels: &[Texel]) {
    let width = workspace.inputs.len() / TILE;
    vectorised(GatherTile {
        view,
        texels,
        inputs: &mut workspace.inputs,
        width,
    });
    workspace.forward(view.network);
}

/// The range for these values, zero included exactly.
fn best_range(values: &[f32], bits: u8) -> Range {
    let (low, high) = ends(values);
    let candidates = (0..CUTS).map(|cut| {
        let keep = 1.0 - LARGEST_CUT * cut as f32 / CUTS as f32;
        range_between(low * keep, high * keep, bits)
    });
    best(values, bits, range_between(low, high, bits), candidates)
}

/// The same among scales that are powers of two, which is what an fp16 layer can give.
fn best_power(values: &[f32], bits: u8) -> Range {
    let (low, high) = ends(values);
    let whole = range_between(low, high, bits).scale;
    let (least, most) = QUANTIZE_EXPONENT;
    // The exponent of the smallest power of two that is no less.
    let bits_of_whole = whole.to_bits();
    let above = i32::from(bits_of_whole & 0x7f_ffff != 0);
    let coarse = 127 - (bits_of_whole >> 23) as i32 - above;
    let candidates = [0, 1, 2].map(|finer| {
        let exponent = (coarse + finer).clamp(i32::from(least), i32::from(most));
        let scale = f32::from_bits(((127 - exponent) as u32) << 23);
        let keep = (scale / whole).min(1.0);
        Range {
            scale,
            zero_point: zero_point(low * keep, scale, bits),
        }
    });
    best(values, bits, candidates[0], candidates.into_iter())
}

fn ends(values: &[f32]) -> (f32, f32) {
    let low = values.iter().copied().fold(0.0_f32, f32::min);
    let high = values.iter().copied().fold(0.0_f32, f32::max);
    (low, high)
}

/// The candidate with the least squared rounding error, or `otherwise`.
fn best(
    values: &[f32],
    bits: u8,
    otherwise: Range,
    candidates: impl Iterator<Item = Range>,
) -> Range {
    let (least, most) = signed_range(bits);
    let (least, most) = (least as f32, most as f32);
    let error = |range: Range| -> f64 {
        let zero = f32::from(range.zero_point);
        let errors = values.iter().map(|v| {
            let code = (v / range.scale + zero).round().clamp(least, most);
            f64::from(v - (code - zero) * range.scale).powi(2)
        });
        errors.sum()
    };
    let mut best = (f64::INFINITY, otherwise);
    for range in candidates {
        let error = error(range);
        if error < best.0 {
            best = (error, range);
        }
    }
    best.1
}

fn range_between(low: f32, high: f32, bits: u8) -> Range {
    let steps = ((1_u32 << bits) - 1) as f32;
    let scale = ((high - low) / steps).max(LEAST);
    Range {
        scale,
        zero_point: zero_point(low, scale, bits),
    }
}

/// The value that stands for zero where the smallest stands for `low`.
fn zero_point(low: f32, scale: f32, bits: u8) -> i16 {
    let (least, most) = signed_range(bits);
    let (least, most) = (least as f32, most as f32);
    (least - low / scale).round().clamp(least, most) as i16
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_uniform_layer_keeps_its_whole_range_and_an_outlier_is_cut() {
        let values: Vec<f32> = (0..=1000).map(|i| i as f32 / 1000.0).collect();
        let range = best_range(&values, 8);
        assert_eq!(range.zero_point, -128);
        assert!((range.scale - 1.0 / 255.0).abs() < 1e-9);
        let mut outlier = values.repeat(100);
        outlier.push(1.5);
        assert!(best_range(&outlier, 8).scale < 1.5 / 255.0);
    }

    #[test]
    fn a_layer_of_zeros_has_a_range() {
        let range = best_range(&[0.0; 8], 8);
        assert!(range.scale > 0.0 && (-128..=127).contains(&range.zero_point));
    }

    #[test]
    fn a_clamped_hard_gelu_has_the_step_and_the_zero_point_of_the_rtx_sdk() {
        let range = range_between(CLAMPED.0, CLAMPED.1, 8);
        assert_eq!((range.scale, range.zero_point), (1.0 / 80.0, -113));
    }

    #[test]
    fn a_power_of_two_fits_the_values_at_every_width() {
        let values: Vec<f32> = (-100..=1000).map(|i| i as f32 / 300.0).collect();
        for bits in 4..=11 {
            let range = best_power(&values, bits);
            assert_eq!(range.scale.log2().fract(), 0.0);
            let whole = (1100.0 / 300.0) / ((1_u32 << bits) - 1) as f32;
            assert!(
                range.scale >= whole / 2.0 && range.scale < 2.0 * whole,
                "{bits}: {range:?}"
            );
        }
    }
}
