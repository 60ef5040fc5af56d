//! Part: what one pass runs, so that no pass is too long for its device.

use crate::variant::{Arithmetic, Lanes};
use ntmu_isa::Asset;
use ntmu_isa::accumulate::Overflow;
use ntmu_isa::half::SumOrder;
use ntmu_isa::layer::Layer;

/// Rows that the shader computes together.
pub(crate) const QUAD: u32 = 4;

/// Iterations of all loops of one invocation in one pass. llvmpipe ends a shader's loops, without
/// a word, after 65,535 of them in all (Mesa, `LP_MAX_TGSI_LOOP_ITERATIONS`); half of that leaves
/// room for the embedding and for the ends of loops.
const PASS_ITERATIONS: u32 = 1 << 15;

/// Some layers, or some rows of one; as `Part` in `wgsl/bindings.wgsl`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Part {
    first_layer: u32,
    /// Exclusive.
    end_layer: u32,
    /// Of each of the layers; a multiple of [`QUAD`].
    first_row: u32,
    /// Exclusive; rows that a layer does not have are left out.
    end_row: u32,
}

impl Part {
    pub(crate) const fn words(self) -> [u32; 4] {
        [
            self.first_layer,
            self.end_layer,
            self.first_row,
            self.end_row,
        ]
    }
}

/// The work of one layer.
struct Cost {
    quads: u32,
    /// Iterations of the loops for four rows.
    iterations: u32,
    /// What its products cost the device, in products of bytes.
    work: u64,
}

impl Cost {
    fn of(asset: &Asset, index: usize, layer: &Layer) -> Cost {
        let lanes = Lanes::of(asset.input_format(index));
        let profile = &asset.profile;
        let inputs = u32::from(layer.inputs);
        // As dense.wgsl and half_layer.wgsl choose. An fp16 sum takes some sixty instructions.
        let (steps, weight) = match (Arithmetic::of(layer), lanes) {
            (Arithmetic::Integer, Lanes::Bytes)
                if profile.accumulator.overflow == Overflow::Wrap =>
            {
                (inputs.div_ceil(lanes.per_element()), 1)
            }
            (Arithmetic::Integer, Lanes::Bytes | Lanes::Words | Lanes::Halves) => (inputs, 8),
            (Arithmetic::Half, _) => match profile.sum {
                SumOrder::Sequential | SumOrder::Fused => (inputs, 64),
                // Less than one merger of trees for each lane, and the end of their loop.
                SumOrder::Tree4 | SumOrder::Tree8 => (3 * inputs.next_multiple_of(8), 64),
            },
        };
        Cost {
            quads: u32::from(layer.outputs).div_ceil(QUAD),
            // The steps and their end, the rows and theirs.
            iterations: steps + 1 + QUAD + 1,
            work: u64::from(layer.macs()) * weight,
        }
    }
}

/// What a texel costs on the device, in products of bytes.
pub(crate) fn work(asset: &Asset) -> u64 {
    (0..)
        .zip(&asset.layers)
        .map(|(index, layer)| Cost::of(asset, index, layer).work)
        .sum()
}

/// The passes, in order: together every row of every layer.
pub(crate) fn parts(asset: &Asset) -> Vec<Part> {
    let mut parts = Vec::new();
    // Layers that share the pass that comes next.
    let (mut first, mut iterations) = (0, 0);
    let close = |parts: &mut Vec<Part>, first: u32, end: u32| {
        if end > first {
            parts.push(Part {
                first_layer: first,
                end_layer: end,
                first_row: 0,
                end_row: u32::MAX,
            });
        }
    };
    for (index, layer) in (0_u32..).zip(&asset.layers) {
        let cost = Cost::of(asset, index as usize, layer);
        let own = cost.quads * cost.iterations;
        if iterations + own > PASS_ITERATIONS {
            close(&mut parts, first, index);
            (first, iterations) = (index, 0);
        }
        if own > PASS_ITERATIONS {
            let rows = PASS_ITERATIONS / cost.iterations * QUAD;
            let starts = (0..u32::from(layer.outputs)).step_by(rows as usize);
            parts.extend(starts.map(|first_row| Part {
                first_layer: index,
                end_layer: index + 1,
                first_row,
                end_row: first_row + rows,
            }));
            first = index + 1;
        } else {
            iterations += own;
        }
    }
    close(&mut parts, first, asset.layers.len() as u32);
    parts
}

