//! Import: an asset's synthesizer as the network that training computes with.
//!
//! The way back from [`crate::export`], for gradients through an asset whose training is over, or
//! was never ours. What an asset may have and a trained one never has — a multiplier of more than 24
//! significant bits, another profile's roundings, sums beyond 2^24 — is computed in floats here, and
//! so may differ in the last place.

use crate::choices::{ActivationKind, Precision};
use crate::epilogue::half::Ending;
use crate::epilogue::integer::Saturation;
use crate::error::TrainError;
use crate::network::{Epilogue, Halves, Network, Prepared, Rescaling, transpose};
use crate::sampler::{Embedding, Numbers};
use crate::source::real_range;
use crate::topology::Topology;
use ntmu_isa::Asset;
use ntmu_isa::accumulate::signed_range;
use ntmu_isa::activation::Activation;
use ntmu_isa::layer::{HalfParameters, IntegerParameters, Layer, Parameters};
use ntmu_isa::rescale::Multiplier;
use ntmu_isa::shape::{LaneFormat, Shape};

/// The layers of an asset's synthesizer and the network that they are.
///
/// # Errors
/// When a layer has an activation that training has none like, or two have different ones.
pub(crate) fn network(asset: &Asset) -> Result<(Topology, Network), TrainError> {
    let topology = topology(asset)?;
    let layers = asset.layers.iter().enumerate();
    let layers = layers.map(|(index, layer)| prepared(asset, &topology, index, layer));
    let low = asset.shape.outputs.iter().map(|&o| real_range(o).0);
    let network = Network {
        layers: layers.collect(),
        activation: topology.activation,
        low: low.collect(),
    };
    Ok((topology, network))
}

/// How the latents of an asset become inputs.
pub(crate) fn embedding(asset: &Asset) -> Embedding {
    let Shape {
        grids, input_bits, ..
    } = &asset.shape;
    Embedding {
        numbers: Numbers::Integer,
        channels: [0, 1].map(|g: usize| usize::from(grids[g].channels)),
        sampling: [0, 1].map(|g: usize| grids[g].sampling.into()),
        bits: [0, 1].map(|g: usize| grids[g].format.bits()),
        input_bits: *input_bits,
        inputs: asset.layers.first().map_or(0, |l| usize::from(l.inputs)),
    }
}

fn topology(asset: &Asset) -> Result<Topology, TrainError> {
    let mut topology = Topology::empty(ActivationKind::Relu);
    let mut activation = None;
    for (index, layer) in asset.layers.iter().enumerate() {
        let kind = kind_of(layer.activation).map_err(|found| {
            let allowed = "identity, ReLU, leaky ReLU, hard GELU";
            TrainError::config(format!("layers[{index}].activation"), found, allowed)
        })?;
        if let Some(kind) = kind {
            let first = *activation.get_or_insert(kind);
            if first != kind {
                let field = format!("layers[{index}].activation");
                let allowed = format!("{first:?}, that of the layers before");
                return Err(TrainError::config(field, format!("{kind:?}"), allowed));
            }
        }
        topology.push(
            usize::from(layer.inputs),
            usize::from(layer.outputs),
            kind.is_some(),
            layer.skip.map(|skip| usize::from(skip.span)),
        );
        if let (Some(shape), Parameters::Half(_)) = (topology.layers.last_mut(), &layer.parameters)
        {
            shape.precision = Precision::Fp16;
        }
    }
    topology.activation = activation.unwrap_or(ActivationKind::Relu);
    Ok(topology)
}

/// What training calls an activation; none for the identity.
fn kind_of(activation: Activation) -> Result<Option<ActivationKind>, &'static str> {
    Ok(Some(match activation {
        Activation::Identity => return Ok(None),
        Activation::Relu => ActivationKind::Relu,
        Activation::Leaky { shift } => ActivationKind::Leaky { shift },
        Activation::HardGelu {
            is_clamped: false, ..
        } => ActivationKind::HardGelu,
        Activation::HardGelu {
            is_clamped: true, ..
        } => ActivationKind::ClampedHardGelu,
        Activation::Table => return Err(activation.name()),
    }))
}

fn prepared(asset: &Asset, topology: &Topology, index: usize, layer: &Layer) -> Prepared {
    let shape = topology.layers[index];
    let (rows, columns) = (shape.rows(), shape.columns());
    let mut weights = vec![0.0; rows * columns];
    let mut bias = vec![0.0; columns];
    // In the last layer alone.
    let codes = || {
        let formats = asset.shape.outputs.iter().map(|o| o.range());
        let mut codes: Vec<_> = formats.map(|(l, h)| (f64::from(l), f64::from(h))).collect();
        codes.resize(columns, (0.0, 0.0));
        codes
    };
    let is_last = index + 1 == topology.layers.len();
    let input = asset.input_format(index);
    let epilogue = match &layer.parameters {
        Parameters::Integer(integers) => {
            let zero = match input {
                LaneFormat::Integer { zero_point, .. } => i32::from(zero_point),
                LaneFormat::Half => 0,
            };
            for o in 0..shape.outputs {
                let row = integers.row(o, layer.inputs);
                for (k, &weight) in row.iter().enumerate() {
                    weights[k * columns + o] = f32::from(weight);
                }
                let sum: i32 = row.iter().map(|&w| i32::from(w)).sum();
                // The bias holds what the input's zero point adds; here inputs come without it.
                bias[o] = (integers.bias[o] + zero * sum) as f32;
            }
            let codes = if is_last { codes() } else { Vec::new() };
            Epilogue::Integer(rescaling(layer, integers, columns, codes))
        }
        Parameters::Half(halves) => {
            let read = match input {
                LaneFormat::Integer { bits, .. } => 1.0 / (1_u32 << (bits - 1)) as f32,
                LaneFormat::Half => 1.0,
            };
            for o in 0..shape.outputs {
                for (k, weight) in halves.row(o, layer.inputs).iter().enumerate() {
                    weights[k * columns + o] = weight.to_f32() * read;
                }
                bias[o] = halves.bias[o].to_f32();
            }
            let ending = if is_last {
                Ending::Codes(codes())
            } else {
                ending(halves)
            };
            Epilogue::Half(Halves { read, ending })
        }
    };
    Prepared {
        shape,
        transposed: transpose(&weights, rows, columns),
        weights,
        bias,
        epilogue,
    }
}

