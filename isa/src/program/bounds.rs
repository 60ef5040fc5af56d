//! Bounds: between which numbers every sum of a program lies, whatever the grids hold and whichever
//! place is decoded.
//!
//! The program is followed with an interval for every lane and accumulator. Every step between two
//! sums is monotone but for the gate and the table, whose extremes are looked for; a sum's interval
//! is taken over all its prefixes, because an accumulator is as narrow after every product. Intervals
//! forget that lanes depend on each other, so the bounds are sound and can be wider than what is
//! reached. An overflow is legal, for the profile says what it does; this says where none can be.

use super::Program;
use crate::accumulate::{Accumulator, signed_range};
use crate::activation::{Activation, gate, gate_argument, leak, table_index};
use crate::asset::Asset;
use crate::embed::{WAVES_PER_OCTAVE, corner_input};
use crate::instruction::{Instruction, VECTOR_COUNT};
use crate::layer::{IntegerParameters, Layer};
use crate::limits::MAX_LANES;
use crate::round::saturate;
use crate::shape::LaneFormat;
use std::fmt;

/// Between which numbers the accumulators of a layer lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SumBound {
    /// The layer.
    pub layer: u16,
    /// No accumulator is smaller, after its bias or after any product, in rows of any width.
    pub low: i64,
    /// Nor larger.
    pub high: i64,
    /// The narrowest signed accumulator that holds both.
    pub bits: u8,
    /// The profile's accumulator.
    pub accumulator: Accumulator,
}

impl SumBound {
    /// An accumulator of the profile's width may be too narrow. Where it is not, none ever is.
    #[must_use]
    pub const fn may_overflow(&self) -> bool {
        self.bits > self.accumulator.bits
    }
}

impl fmt::Display for SumBound {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Accumulator { bits, overflow } = self.accumulator;
        let verdict = if self.may_overflow() {
            format!("may overflow, then {}s", overflow.name())
        } else {
            "never overflows".to_owned()
        };
        write!(
            f,
            "l{}: sums within {}..={}, {} bits; an accumulator of {bits} {verdict}",
            self.layer, self.low, self.high, self.bits
        )
    }
}

impl Program {
    /// A bound for every multiplication of an integer layer, in the order of the steps. The asset is
    /// the one that the program was compiled for or linked to.
    #[must_use]
    pub fn sum_bounds(&self, asset: &Asset) -> Vec<SumBound> {
        let mut follower = Follower::new(asset);
        let body = self.footprint_loop();
        for (at, step) in self.steps().iter().enumerate() {
            if body.as_ref().is_some_and(|body| body.start == at) {
                // What the registers hold when the loop comes round again.
                follower.registers = Follower::unknown();
            }
            follower.step(step);
        }
        follower.bounds
    }

    /// The bounds of layers whose accumulators may overflow; empty is the proof that none can.
    #[must_use]
    pub fn overflows(&self, asset: &Asset) -> Vec<SumBound> {
        let mut bounds = self.sum_bounds(asset);
        bounds.retain(SumBound::may_overflow);
        bounds
    }
}

/// The smallest and the largest that a number can be.
type Interval = (i64, i64);

/// What the accumulators hold.
#[derive(Clone, Copy)]
enum Held {
    Sums,
    Gated,
    LookedUp,
}

/// A program being followed.
struct Follower<'a> {
    asset: &'a Asset,
    registers: [Vec<Interval>; VECTOR_COUNT as usize],
    sums: Vec<Interval>,
    held: Held,
    bounds: Vec<SumBound>,
}

fn widen((low, high): (i32, i32)) -> Interval {
    (low.into(), high.into())
}

/// The values of a monotone function at the ends, which lie within 32 bits.
fn at_ends((low, high): Interval, function: impl Fn(i32) -> i32) -> Interval {
    let of = |end: i64| i64::from(function(saturate(end, i32::MIN, i32::MAX)));
    (of(low), of(high))
}

