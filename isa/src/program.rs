//! Program: a microprogram that fits an asset, and the compiler that makes one.

use crate::activation::Activation;
use crate::asset::Asset;
use crate::instruction::{Instruction, VECTOR_COUNT};
use crate::layout::Layout;
use crate::link::{self, LinkError};

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
            let (id, outputs) = (index as u16, layer.outputs);
            let src = registers[index];
            instructions.push(Instruction::Dense {
                layer: id,
                src,
                inputs: layer.inputs,
                outputs,
            });
            match layer.activation {
                Activation::Identity => {}
                Activation::Relu => instructions.push(Instruction::Relu { outputs }),
                Activation::Leaky { shift } => {
                    instructions.push(Instruction::Leaky {
                        shift: u16::from(shift),
                        outputs,
                    });
                }
                Activation::HardGelu { .. } => {
                    instructions.push(Instruction::Gate { layer: id, outputs });
                }
            }
            if index + 1 == asset.layers.len() {
                instructions.push(Instruction::Emit { layer: id, outputs });
                break;
            }
            let live = live_sources(asset, index, &registers);
            let free = (0..VECTOR_COUNT).find(|register| !live.contains(register));
            // A span is at most three layers, so at most three sources are live at once.
            let dst = free.unwrap_or(src);
            instructions.push(match layer.skip {
                None => Instruction::Rescale {
                    layer: id,
                    dst,
                    outputs,
                },
                Some(skip) => {
                    let source = registers[index + 1 - usize::from(skip.span)];
                    Instruction::RescaleSkip {
                        layer: id,
                        dst,
                        skip: source,
                        outputs,
                    }
                }
            });
            registers.push(dst);
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

/// The instructions that write the synthesizer's inputs to v0.
fn embed(asset: &Asset) -> Vec<Instruction> {
    let shape = &asset.shape;
    let [first, second] = [0, 1].map(|g: usize| shape.grids[g].channels);
    let mut lane = 0;
    let mut take = |lanes: u16| {
        let start = lane;
        lane += lanes;
        start
    };
    let mut instructions = vec![
        Instruction::Position { grid: 0 },
        Instruction::Fetch { grid: 0 },
        Instruction::Position { grid: 1 },
        Instruction::Fetch { grid: 1 },
        Instruction::Concat {
            dst: 0,
            lane: take(4 * first),
            grid: 0,
        },
        Instruction::Lerp {
            dst: 0,
            lane: take(second),
            grid: 1,
        },
    ];
    if shape.octaves > 0 {
        let octaves = u16::from(shape.octaves);
        instructions.push(Instruction::Wave {
            dst: 0,
            lane: take(shape.wave_count()),
            octaves,
        });
    }
    instructions.push(Instruction::Level {
        dst: 0,
        lane: take(1),
    });
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
