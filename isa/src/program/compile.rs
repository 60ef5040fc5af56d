//! Compile: an asset becomes the instructions that decode one texel of it, or one sample.

use super::fold::fold;
use crate::activation::Activation;
use crate::asset::Asset;
use crate::embed::Wave;
use crate::instruction::{Instruction, VECTOR_COUNT};
use crate::layer::{HalfParameters, Layer, Parameters};
use crate::shape::Sampling;

/// What a program is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Purpose {
    Texel,
    Sample,
}

/// The instructions for an asset, equal blocks of layers folded into loops.
pub(super) fn compile(asset: &Asset, purpose: Purpose) -> Vec<Instruction> {
    let decode = fold(&decode(asset, purpose));
    match purpose {
        Purpose::Texel => [decode, vec![Instruction::End {}]].concat(),
        Purpose::Sample => {
            let outputs = asset.shape.channel_count();
            let before = vec![Instruction::Footprint {}, Instruction::Each {}];
            let blend = Instruction::Blend { outputs };
            let after = vec![Instruction::Next {}, blend, Instruction::End {}];
            [before, decode, after].concat()
        }
    }
}

/// One decode, without loops.
fn decode(asset: &Asset, purpose: Purpose) -> Vec<Instruction> {
    let mut instructions = embed(asset);
    // Register v0 holds the inputs.
    let mut registers = vec![0_u16];
    for (index, layer) in asset.layers.iter().enumerate() {
        let place = Place {
            layer: index as u16,
            src: registers[index],
            dst: destination(asset, index, &registers),
            skip: layer
                .skip
                .map(|skip| registers[index + 1 - usize::from(skip.span)]),
            last: (index + 1 == asset.layers.len()).then_some(purpose),
        };
        match &layer.parameters {
            Parameters::Integer(_) => integer_layer(layer, &place, &mut instructions),
            Parameters::Half(half) => half_layer(layer, half, &place, &mut instructions),
        }
        registers.push(place.dst);
    }
    instructions
}

/// The register that a layer writes: never the one that it reads, nor one that a later skip path
/// starts from.
///
/// A layer at the end of a skip path writes over its source where it may, so that a block of layers
/// leaves its result where it found its input, and equal blocks become equal instructions. Any other
/// takes the first free register. A span is at most three layers, so at most three registers are
/// held at once.
fn destination(asset: &Asset, index: usize, registers: &[u16]) -> u16 {
    let live = live_registers(asset, index, registers);
    let skip = asset.layers[index].skip;
    let source = skip.map(|skip| registers[index + 1 - usize::from(skip.span)]);
    source
        .into_iter()
        .chain(0..VECTOR_COUNT)
        .find(|register| !live.contains(register))
        .unwrap_or(registers[index])
}

/// Where a layer stands in the program.
struct Place {
    layer: u16,
    src: u16,
    dst: u16,
    skip: Option<u16>,
    /// In the last layer, what its codes are for.
    last: Option<Purpose>,
}

fn integer_layer(layer: &Layer, place: &Place, instructions: &mut Vec<Instruction>) {
    let Layer {
        inputs, outputs, ..
    } = *layer;
    let id = place.layer;
    instructions.push(Instruction::Dense {
        layer: id,
        src: place.src,
        inputs,
        outputs,
    });
    match layer.activation {
        Activation::Identity => {}
        Activation::Relu => instructions.push(Instruction::Relu { outputs }),
        Activation::Leaky { shift } => instructions.push(Instruction::Leaky {
            shift: u16::from(shift),
            outputs,
        }),
        Activation::HardGelu { .. } => {
            instructions.push(Instruction::Gate { layer: id, outputs });
        }
        Activation::Table => instructions.push(Instruction::Table { layer: id, outputs }),
    }
    let dst = place.dst;
    instructions.push(match (place.last, place.skip) {
        (Some(Purpose::Texel), _) => Instruction::Emit { layer: id, outputs },
        (Some(Purpose::Sample), _) => Instruction::Collect { layer: id, outputs },
        (None, None) => Instruction::Rescale {
            layer: id,
            dst,
            outputs,
        },
        (None, Some(skip)) => Instruction::RescaleSkip {
            layer: id,
            dst,
            skip,
            outputs,
        },
    });
}

fn half_layer(
    layer: &Layer,
    parameters: &HalfParameters,
    place: &Place,
    instructions: &mut Vec<Instruction>,
) {
    let Layer {
        inputs, outputs, ..
    } = *layer;
    instructions.push(Instruction::DenseHalf {
        layer: place.layer,
        src: place.src,
        inputs,
        outputs,
    });
    match layer.activation {
        // A validated fp16 layer has no table.
        Activation::Identity | Activation::Table => {}
        Activation::Relu => instructions.push(Instruction::ReluHalf { outputs }),
        Activation::Leaky { shift } => instructions.push(Instruction::LeakyHalf {
            shift: u16::from(shift),
            outputs,
        }),
        Activation::HardGelu { is_clamped, .. } => instructions.push(Instruction::GateHalf {
            clamped: u16::from(is_clamped),
            outputs,
        }),
    }
    if let Some(skip) = place.skip {
        instructions.push(Instruction::SkipHalf { skip, outputs });
    }
    instructions.push(match (place.last, parameters.quantize) {
        (Some(Purpose::Texel), _) => Instruction::EmitHalf { outputs },
        (Some(Purpose::Sample), _) => Instruction::CollectHalf { outputs },
        (None, None) => Instruction::RoundHalf {
            dst: place.dst,
            outputs,
        },
        (None, Some(_)) => Instruction::QuantizeHalf {
            layer: place.layer,
            dst: place.dst,
            outputs,
        },
    });
}

/// The instructions that write the synthesizer's inputs to v0.
fn embed(asset: &Asset) -> Vec<Instruction> {
    let shape = &asset.shape;
    let mut instructions = Vec::new();
    for grid in [0, 1] {
        instructions.push(Instruction::Position { grid });
        instructions.push(Instruction::Fetch { grid });
    }
    let dst = 0;
    let mut next = 0;
    let mut take = |lanes: u16| {
        let lane = next;
        next += lanes;
        lane
    };
    for (grid, sizes) in (0..).zip(&shape.grids) {
        let lane = take(sizes.input_count());
        instructions.push(match sizes.sampling {
            Sampling::Corners => Instruction::Concat { dst, lane, grid },
            Sampling::Interpolated => Instruction::Lerp { dst, lane, grid },
        });
    }
    if shape.octaves > 0 {
        let octaves = u16::from(shape.octaves);
        let lane = take(shape.wave_count());
        instructions.push(match shape.wave {
            Wave::Triangle => Instruction::Wave { dst, lane, octaves },
            Wave::Saw => Instruction::Saw { dst, lane, octaves },
        });
    }
    instructions.push(Instruction::Level { dst, lane: take(1) });
    if shape.padding > 0 {
        let lanes = u16::from(shape.padding);
        let lane = take(lanes);
        instructions.push(Instruction::Zero { dst, lane, lanes });
    }
    instructions
}

/// The registers that must survive layer `index`: the one that it reads, and those that a later skip
/// path starts from.
fn live_registers(asset: &Asset, index: usize, registers: &[u16]) -> Vec<u16> {
    asset
        .layers
        .iter()
        .enumerate()
        .skip(index + 1)
        .filter_map(|(later, layer)| {
            let start = later + 1 - usize::from(layer.skip?.span);
            registers.get(start).copied()
        })
        .chain([registers[index]])
        .collect()
}
