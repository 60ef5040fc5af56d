//! Work: what one texel asks of each resource, read off the program.

use ntmu_isa::instruction::Instruction;
use ntmu_isa::layer::Parameters;
use ntmu_isa::shape::LaneFormat;
use ntmu_isa::{Asset, Program};

/// What the array multiplies: it decides how many passes a product takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Operands {
    /// Weights of at most 4 bits, values of at most 8.
    Narrow,
    /// Weights and values of at most 8 bits.
    Bytes,
    /// Weights of at most 8 bits, values of 9 to 16.
    Wide,
    /// Halves.
    Half,
}

/// One multiplication of a vector by a layer's weights, and what is done to its accumulators.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Dense {
    /// The layer.
    pub layer: u16,
    /// What is multiplied.
    pub operands: Operands,
    /// Lanes of the vector multiplied.
    pub inputs: u32,
    /// Accumulators made.
    pub outputs: u32,
    /// Slots of a requantiser lane per texel: a slot is one wide multiplication.
    pub requantizer_slots: u32,
    /// Activations read from the residual store per texel.
    pub skip_reads: u32,
    /// Bytes of the layer's parameters; see [`ntmu_isa::layer::Layer::parameter_bits`].
    pub parameter_bytes: u64,
}

impl Dense {
    /// Multiplications per texel.
    #[must_use]
    pub fn macs(&self) -> u64 {
        u64::from(self.inputs) * u64::from(self.outputs)
    }
}

/// What one texel asks of each resource.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Grid positions.
    pub positions: u32,
    /// Multiply-add steps of an address generator; see [`Layout::address_steps`].
    ///
    /// [`Layout::address_steps`]: ntmu_isa::layout::Layout::address_steps
    pub address_steps: u32,
    /// Fetches: four corners each.
    pub fetches: u32,
    /// Latents unpacked, of all corners.
    pub unpacked: u32,
    /// Latents interpolated.
    pub interpolated: u32,
    /// Waves, levels and zeros written.
    pub embedded: u32,
    /// The layers, in program order.
    pub dense: Vec<Dense>,
    /// Channels emitted.
    pub channels: u32,
}

/// Slots of a requantiser lane that an accumulator takes.
///
/// A slot is one pass of the lane's multiplier. A ReLU or a leak is a comparator and a shifter in
/// front of it and takes none. A hard GELU takes two: to its 8.8 argument, and the product with the
/// gate; the `rescale` that follows takes its own. A table takes one, to its index; the `rescale`
/// that follows takes one too, though it only adds, because the accumulator passes the lane again.
///
/// The steps of an fp16 layer are charged like those that they stand for. A hard GELU is two
/// products there as well, with the gate and with the constant; a conversion to halves, integers or
/// codes is the rescale. A skip path is added at the port of the residual store in both.
const RELU_SLOTS: u32 = 0;
const GATE_SLOTS: u32 = 2;
const TABLE_SLOTS: u32 = 1;
const RESCALE_SLOTS: u32 = 1;