impl<'a> Follower<'a> {
    fn new(asset: &'a Asset) -> Follower<'a> {
        Follower {
            asset,
            registers: Follower::unknown(),
            sums: Vec::new(),
            held: Held::Sums,
            bounds: Vec::new(),
        }
    }

    fn unknown() -> [Vec<Interval>; VECTOR_COUNT as usize] {
        std::array::from_fn(|_| vec![widen(signed_range(16)); usize::from(MAX_LANES)])
    }

    fn step(&mut self, step: &Instruction) {
        let input_bits = self.asset.shape.input_bits;
        let (low, high) = signed_range(input_bits);
        match *step {
            Instruction::Concat { dst, lane, grid } => {
                let channels = self.asset.shape.grids[usize::from(grid)].channels;
                let latent = self.latent(grid);
                self.write(dst, lane, 4 * channels, latent);
            }
            Instruction::Lerp { dst, lane, grid } => {
                // Every filter rule stays within its corners.
                let channels = self.asset.shape.grids[usize::from(grid)].channels;
                let latent = self.latent(grid);
                self.write(dst, lane, channels, latent);
            }
            Instruction::Wave { dst, lane, octaves } | Instruction::Saw { dst, lane, octaves } => {
                let lanes = WAVES_PER_OCTAVE * octaves;
                self.write(dst, lane, lanes, widen((low, high)));
            }
            Instruction::Level { dst, lane } => self.write(dst, lane, 1, widen((0, high))),
            Instruction::Zero { dst, lane, lanes } => self.write(dst, lane, lanes, (0, 0)),
            Instruction::Dense {
                layer, src, inputs, ..
            } => self.dense(layer, src, inputs),
            Instruction::Relu { .. } => {
                for (low, high) in &mut self.sums {
                    (*low, *high) = ((*low).max(0), (*high).max(0));
                }
            }
            Instruction::Leaky { shift, .. } => {
                let rounding = self.asset.profile.leak;
                for sum in &mut self.sums {
                    *sum = at_ends(*sum, |value| leak(value, shift as u8, rounding));
                }
            }
            Instruction::Gate { layer, .. } => self.gate(layer),
            Instruction::Table { layer, .. } => self.table(layer),
            Instruction::Rescale { layer, dst, .. } => self.rescale(layer, dst, None),
            Instruction::RescaleSkip {
                layer, dst, skip, ..
            } => self.rescale(layer, dst, Some(skip)),
            Instruction::RoundHalf { dst, outputs } => {
                self.write(dst, 0, outputs, widen(signed_range(16)));
            }
            Instruction::QuantizeHalf {
                layer,
                dst,
                outputs,
            } => {
                let range = self.format_range(self.layer(layer).output_format());
                self.write(dst, 0, outputs, range);
            }
            // Neither integers nor sums of them.
            Instruction::Position { .. }
            | Instruction::Fetch { .. }
            | Instruction::DenseHalf { .. }
            | Instruction::ReluHalf { .. }
            | Instruction::LeakyHalf { .. }
            | Instruction::GateHalf { .. }
            | Instruction::SkipHalf { .. }
            | Instruction::Emit { .. }
            | Instruction::EmitHalf { .. }
            | Instruction::Collect { .. }
            | Instruction::CollectHalf { .. }
            | Instruction::Blend { .. }
            | Instruction::Footprint {}
            | Instruction::Repeat { .. }
            | Instruction::Again {}
            | Instruction::Each {}
            | Instruction::Next {}
            | Instruction::End {} => {}
        }
    }

    fn layer(&self, layer: u16) -> &'a Layer {
        &self.asset.layers[usize::from(layer)]
    }

    fn integer(&self, layer: u16) -> Option<(&'a Layer, &'a IntegerParameters)> {
        let layer = self.layer(layer);
        layer.integer().map(|parameters| (layer, parameters))
    }