#[cfg(test)]
mod tests {
    use super::*;
    use ntmu_isa::activation::Activation;
    use ntmu_isa::asset::{Encoding, Map, Metadata, Parts};
    use ntmu_isa::half::Half;
    use ntmu_isa::latent::LatentFormat;
    use ntmu_isa::layer::{HalfParameters, Parameters};
    use ntmu_isa::profile::Profile;
    use ntmu_isa::shape::{GridShape, OutputFormat, Sampling, Shape};

    /// fp16 layers of these widths on one texel.
    fn half_layers(widths: &[u16], sum: SumOrder) -> Asset {
        let shape = Shape {
            mip_count: 1,
            octaves: 0,
            ..Shape::whole_chain(
                1,
                1,
                [GridShape {
                    channels: 1,
                    format: LatentFormat::new(1).unwrap(),
                    scale_log2: 3,
                    sampling: Sampling::Interpolated,
                }; 2],
                vec![OutputFormat::Float16],
            )
        };
        let mut inputs = shape.input_count() as u16;
        let layers = widths
            .iter()
            .copied()
            .chain([1])
            .map(|outputs| {
                let macs = usize::from(inputs) * usize::from(outputs);
                Layer {
                    inputs: std::mem::replace(&mut inputs, outputs),
                    outputs,
                    parameters: Parameters::Half(HalfParameters {
                        weights: vec![Half::ONE; macs],
                        bias: vec![Half::ZERO; usize::from(outputs)],
                        quantize: None,
                    }),
                    activation: Activation::Identity,
                    skip: None,
                }
            })
            .collect();
        Asset::new(Parts {
            shape,
            profile: Profile {
                sum,
                ..Profile::NORMATIVE
            },
            grids: [vec![0], vec![0]],
            layers,
            metadata: Metadata {
                name: String::new(),
                maps: vec![Map {
                    name: "all".to_owned(),
                    first_channel: 0,
                    channel_count: 1,
                    encoding: Encoding::Linear,
                    bit_depth: 8,
                }],
                record: Vec::new(),
            },
        })
        .unwrap()
    }

    #[test]
    fn passes_run_every_row_of_every_layer_once_and_in_order_and_none_is_too_long() {
        let widths: [&[u16]; 5] = [
            &[],
            &[1024, 1024, 1024],
            &[64, 1023, 1022, 2, 3, 700, 701],
            &[40; 63],
            &[300, 1024, 5, 1024, 1],
        ];
        for (widths, sum) in widths
            .into_iter()
            .flat_map(|widths| SumOrder::ALL.map(|sum| (widths, sum)))
        {
            let asset = half_layers(widths, sum);
            let parts = parts(&asset);
            let mut rows = Vec::new();
            for part in &parts {
                let mut iterations = 0;
                assert_eq!(part.first_row % QUAD, 0);
                for index in part.first_layer..part.end_layer {
                    let layer = &asset.layers[index as usize];
                    let end = part.end_row.min(u32::from(layer.outputs));
                    rows.extend((part.first_row..end).map(|row| (index, row)));
                    let quads = (end - part.first_row).div_ceil(QUAD);
                    iterations += quads * Cost::of(&asset, index as usize, layer).iterations;
                }
                assert!(iterations <= PASS_ITERATIONS, "{part:?}: {iterations}");
            }
            let expected: Vec<(u32, u32)> = (0..)
                .zip(&asset.layers)
                .flat_map(|(index, layer)| (0..u32::from(layer.outputs)).map(move |r| (index, r)))
                .collect();
            assert_eq!(rows, expected, "{widths:?}");
        }
    }
}