/// What one texel asks of each resource when `program` decodes it. The program was compiled for, or
/// linked to, this asset.
#[must_use]
pub fn work_of(asset: &Asset, program: &Program) -> Work {
    let mut work = Work::default();
    let channels = |grid: u16| u32::from(asset.shape.grids[usize::from(grid)].channels);
    for instruction in program.steps() {
        match *instruction {
            Instruction::Position { grid: _ } => work.positions += 1,
            Instruction::Fetch { grid } => {
                work.fetches += 1;
                let layout = program.layout();
                work.address_steps += layout.address_steps(&asset.shape, usize::from(grid));
            }
            Instruction::Concat {
                dst: _,
                lane: _,
                grid,
            } => work.unpacked += 4 * channels(grid),
            Instruction::Lerp {
                dst: _,
                lane: _,
                grid,
            } => {
                work.unpacked += 4 * channels(grid);
                work.interpolated += channels(grid);
            }
            Instruction::Wave {
                dst: _,
                lane: _,
                octaves,
            }
            | Instruction::Saw {
                dst: _,
                lane: _,
                octaves,
            } => {
                work.embedded += u32::from(ntmu_isa::embed::WAVES_PER_OCTAVE * octaves);
            }
            Instruction::Level { dst: _, lane: _ } => work.embedded += 1,
            Instruction::Zero {
                dst: _,
                lane: _,
                lanes,
            } => work.embedded += u32::from(lanes),
            Instruction::Dense {
                layer,
                src: _,
                inputs,
                outputs,
            }
            | Instruction::DenseHalf {
                layer,
                src: _,
                inputs,
                outputs,
            } => work.dense.push(Dense {
                layer,
                operands: operands(asset, usize::from(layer)),
                inputs: u32::from(inputs),
                outputs: u32::from(outputs),
                requantizer_slots: 0,
                skip_reads: 0,
                parameter_bytes: asset.layers[usize::from(layer)]
                    .parameter_bits(asset.profile.bias_bits)
                    .div_ceil(8),
            }),
            Instruction::Relu { outputs }
            | Instruction::Leaky { shift: _, outputs }
            | Instruction::ReluHalf { outputs }
            | Instruction::LeakyHalf { shift: _, outputs } => {
                work.requantize(RELU_SLOTS, outputs);
            }
            Instruction::Gate { layer: _, outputs }
            | Instruction::GateHalf {
                clamped: _,
                outputs,
            } => work.requantize(GATE_SLOTS, outputs),
            Instruction::Table { layer: _, outputs } => work.requantize(TABLE_SLOTS, outputs),
            Instruction::Rescale {
                layer: _,
                dst: _,
                outputs,
            }
            | Instruction::RoundHalf { dst: _, outputs }
            | Instruction::QuantizeHalf {
                layer: _,
                dst: _,
                outputs,
            } => work.requantize(RESCALE_SLOTS, outputs),
            Instruction::RescaleSkip {
                layer: _,
                dst: _,
                skip: _,
                outputs,
            } => {
                // The skip path's own multiplier sits at the port of the residual store.
                work.requantize(RESCALE_SLOTS, outputs);
                work.read_skip(outputs);
            }
            Instruction::SkipHalf { skip: _, outputs } => work.read_skip(outputs),
            Instruction::Emit { layer: _, outputs }
            | Instruction::EmitHalf { outputs }
            | Instruction::Collect { layer: _, outputs }
            | Instruction::CollectHalf { outputs } => {
                work.requantize(RESCALE_SLOTS, outputs);
                work.channels += u32::from(outputs);
            }
            // The footprint and the filter are no decode's; control takes no resource.
            Instruction::Footprint {}
            | Instruction::Blend { outputs: _ }
            | Instruction::Repeat { times: _, step: _ }
            | Instruction::Again {}
            | Instruction::Each {}
            | Instruction::Next {}
            | Instruction::End {} => {}
        }
    }
    work
}

/// What the array multiplies for a layer.
fn operands(asset: &Asset, layer: usize) -> Operands {
    match (&asset.layers[layer].parameters, asset.input_format(layer)) {
        (Parameters::Half(_), _) => Operands::Half,
        (Parameters::Integer(numbers), LaneFormat::Integer { bits: ..=8, .. }) => {
            if numbers.weight_bits <= 4 {
                Operands::Narrow
            } else {
                Operands::Bytes
            }
        }
        (Parameters::Integer(_), LaneFormat::Integer { .. } | LaneFormat::Half) => Operands::Wide,
    }
}

impl Work {
    /// Accumulators are the last `dense`'s; a linked program has one before it touches any.
    fn requantize(&mut self, slots: u32, outputs: u16) {
        if let Some(dense) = self.dense.last_mut() {
            dense.requantizer_slots += slots * u32::from(outputs);
        }
    }

    fn read_skip(&mut self, outputs: u16) {
        if let Some(dense) = self.dense.last_mut() {
            dense.skip_reads += u32::from(outputs);
        }
    }

    /// Multiplications per texel.
    #[must_use]
    pub fn macs(&self) -> u64 {
        self.dense.iter().map(Dense::macs).sum()
    }

    /// Slots of requantiser lanes per texel.
    #[must_use]
    pub fn requantizer_slots(&self) -> u64 {
        self.dense
            .iter()
            .map(|dense| u64::from(dense.requantizer_slots))
            .sum()
    }

    /// Bytes of parameters that the program reads, each layer's once.
    #[must_use]
    pub fn parameter_bytes(&self) -> u64 {
        let mut layers: Vec<(u16, u64)> = self
            .dense
            .iter()
            .map(|dense| (dense.layer, dense.parameter_bytes))
            .collect();
        layers.sort_unstable();
        layers.dedup();
        layers.iter().map(|layer| layer.1).sum()
    }
}