fn rescaling(
    layer: &Layer,
    integers: &IntegerParameters,
    columns: usize,
    codes: Vec<(f64, f64)>,
) -> Rescaling {
    let mut scales: Vec<f64> = integers.scales.iter().map(|&scale| real(scale)).collect();
    scales.resize(columns, 0.0);
    let gate = match layer.activation {
        Activation::HardGelu { scale, .. } => real(scale),
        Activation::Identity | Activation::Relu | Activation::Leaky { .. } | Activation::Table => {
            1.0
        }
    };
    Rescaling {
        scales,
        gate,
        skip: layer.skip.map_or(0.0, |skip| real(skip.scale)),
        saturation: saturation(integers.zero_point, integers.output_bits),
        codes,
    }
}

fn ending(halves: &HalfParameters) -> Ending {
    match halves.quantize {
        None => Ending::Round,
        Some(quantize) => Ending::Quantise {
            factor: f64::from(quantize.exponent).exp2(),
            saturation: saturation(quantize.zero_point, quantize.bits),
        },
    }
}

fn saturation(zero_point: i16, bits: u8) -> Saturation {
    let (low, high) = signed_range(bits);
    Saturation {
        zero: f64::from(zero_point),
        range: (f64::from(low), f64::from(high)),
    }
}

/// The scale that a multiplier stands for: exact, since a mantissa has 31 bits.
fn real(multiplier: Multiplier) -> f64 {
    f64::from(multiplier.mantissa()) / (1_u64 << multiplier.shift()) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Ground, Model};
    use crate::run::asset_of;
    use crate::tests::{small, source};
    use crate::{GridSampling, TrainConfig};

    /// Whether two layers compute the same. The zero point of the last layer and the gate of one
    /// that has none are nobody's business.
    fn are_alike(a: &Prepared, b: &Prepared, is_gated: bool) -> bool {
        let epilogues = match (&a.epilogue, &b.epilogue) {
            (Epilogue::Integer(a), Epilogue::Integer(b)) => {
                let hidden = |r: &Rescaling| format!("{} {:?}", r.skip, r.saturation);
                a.scales == b.scales
                    && a.codes == b.codes
                    && (!a.codes.is_empty() || hidden(a) == hidden(b))
                    && (!is_gated || a.gate == b.gate)
            }
            (a, b) => format!("{a:?}") == format!("{b:?}"),
        };
        epilogues
            && a.shape == b.shape
            && a.weights == b.weights
            && a.transposed == b.transposed
            && a.bias == b.bias
    }

    #[test]
    fn an_exported_network_comes_back_as_it_was() {
        let source = source(96, 80, 5);
        let mixed = vec![
            Precision::Int8,
            Precision::Fp16,
            Precision::Fp16,
            Precision::Int8,
        ];
        let base = TrainConfig {
            hidden: vec![32, 48],
            residual_blocks: 0,
            ..small()
        };
        for config in [
            small(),
            TrainConfig {
                precision: Precision::Fp16,
                sampling: [GridSampling::Interpolated; 2],
                ..small()
            },
            TrainConfig {
                activation: ActivationKind::HardGelu,
                weight_bits: 5,
                ..base.clone()
            },
            TrainConfig {
                activation: ActivationKind::ClampedHardGelu,
                activation_bits: 7,
                ..base.clone()
            },
            TrainConfig {
                hidden: vec![32, 48, 32],
                precision_per_layer: Some(mixed),
                ..base
            },
        ] {
            let ground = Ground::new(&config, &source).unwrap();
            let mut model = Model::new(&ground).unwrap();
            model.deploy(&ground);
            let asset = asset_of(&model, &ground, Vec::new()).unwrap();
            let (topology, found) = network(&asset).unwrap();
            assert_eq!(topology, ground.topology);
            let made = model.quantised(&ground).network;
            for (index, (found, made)) in found.layers.iter().zip(&made.layers).enumerate() {
                let is_gated = found.shape.activated
                    && matches!(
                        config.activation,
                        ActivationKind::HardGelu | ActivationKind::ClampedHardGelu
                    );
                assert!(
                    are_alike(found, made, is_gated),
                    "{config:?}, layer {index}"
                );
            }
            assert_eq!(found.layers.len(), made.layers.len());
            assert_eq!((found.activation, found.low), (made.activation, made.low));
            let own = ground.embedding(Numbers::Integer);
            assert_eq!(format!("{:?}", embedding(&asset)), format!("{own:?}"));
        }
    }
}
