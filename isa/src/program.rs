//! Program: a microprogram that fits an asset, and the compiler that makes one.

use crate::activation::Activation;
use crate::asset::Asset;
use crate::embed::Wave;
use crate::instruction::{Instruction, VECTOR_COUNT};
use crate::layer::{HalfParameters, Layer, Parameters};
use crate::layout::Layout;
use crate::link::{self, LinkError};
use crate::shape::Sampling;

/// A microprogram that is known to fit one asset: every operand is in range, nothing is read
/// before it is written, and it ends.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Program {
    layout: Layout,
    instructions: Vec<Instruction>,
}

impl Program {
    /// The program that decodes one texel of an asset.
    #[must_use]
    pub fn compile(asset: &Asset, layout: Layout) -> Program {
        let mut instructions = embed(asset);
        // Register v0 holds the inputs. A layer writes the register after the one it reads, but
        // never the one that a skip path still needs.
        let mut registers = vec![0_u16];
        for (index, layer) in asset.layers.iter().enumerate() {
            let live = live_sources(asset, index, &registers);
            let free = (0..VECTOR_COUNT).find(|register| !live.contains(register));
            let place = Place {
                layer: index as u16,
                src: registers[index],
                // A span is at most three layers, so at most three sources are live at once.
                dst: free.unwrap_or(registers[index]),
                skip: layer
                    .skip
                    .map(|skip| registers[index + 1 - usize::from(skip.span)]),
                is_last: index + 1 == asset.layers.len(),
            };
            match &layer.parameters {
                Parameters::Integer(_) => integer_layer(layer, &place, &mut instructions),
                Parameters::Half(half) => half_layer(layer, half, &place, &mut instructions),
            }
            registers.push(place.dst);
        }
        instructions.push(Instruction::End {});
        Program {
            layout,
            instructions,
        }
    }

    /// Instructions from elsewhere, checked against the asset that they are to decode.
    ///
    /// # Errors
    /// The first instruction that does not fit.
    pub fn link(
        asset: &Asset,
        layout: Layout,
        instructions: Vec<Instruction>,
    ) -> Result<Program, LinkError> {
        link::check(asset, &instructions)?;
        Ok(Program {
            layout,
            instructions,
        })
    }

    /// Where the unit's memory keeps the grids.
    #[must_use]
    pub fn layout(&self) -> Layout {
        self.layout
    }

    /// The instructions, `end` last.
    #[must_use]
    pub fn instructions(&self) -> &[Instruction] {
        &self.instructions
    }
}

/// Where a layer stands in the program.
struct Place {
    layer: u16,
    src: u16,
    dst: u16,
    skip: Option<u16>,
    is_last: bool,
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
    instructions.push(match place.skip {
        _ if place.is_last => Instruction::Emit { layer: id, outputs },
        None => Instruction::Rescale {
            layer: id,
            dst,
            outputs,
        },
        Some(skip) => Instruction::RescaleSkip {
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
    instructions.push(match parameters.quantize {
        _ if place.is_last => Instruction::EmitHalf { outputs },
        None => Instruction::RoundHalf {
            dst: place.dst,
            outputs,
        },
        Some(_) => Instruction::QuantizeHalf {
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

/// The registers that must survive layer `index`: its skip source, and the outputs (the inputs of
/// the layers up to this one) that a later skip path starts from.
fn live_sources(asset: &Asset, index: usize, registers: &[u16]) -> Vec<u16> {
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