    /// The inputs that the codes of a grid can become.
    fn latent(&self, grid: u16) -> Interval {
        let (format, bits) = (
            self.asset.shape.grids[usize::from(grid)].format,
            self.asset.shape.input_bits,
        );
        let of = |code| corner_input(format.value(code), format, bits, self.asset.profile.input);
        widen((of(0), of(format.max_code())))
    }

    fn format_range(&self, format: LaneFormat) -> Interval {
        match format {
            LaneFormat::Integer { bits, .. } => widen(signed_range(bits)),
            LaneFormat::Half => widen(signed_range(16)),
        }
    }

    fn write(&mut self, dst: u16, lane: u16, lanes: u16, interval: Interval) {
        let start = usize::from(lane);
        self.registers[usize::from(dst)][start..start + usize::from(lanes)].fill(interval);
    }

    /// The lanes of a register that is known to hold this format.
    fn read(&self, src: u16, lanes: u16, format: LaneFormat) -> Vec<Interval> {
        let (low, high) = self.format_range(format);
        let register = self.registers[usize::from(src)].iter();
        register
            .take(usize::from(lanes))
            .map(|lane| (lane.0.max(low), lane.1.min(high)))
            .collect()
    }

    fn dense(&mut self, layer: u16, src: u16, inputs: u16) {
        let Some((numbers, parameters)) = self.integer(layer) else {
            return;
        };
        let lanes = self.read(src, inputs, self.asset.input_format(usize::from(layer)));
        let accumulator = self.asset.profile.accumulator;
        let (smallest, largest) = widen(accumulator.range());
        let (mut low, mut high) = (0, 0);
        self.sums.clear();
        for row in 0..usize::from(numbers.outputs) {
            let bias = i64::from(parameters.bias[row]);
            let mut sum = (bias, bias);
            let mut all = sum;
            for (&weight, lane) in parameters.row(row, inputs).iter().zip(&lanes) {
                let products = [lane.0, lane.1].map(|end| end * i64::from(weight));
                sum.0 += products[0].min(products[1]);
                sum.1 += products[0].max(products[1]);
                all = (all.0.min(sum.0), all.1.max(sum.1));
            }
            let overflows = all.0 < smallest || all.1 > largest;
            self.sums
                .push(if overflows { (smallest, largest) } else { sum });
            (low, high) = (low.min(all.0), high.max(all.1));
        }
        self.held = Held::Sums;
        // n is held by bits whose largest number is at least n, or −n − 1 below zero.
        let magnitude = high.max(-1 - low) as u64;
        self.bounds.push(SumBound {
            layer,
            low,
            high,
            bits: (65 - magnitude.leading_zeros()) as u8,
            accumulator,
        });
    }

    fn gate(&mut self, layer: u16) {
        let Some((numbers, parameters)) = self.integer(layer) else {
            return;
        };
        let is_clamped = match numbers.activation {
            Activation::HardGelu { is_clamped, .. } => is_clamped,
            Activation::Identity
            | Activation::Relu
            | Activation::Leaky { .. }
            | Activation::Table => false,
        };
        let requantizer = self.asset.profile.requantize;
        for (sum, &scale) in self.sums.iter_mut().zip(&parameters.scales) {
            let argument = at_ends(*sum, |value| {
                gate_argument(value, scale, requantizer, is_clamped)
            });
            let ends = at_ends(argument, gate);
            // Falls to its smallest product at −192/256, then rises.
            let turns = argument.0 <= LOWEST_GATE && argument.1 >= LOWEST_GATE;
            let lowest = if turns {
                i64::from(gate(LOWEST_GATE as i32))
            } else {
                ends.0.min(ends.1)
            };
            *sum = (lowest, ends.0.max(ends.1));
        }
        self.held = Held::Gated;
    }

