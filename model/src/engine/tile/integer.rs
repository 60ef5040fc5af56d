//! One integer layer of a tile.

use super::TileScratch;
use crate::engine::Engine;
use crate::engine::general;
use crate::engine::kernel::{Integers, Sums, TILE};
use crate::engine::plan::{IntegerLayer, IntegerSums, Then};
use crate::engine::register::{Held, Register};
use ntmu_isa::accumulate::wrap;
use ntmu_isa::layer::IntegerParameters;
use ntmu_isa::shape::LaneFormat;

impl Engine<'_> {
    /// From the register `input`, and the register `source` where a skip path ends, to `written`, or
    /// to the codes.
    pub(super) fn integer(
        &self,
        index: usize,
        layer: &IntegerLayer,
        scratch: &mut TileScratch,
        input: usize,
        source: Option<usize>,
        written: &mut Register,
    ) {
        let Some(parameters) = self.asset.layers[index].integer() else {
            return;
        };
        let TileScratch {
            registers,
            sums,
            words,
            ..
        } = scratch;
        let rows = &mut sums[..layer.ranges.len()];
        let read = &registers[input];
        let kernels = self.kernels;
        if let Then::Fused(finish) = &layer.then {
            match (&layer.sums, layer.output) {
                (IntegerSums::Bytes(dense), Some(_)) => {
                    let source = source.map(|source| registers[source].quads.as_slice());
                    return kernels.dense8(dense, finish, &read.quads, source, &mut written.quads);
                }
                (IntegerSums::Bytes(dense), None) => {
                    return kernels.emit8(dense, finish, &read.quads, rows);
                }
                (IntegerSums::Words(dense), _) => {
                    return kernels.dense16(dense, finish, &read.pairs, &mut written.pairs);
                }
            }
        }
        let inputs = match &layer.sums {
            IntegerSums::Bytes(dense) => {
                kernels.raw8(dense, &read.quads, rows);
                Integers::Quads(&read.quads)
            }
            IntegerSums::Words(dense) => {
                kernels.raw16(dense, &read.pairs, rows);
                Integers::Pairs(&read.pairs)
            }
        };
        let source = self.skip_values(index, source, registers);
        match &layer.then {
            Then::Fused(finish) | Then::Rows(finish, None) => kernels.finish_rows(finish, rows),
            Then::Rows(finish, Some(skip)) => {
                kernels.finish_rows(finish, rows);
                if let Some(source) = source {
                    kernels.add_rows(*skip, source, rows);
                }
            }
            Then::General => {
                self.ordered(layer, parameters, inputs, words, rows);
                self.general(index, layer, parameters, source, rows);
            }
        }
        self.store(layer, rows, written);
    }

    /// The values that a layer's skip path adds.
    fn skip_values<'r>(
        &self,
        index: usize,
        source: Option<usize>,
        registers: &'r [Register],
    ) -> Option<Integers<'r>> {
        let format: LaneFormat = self.asset.layers[self.asset.skip_source(index)?].output_format();
        source.map(|source| registers[source].integers(Held::of(format)))
    }

    /// The sums that depend on the order, in the order of the specification.
    fn ordered(
        &self,
        layer: &IntegerLayer,
        parameters: &IntegerParameters,
        inputs: Integers<'_>,
        words: &mut [i16],
        rows: &mut [Sums],
    ) {
        if layer.ordered.is_empty() {
            return;
        }
        let count = parameters.weights.len() / parameters.bias.len();
        let words = &mut words[..count];
        for texel in 0..TILE {
            for (lane, word) in words.iter_mut().enumerate() {
                *word = inputs.value(lane, texel) as i16;
            }
            for &row in &layer.ordered {
                let weights = parameters.row(row, count as u16);
                let accumulator = self.asset.profile.accumulator;
                rows[row].0[texel] = accumulator.dot(parameters.bias[row], weights, words);
            }
        }
    }

    /// Sums of any width become results or codes. A row that is not ordered has been summed modulo
    /// 2^32, of which a narrower accumulator keeps the low bits; those that cannot overflow stay what
    /// they are.
    fn general(
        &self,
        index: usize,
        layer: &IntegerLayer,
        parameters: &IntegerParameters,
        source: Option<Integers<'_>>,
        rows: &mut [Sums],
    ) {
        let profile = &self.asset.profile;
        for (row, sums) in rows.iter_mut().enumerate() {
            for (texel, sum) in sums.0.iter_mut().enumerate() {
                let accumulator = wrap(i64::from(*sum), profile.accumulator.bits);
                *sum = match layer.output {
                    None => {
                        let format = self.asset.shape.outputs[row];
                        general::output(profile, parameters, format, row, accumulator)
                    }
                    Some(_) => {
                        let from = source.map_or(0, |source| source.value(row, texel));
                        general::hidden(self.asset, index, parameters, row, accumulator, from)
                    }
                };
            }
        }
    }

    /// Results into their register, or limited to the ranges of the codes.
    fn store(&self, layer: &IntegerLayer, rows: &mut [Sums], written: &mut Register) {
        match layer.output {
            None => {
                for (row, &(low, high)) in rows.iter_mut().zip(&layer.ranges) {
                    row.0
                        .iter_mut()
                        .for_each(|code| *code = (*code).clamp(low, high));
                }
            }
            Some(held) => written.store(self.kernels, held, rows, layer.ranges[0]),
        }
    }
}
