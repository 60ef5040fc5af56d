//! Link: whether instructions from elsewhere fit an asset.
//!
//! A program that passes reads nothing before it is written and no operand is out of range, so
//! running it cannot fail. What it computes is its author's business.

use crate::activation::Activation;
use crate::asset::Asset;
use crate::embed::WAVES_PER_OCTAVE;
use crate::instruction::{Instruction, VECTOR_COUNT};
use crate::layer::{Layer, Parameters};
use crate::shape::LaneFormat;
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
    /// What the lanes hold.
    formats: [LaneFormat; VECTOR_COUNT as usize],
    sums: Option<Sums>,
    emitted: bool,
}

/// The accumulators that are held.
#[derive(Clone, Copy)]
struct Sums {
    layer: u16,
    rows: u16,
    is_half: bool,
}

impl<'a> Linker<'a> {
    fn new(asset: &'a Asset) -> Linker<'a> {
        Linker {
            asset,
            positioned: [false; 2],
            fetched: [false; 2],
            lanes: [0; VECTOR_COUNT as usize],
            formats: [asset.shape.input_format(); VECTOR_COUNT as usize],
            sums: None,
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
                self.fetched(grid, "concat")?;
                let channels = shape.grids[usize::from(grid)].channels;
                self.write(dst, lane, 4 * u32::from(channels))?;
            }
            Instruction::Lerp { dst, lane, grid } => {
                self.fetched(grid, "lerp")?;
                let channels = shape.grids[usize::from(grid)].channels;
                self.write(dst, lane, u32::from(channels))?;
            }
            Instruction::Wave { dst, lane, octaves } | Instruction::Saw { dst, lane, octaves } => {
                self.write(dst, lane, u32::from(WAVES_PER_OCTAVE * octaves))?;
            }
            Instruction::Level { dst, lane } => self.write(dst, lane, 1)?,
            Instruction::Zero { dst, lane, lanes } => self.write(dst, lane, u32::from(lanes))?,
            Instruction::Dense {
                layer,
                src,
                inputs,
                outputs,
            } => self.dense(layer, src, (inputs, outputs), false)?,
            Instruction::DenseHalf {
                layer,
                src,
                inputs,
                outputs,
            } => self.dense(layer, src, (inputs, outputs), true)?,
            Instruction::Relu { outputs } | Instruction::Leaky { outputs, .. } => {
                self.holds(None, outputs, false)?;
            }
            Instruction::ReluHalf { outputs }
            | Instruction::LeakyHalf { outputs, .. }
            | Instruction::GateHalf { outputs, .. } => {
                self.holds(None, outputs, true)?;
            }
            Instruction::Gate { layer, outputs } => {
                self.holds(Some(layer), outputs, false)?;
                let is_gated = matches!(self.layer(layer)?.activation, Activation::HardGelu { .. });
                require(
                    is_gated,
                    format!("gate of l{layer}"),
                    "a layer with a hard GELU",
                )?;
            }
            Instruction::Table { layer, outputs } => {
                self.holds(Some(layer), outputs, false)?;
                require(
                    self.layer(layer)?.activation == Activation::Table,
                    format!("table of l{layer}"),
                    "a layer with a table",
                )?;
            }
            Instruction::Rescale {
                layer,
                dst,
                outputs,
            } => {
                self.holds(Some(layer), outputs, false)?;
                self.put(layer, dst, outputs)?;
            }
            Instruction::RescaleSkip {
                layer,
                dst,
                skip,
                outputs,
            } => {
                self.holds(Some(layer), outputs, false)?;
                self.skip(layer, skip, outputs)?;
                self.put(layer, dst, outputs)?;
            }
            Instruction::SkipHalf { skip, outputs } => {
                let sums = self.holds(None, outputs, true)?;
                self.skip(sums.layer, skip, outputs)?;
            }
            Instruction::RoundHalf { dst, outputs } => {
                let sums = self.holds(None, outputs, true)?;
                let format = self.layer(sums.layer)?.output_format();
                require(
                    format == LaneFormat::Half,
                    format!("halves of l{}", sums.layer),
                    "integers, which its next layer reads",
                )?;
                self.put(sums.layer, dst, outputs)?;
            }
            Instruction::QuantizeHalf {
                layer,
                dst,
                outputs,
            } => {
                self.holds(Some(layer), outputs, true)?;
                let format = self.layer(layer)?.output_format();
                require(
                    format != LaneFormat::Half,
                    format!("integers of l{layer}"),
                    "halves, which its next layer reads",
                )?;
                self.put(layer, dst, outputs)?;
            }
            Instruction::Emit { layer, outputs } => {
                self.holds(Some(layer), outputs, false)?;
                self.emit(outputs)?;
            }
            Instruction::EmitHalf { outputs } => {
                self.holds(None, outputs, true)?;
                self.emit(outputs)?;
            }
            Instruction::End {} => {}
        }
        Ok(())
    }

