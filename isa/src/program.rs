//! Program: a microprogram that fits an asset, and the compiler that makes one.

use crate::activation::Activation;
use crate::asset::Asset;
use crate::instruction::{Instruction, VECTOR_COUNT};
use crate::layout::Layout;
use std::fmt;

/// A microprogram that is known to fit one asset: every operand is in range, nothing is read
/// before it is written, and it ends.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Program {
    layout: Layout,
    instructions: Vec<Instruction>,
}

/// Why instructions do not fit an asset.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LinkError {
    /// The instruction, from 0.
    pub at: usize,
    /// What was found there.
    pub found: String,
    /// What is allowed there.
    pub allowed: String,
}

impl fmt::Display for LinkError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "instruction {}: found {}; allowed: {}",
            self.at, self.found, self.allowed
        )
    }
}

impl std::error::Error for LinkError {}

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
        Linker::new(asset).run(&instructions)?;
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

/// What each stage of the unit holds while a program is followed.
struct Linker<'a> {
    asset: &'a Asset,
    positioned: [bool; 2],
    fetched: [bool; 2],
    /// Lanes written of each vector register, from lane 0 without a gap.
    lanes: [u32; VECTOR_COUNT as usize],
    /// The layer and rows whose accumulators are held.
    accumulators: Option<(u16, u16)>,
    emitted: bool,
}

impl<'a> Linker<'a> {
    fn new(asset: &'a Asset) -> Linker<'a> {
        Linker {
            asset,
            positioned: [false; 2],
            fetched: [false; 2],
            lanes: [0; VECTOR_COUNT as usize],
            accumulators: None,
            emitted: false,
        }
    }

    fn run(mut self, instructions: &[Instruction]) -> Result<(), LinkError> {
        for (at, instruction) in instructions.iter().enumerate() {
            let row = instruction.row();
            for (field, number) in row.operands.iter().zip(instruction.operands()) {
                if number > field.max() {
                    let allowed = format!("{}: 0 to {}", field.name, field.max());
                    return Err(LinkError {
                        at,
                        found: number.to_string(),
                        allowed,
                    });
                }
            }
            let is_last = at + 1 == instructions.len();
            if matches!(instruction, Instruction::End {}) != is_last {
                let found = row.mnemonic.to_owned();
                let allowed = "`end` as the last instruction and nowhere else".to_owned();
                return Err(LinkError { at, found, allowed });
            }
            self.step(instruction)
                .map_err(|(found, allowed)| LinkError { at, found, allowed })?;
        }
        if self.emitted {
            Ok(())
        } else {
            let allowed = "a program that emits, then ends".to_owned();
            Err(LinkError {
                at: instructions.len(),
                found: "no `emit`".to_owned(),
                allowed,
            })
        }
    }

    fn step(&mut self, instruction: &Instruction) -> Result<(), (String, String)> {
        let shape = &self.asset.shape;
        match *instruction {
            Instruction::Position { grid } => self.positioned[usize::from(grid)] = true,
            Instruction::Fetch { grid } => {
                require(
                    self.positioned[usize::from(grid)],
                    "fetch",
                    "after `position` of the grid",
                )?;
                self.fetched[usize::from(grid)] = true;
            }
            Instruction::Concat { dst, lane, grid } => {
                require(
                    self.fetched[usize::from(grid)],
                    "concat",
                    "after `fetch` of the grid",
                )?;
                let lanes = 4 * u32::from(shape.grids[usize::from(grid)].channels);
                self.write(dst, lane, lanes)?;
            }
            Instruction::Lerp { dst, lane, grid } => {
                require(
                    self.fetched[usize::from(grid)],
                    "lerp",
                    "after `fetch` of the grid",
                )?;
                self.write(
                    dst,
                    lane,
                    u32::from(shape.grids[usize::from(grid)].channels),
                )?;
            }
            Instruction::Wave { dst, lane, octaves } => {
                self.write(dst, lane, 4 * u32::from(octaves))?
            }
            Instruction::Level { dst, lane } => self.write(dst, lane, 1)?,
            Instruction::Dense {
                layer,
                src,
                inputs,
                outputs,
            } => {
                let shape = self.layer(layer)?;
                let expected = (shape.inputs, shape.outputs);
                require(
                    (inputs, outputs) == expected,
                    format!("{inputs} inputs and {outputs} outputs"),
                    format!("{} and {}, the layer's", expected.0, expected.1),
                )?;
                let held = self.lanes[usize::from(src)];
                require(
                    held >= u32::from(inputs),
                    format!("v{src} with {held} lanes written"),
                    format!("a register with at least {inputs}"),
                )?;
                self.accumulators = Some((layer, outputs));
            }
            Instruction::Relu { outputs } | Instruction::Leaky { outputs, .. } => {
                self.holds(None, outputs)?;
            }
            Instruction::Gate { layer, outputs } => {
                self.holds(Some(layer), outputs)?;
                let is_gated = matches!(self.layer(layer)?.activation, Activation::HardGelu { .. });
                require(
                    is_gated,
                    format!("gate of l{layer}"),
                    "a layer with a hard GELU",
                )?;
            }
            Instruction::Rescale {
                layer,
                dst,
                outputs,
            } => {
                self.holds(Some(layer), outputs)?;
                self.lanes[usize::from(dst)] = u32::from(outputs);
                self.accumulators = None;
            }
            Instruction::RescaleSkip {
                layer,
                dst,
                skip,
                outputs,
            } => {
                self.holds(Some(layer), outputs)?;
                let has_skip = self.layer(layer)?.skip.is_some();
                require(
                    has_skip,
                    format!("skip into l{layer}"),
                    "a layer with a skip path",
                )?;
                let held = self.lanes[usize::from(skip)];
                require(
                    held >= u32::from(outputs),
                    format!("v{skip} with {held} lanes written"),
                    format!("a register with at least {outputs}"),
                )?;
                self.lanes[usize::from(dst)] = u32::from(outputs);
                self.accumulators = None;
            }
            Instruction::Emit { layer, outputs } => {
                self.holds(Some(layer), outputs)?;
                let channels = shape.channel_count();
                require(
                    outputs == channels,
                    format!("{outputs} outputs"),
                    format!("{channels}"),
                )?;
                self.accumulators = None;
                self.emitted = true;
            }
            Instruction::End {} => {}
        }
        Ok(())
    }

    fn layer(&self, layer: u16) -> Result<&'a crate::layer::Layer, (String, String)> {
        let layers = &self.asset.layers;
        layers
            .get(usize::from(layer))
            .ok_or_else(|| (format!("l{layer}"), format!("l0 to l{}", layers.len() - 1)))
    }

