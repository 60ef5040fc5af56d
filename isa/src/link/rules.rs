//! Rules: what every instruction needs, and what it leaves.

use super::{Linker, Sums};
use crate::activation::Activation;
use crate::embed::WAVES_PER_OCTAVE;
use crate::instruction::Instruction;
use crate::layer::{Layer, Parameters};
use crate::shape::LaneFormat;

/// What was found, and what is allowed.
type Refusal = (String, String);

impl<'a> Linker<'a> {
    /// Checks an instruction against what the unit holds before it, and does it.
    pub(super) fn step(&mut self, instruction: &Instruction) -> Result<(), Refusal> {
        let shape = &self.asset.shape;
        match *instruction {
            Instruction::Position { grid } => {
                self.place("position")?;
                self.state.positioned[usize::from(grid)] = true;
            }
            Instruction::Fetch { grid } => {
                require(
                    self.state.positioned[usize::from(grid)],
                    "fetch",
                    "after `position` of the grid",
                )?;
                self.state.fetched[usize::from(grid)] = true;
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
                self.place(instruction.row().mnemonic)?;
                self.write(dst, lane, u32::from(WAVES_PER_OCTAVE * octaves))?;
            }
            Instruction::Level { dst, lane } => {
                self.place("level")?;
                self.write(dst, lane, 1)?;
            }
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
            Instruction::Collect { layer, outputs } => {
                self.holds(Some(layer), outputs, false)?;
                self.collect(outputs)?;
            }
            Instruction::CollectHalf { outputs } => {
                self.holds(None, outputs, true)?;
                self.collect(outputs)?;
            }
            Instruction::Footprint {} => {
                require(self.filters, "footprint", "in a program with `each`")?;
                let allowed = "once, before `each`";
                require(!self.has_place && !self.state.planned, "footprint", allowed)?;
                self.state.planned = true;
            }
            Instruction::Each {} => require(self.state.planned, "each", "after `footprint`")?,
            Instruction::Blend { outputs } => {
                let allowed = "once, after the loop of the footprint";
                require(self.is_behind && !self.state.sent, "blend", allowed)?;
                self.channels(outputs)?;
                self.state.sent = true;
            }
            // Loops were matched when they were unrolled.
            Instruction::Repeat { .. }
            | Instruction::Again {}
            | Instruction::Next {}
            | Instruction::End {} => {}
        }
        Ok(())
    }

    fn fetched(&self, grid: u16, mnemonic: &str) -> Result<(), Refusal> {
        require(
            self.state.fetched[usize::from(grid)],
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
    ) -> Result<(), Refusal> {
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
        self.state.sums = Some(Sums {
            layer,
            rows: sizes.1,
            is_half,
        });
        Ok(())
    }

    /// A register with at least so many lanes of a format.
    fn reads(&self, src: u16, lanes: u16, format: LaneFormat) -> Result<(), Refusal> {
        let (held, found) = (
            self.state.lanes[usize::from(src)],
            self.state.formats[usize::from(src)],
        );
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
    fn skip(&self, layer: u16, skip: u16, outputs: u16) -> Result<(), Refusal> {
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
    fn put(&mut self, layer: u16, dst: u16, outputs: u16) -> Result<(), Refusal> {
        self.state.lanes[usize::from(dst)] = u32::from(outputs);
        self.state.formats[usize::from(dst)] = self.layer(layer)?.output_format();
        self.state.sums = None;
        Ok(())
    }

    fn emit(&mut self, outputs: u16) -> Result<(), Refusal> {
        require(!self.filters, "emit", "`collect` in a program that filters")?;
        require(!self.state.sent, "emit", "one `emit` in a program")?;
        self.channels(outputs)?;
        self.state.sums = None;
        self.state.sent = true;
        Ok(())
    }

    fn collect(&mut self, outputs: u16) -> Result<(), Refusal> {
        let is_inside = self.filters && self.has_place;
        require(is_inside, "collect", "in the loop of a footprint")?;
        require(!self.state.collected, "collect", "one `collect` in a loop")?;
        self.channels(outputs)?;
        self.state.sums = None;
        self.state.collected = true;
        Ok(())
    }

    fn channels(&self, outputs: u16) -> Result<(), Refusal> {
        let channels = self.asset.shape.channel_count();
        let found = format!("{outputs} outputs");
        require(outputs == channels, found, format!("{channels}"))
    }

    fn layer(&self, layer: u16) -> Result<&'a Layer, Refusal> {
        let layers = &self.asset.layers;
        layers
            .get(usize::from(layer))
            .ok_or_else(|| (format!("l{layer}"), format!("l0 to l{}", layers.len() - 1)))
    }

    fn write(&mut self, dst: u16, lane: u16, lanes: u32) -> Result<(), Refusal> {
        let format = self.asset.shape.input_format();
        let held = &mut self.state.lanes[usize::from(dst)];
        if std::mem::replace(&mut self.state.formats[usize::from(dst)], format) != format {
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
    fn holds(&self, layer: Option<u16>, outputs: u16, is_half: bool) -> Result<Sums, Refusal> {
        let kind = |is_half| if is_half { "fp16 sums" } else { "accumulators" };
        let fitting = self.state.sums.filter(|sums| {
            sums.rows == outputs
                && sums.is_half == is_half
                && layer.is_none_or(|layer| layer == sums.layer)
        });
        fitting.ok_or_else(|| {
            let held = self
                .state
                .sums
                .map_or("no accumulators".to_owned(), |sums| {
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

pub(super) fn require(
    holds: bool,
    found: impl Into<String>,
    allowed: impl Into<String>,
) -> Result<(), Refusal> {
    if holds {
        Ok(())
    } else {
        Err((found.into(), allowed.into()))
    }
}