    fn fetched(&self, grid: u16, mnemonic: &str) -> Result<(), (String, String)> {
        require(
            self.fetched[usize::from(grid)],
            mnemonic,
            "after `fetch` of the grid",
        )
    }

    fn dense(
        &mut self,
        layer: u16,
        src: u16,
        sizes: (u16, u16),
        is_half: bool,
    ) -> Result<(), (String, String)> {
        let parameters = self.layer(layer)?;
        require(
            matches!(parameters.parameters, Parameters::Half(_)) == is_half,
            format!("l{layer} of the other arithmetic"),
            "`dense` of an integer layer, `dense.half` of an fp16 layer",
        )?;
        let expected = (parameters.inputs, parameters.outputs);
        require(
            sizes == expected,
            format!("{} inputs and {} outputs", sizes.0, sizes.1),
            format!("{} and {}, the layer's", expected.0, expected.1),
        )?;
        self.reads(src, sizes.0, self.asset.input_format(usize::from(layer)))?;
        self.sums = Some(Sums {
            layer,
            rows: sizes.1,
            is_half,
        });
        Ok(())
    }

    /// A register with at least so many lanes of a format.
    fn reads(&self, src: u16, lanes: u16, format: LaneFormat) -> Result<(), (String, String)> {
        let (held, found) = (self.lanes[usize::from(src)], self.formats[usize::from(src)]);
        require(
            held >= u32::from(lanes),
            format!("v{src} with {held} lanes written"),
            format!("a register with at least {lanes}"),
        )?;
        require(
            found == format,
            format!("v{src} of {}", describe(found)),
            format!("a register of {}", describe(format)),
        )
    }

    /// The source of a layer's skip path.
    fn skip(&self, layer: u16, skip: u16, outputs: u16) -> Result<(), (String, String)> {
        self.layer(layer)?;
        match self.asset.skip_source(usize::from(layer)) {
            Some(source) => {
                let format = self.asset.layers[source].output_format();
                self.reads(skip, outputs, format)
            }
            None => require(
                false,
                format!("skip into l{layer}"),
                "a layer with a skip path",
            ),
        }
    }

    /// The held accumulators become a layer's outputs.
    fn put(&mut self, layer: u16, dst: u16, outputs: u16) -> Result<(), (String, String)> {
        self.lanes[usize::from(dst)] = u32::from(outputs);
        self.formats[usize::from(dst)] = self.layer(layer)?.output_format();
        self.sums = None;
        Ok(())
    }

    fn emit(&mut self, outputs: u16) -> Result<(), (String, String)> {
        let channels = self.asset.shape.channel_count();
        require(
            outputs == channels,
            format!("{outputs} outputs"),
            format!("{channels}"),
        )?;
        self.sums = None;
        self.emitted = true;
        Ok(())
    }

    fn layer(&self, layer: u16) -> Result<&'a Layer, (String, String)> {
        let layers = &self.asset.layers;
        layers
            .get(usize::from(layer))
            .ok_or_else(|| (format!("l{layer}"), format!("l0 to l{}", layers.len() - 1)))
    }

    fn write(&mut self, dst: u16, lane: u16, lanes: u32) -> Result<(), (String, String)> {
        let format = self.asset.shape.input_format();
        let held = &mut self.lanes[usize::from(dst)];
        if std::mem::replace(&mut self.formats[usize::from(dst)], format) != format {
            *held = 0;
        }
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

    /// The held accumulators, if they are `outputs` of the kind, and of the layer where one is
    /// named.
    fn holds(
        &self,
        layer: Option<u16>,
        outputs: u16,
        is_half: bool,
    ) -> Result<Sums, (String, String)> {
        let kind = |is_half| if is_half { "fp16 sums" } else { "accumulators" };
        let fitting = self.sums.filter(|sums| {
            sums.rows == outputs
                && sums.is_half == is_half
                && layer.is_none_or(|layer| layer == sums.layer)
        });
        fitting.ok_or_else(|| {
            let held = self.sums.map_or("no accumulators".to_owned(), |sums| {
                format!("{} {} of l{}", sums.rows, kind(sums.is_half), sums.layer)
            });
            let wanted = layer.map_or(String::new(), |l| format!(" of l{l}"));
            (held, format!("{outputs} {}{wanted}", kind(is_half)))
        })
    }
}

fn describe(format: LaneFormat) -> String {
    match format {
        LaneFormat::Integer { bits, zero_point } => {
            format!("{bits}-bit integers about {zero_point}")
        }
        LaneFormat::Half => "halves".to_owned(),
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