    fn write(&mut self, dst: u16, lane: u16, lanes: u32) -> Result<(), (String, String)> {
        let held = &mut self.lanes[usize::from(dst)];
        require(
            u32::from(lane) <= *held,
            format!("lane {lane}"),
            format!("at most {held}: a register is written without gaps"),
        )?;
        *held = (*held).max(u32::from(lane) + lanes);
        let limit = u32::from(crate::limits::MAX_LANES);
        require(
            *held <= limit,
            format!("{held} lanes"),
            format!("at most {limit}"),
        )
    }

    fn holds(&self, layer: Option<u16>, outputs: u16) -> Result<(), (String, String)> {
        let fits = self
            .accumulators
            .is_some_and(|(l, o)| o == outputs && layer.is_none_or(|layer| layer == l));
        let held = self
            .accumulators
            .map_or("no accumulators".to_owned(), |(l, o)| {
                format!("{o} accumulators of l{l}")
            });
        let wanted = layer.map_or(String::new(), |l| format!(" of l{l}"));
        require(fits, held, format!("{outputs} accumulators{wanted}"))
    }
}

fn require(
    holds: bool,
    found: impl Into<String>,
    allowed: impl Into<String>,
) -> Result<(), (String, String)> {
    if holds {
        Ok(())
    } else {
        Err((found.into(), allowed.into()))
    }
}