    fn table(&mut self, layer: u16) {
        let Some((_, parameters)) = self.integer(layer) else {
            return;
        };
        let requantizer = self.asset.profile.requantize;
        for (sum, &scale) in self.sums.iter_mut().zip(&parameters.scales) {
            let (first, last) =
                at_ends(*sum, |value| table_index(value, scale, requantizer) as i32);
            let entries = parameters.table.iter().map(|&entry| i64::from(entry));
            let reached = entries
                .skip(first as usize)
                .take((last - first + 1) as usize);
            *sum = reached.fold((i64::MAX, i64::MIN), |(low, high), entry| {
                (low.min(entry), high.max(entry))
            });
        }
        self.held = Held::LookedUp;
    }

    fn rescale(&mut self, layer: u16, dst: u16, skip: Option<u16>) {
        let Some((numbers, parameters)) = self.integer(layer) else {
            return;
        };
        let requantizer = self.asset.profile.requantize;
        let terms = skip.map(|skip| self.skip_terms(layer, skip));
        let (low, high) = widen(signed_range(parameters.output_bits));
        let rows = self.sums.iter().zip(&parameters.scales).enumerate();
        for (row, (&sum, &scale)) in rows {
            let value = match (self.held, numbers.activation) {
                (Held::LookedUp, _) => sum,
                (Held::Gated, Activation::HardGelu { scale, .. }) => {
                    at_ends(sum, |value| requantizer.apply(value, scale))
                }
                (Held::Sums | Held::Gated, _) => {
                    at_ends(sum, |value| requantizer.apply(value, scale))
                }
            };
            let zero_point = i64::from(parameters.zero_point);
            let term = terms.as_ref().map_or((0, 0), |terms| terms[row]);
            let end = |value: i64, term: i64| (value + zero_point + term).clamp(low, high);
            self.registers[usize::from(dst)][row] = (end(value.0, term.0), end(value.1, term.1));
        }
    }

    /// What a skip path adds to each row.
    fn skip_terms(&self, layer: u16, skip: u16) -> Vec<Interval> {
        let index = usize::from(layer);
        let outputs = self.asset.layers[index].outputs;
        let (Some(path), Some(from)) =
            (self.asset.layers[index].skip, self.asset.skip_source(index))
        else {
            return vec![(0, 0); usize::from(outputs)];
        };
        let format = self.asset.layers[from].output_format();
        let zero_point = match format {
            LaneFormat::Integer { zero_point, .. } => i32::from(zero_point),
            LaneFormat::Half => 0,
        };
        let profile = &self.asset.profile;
        let (low, high) = signed_range(profile.residual_bits);
        let lanes = self.read(skip, outputs, format).into_iter();
        lanes
            .map(|lane| {
                at_ends(lane, |value| {
                    let term = profile.skip.apply(value - zero_point, path.scale);
                    saturate(i64::from(term), low, high)
                })
            })
            .collect()
    }
}

/// Where the gate's product is smallest: the vertex of x·(2x + 768).
const LOWEST_GATE: i64 = -192;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::activation::GATE_RANGE;

    #[test]
    fn the_gate_falls_to_its_lowest_product_and_rises_behind_it() {
        for argument in GATE_RANGE.0..GATE_RANGE.1 {
            let step = gate(argument + 1) - gate(argument);
            if i64::from(argument) < LOWEST_GATE {
                assert!(step <= 0, "{argument}");
            } else {
                assert!(step >= 0, "{argument}");
            }
        }
    }

    #[test]
    fn the_bits_of_a_bound_are_the_narrowest() {
        for (low, high, bits) in [
            (0, 0, 1),
            (-1, 0, 1),
            (0, 1, 2),
            (-2, 1, 2),
            (-3, 0, 3),
            (-32_768, 32_767, 16),
            (0, 32_768, 17),
            (-32_769, 0, 17),
        ] {
            let magnitude = i64::max(high, -1 - low) as u64;
            assert_eq!(65 - magnitude.leading_zeros(), bits, "{low}..={high}");
        }
    }
}
