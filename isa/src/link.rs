//! Link: whether instructions from elsewhere fit an asset.
//!
//! A program that passes reads nothing before it is written and no operand is out of range, so
//! running it cannot fail. What it computes is its author's business.

use crate::activation::Activation;
use crate::asset::Asset;
use crate::instruction::{Instruction, VECTOR_COUNT};
use std::fmt;

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

/// Follows the instructions once and checks each against what the unit holds before it.
pub(crate) fn check(asset: &Asset, instructions: &[Instruction]) -> Result<(), LinkError> {
    Linker::new(asset).run(instructions)
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
