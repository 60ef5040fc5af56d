//! Calibration: the scale and zero point of every hidden layer, from a run in reals.

use crate::config::TILE;
use crate::engine::{GatherTile, View};
use crate::integer::Range;
use crate::kernel::vectorised;
use crate::sampler::Texel;
use crate::tile::Workspace;
use crate::topology::Topology;

/// How much of the range's extremes may be cut, from nothing to 60 %, in equal steps.
const CUTS: u32 = 25;
const LARGEST_CUT: f32 = 0.6;

/// The smallest scale, for a layer that is zero everywhere.
const LEAST: f32 = 1e-6;

/// The range of each hidden layer that gives the least squared rounding error on `texels`.
pub(crate) fn calibrate(topology: &Topology, view: View<'_>, texels: &[Texel]) -> Vec<Range> {
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
    outputs.iter().map(|values| best_range(values)).collect()
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
fn best_range(values: &[f32]) -> Range {
    let low = values.iter().copied().fold(0.0_f32, f32::min);
    let high = values.iter().copied().fold(0.0_f32, f32::max);
    let error = |range: Range| -> f64 {
        let zero = f32::from(range.zero_point);
        let errors = values.iter().map(|v| {
            let code = (v / range.scale + zero).round().clamp(-128.0, 127.0);
            f64::from(v - (code - zero) * range.scale).powi(2)
        });
        errors.sum()
    };
    let candidates = (0..CUTS).map(|cut| {
        let keep = 1.0 - LARGEST_CUT * cut as f32 / CUTS as f32;
        range_between(low * keep, high * keep)
    });
    let mut best = (f64::INFINITY, range_between(low, high));
    for range in candidates {
        let error = error(range);
        if error < best.0 {
            best = (error, range);
        }
    }
    best.1
}

fn range_between(low: f32, high: f32) -> Range {
    let scale = ((high - low) / 255.0).max(LEAST);
    let zero_point = (-128.0 - low / scale).round().clamp(-128.0, 127.0);
    Range {
        scale,
        zero_point: zero_point as i16,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_uniform_layer_keeps_its_whole_range_and_an_outlier_is_cut() {
        let values: Vec<f32> = (0..=1000).map(|i| i as f32 / 1000.0).collect();
        let range = best_range(&values);
        assert_eq!(range.zero_point, -128);
        assert!((range.scale - 1.0 / 255.0).abs() < 1e-9);
        let mut outlier = values.repeat(100);
        outlier.push(1.5);
        assert!(best_range(&outlier).scale < 1.5 / 255.0);
    }

    #[test]
    fn a_layer_of_zeros_has_a_range() {
        let range = best_range(&[0.0; 8]);
        assert!(range.scale > 0.0 && (-128..=127).contains(&range.zero_point));
    }
}
