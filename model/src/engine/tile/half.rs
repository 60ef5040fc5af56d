//! One fp16 layer of a tile.

use super::TileScratch;
use crate::engine::Engine;
use crate::engine::general;
use crate::engine::kernel::{Halves, Sums, TILE};
use crate::engine::plan::{HalfLayer, HalfResult};
use crate::engine::register::Register;
use ntmu_isa::accumulate::signed_range;
use ntmu_isa::half::Half;

impl Engine<'_> {
    /// From the register `input`, and the register `source` where a skip path ends, to `written`, or
    /// to the codes.
    pub(super) fn half(
        &self,
        index: usize,
        layer: &HalfLayer,
        scratch: &mut TileScratch,
        input: usize,
        source: Option<usize>,
        written: &mut Register,
    ) {
        let (kernels, rounding) = (self.kernels, self.asset.profile.convert);
        let TileScratch {
            registers,
            sums,
            half_sums,
            halves,
            ..
        } = scratch;
        if let Some((held, zero, factor)) = layer.read {
            let mut read = std::mem::take(&mut registers[input].halves);
            let integers = registers[input].integers(held);
            kernels.half_inputs(integers, zero, factor, &mut read[..layer.inputs]);
            registers[input].halves = read;
        }
        let read = &registers[input].halves[..layer.inputs];
        let is_rounded = match layer.result {
            HalfResult::Halves => true,
            HalfResult::Integers(..) | HalfResult::Codes(_) => false,
        };
        let rows = if is_rounded {
            &mut written.halves[..layer.rows]
        } else {
            &mut half_sums[..layer.rows]
        };
        match &layer.dense {
            Some(dense) => kernels.half_sums(dense, read, rows),
            None => self.fused_sums(index, read, halves, rows),
        }
        let source = source.map(|source| registers[source].halves.as_slice());
        kernels.half_finish(layer.step, source, is_rounded, rows);
        match &layer.result {
            HalfResult::Halves => {}
            HalfResult::Integers(held, quantize, rule) => {
                let results = &mut sums[..layer.rows];
                for (sums, results) in rows.iter().zip(results.iter_mut()) {
                    match rule {
                        Some(rule) => kernels.half_integers(*rule, sums, results),
                        None => each(sums, results, |sum| {
                            general::quantize(*quantize, rounding, sum)
                        }),
                    }
                }
                written.store(kernels, *held, results, signed_range(quantize.bits));
            }
            HalfResult::Codes(rules) => {
                let formats = &self.asset.shape.outputs;
                let channels = rules.iter().zip(formats).zip(rows.iter().zip(sums));
                for ((rule, &format), (sums, codes)) in channels {
                    match rule {
                        Some(rule) => kernels.half_integers(*rule, sums, codes),
                        None => each(sums, codes, |sum| {
                            general::half_output(format, rounding, sum)
                        }),
                    }
                }
            }
        }
    }

    /// Sums that round to fp16 after every product, by the specification.
    fn fused_sums(&self, index: usize, read: &[Halves], halves: &mut [Half], rows: &mut [Halves]) {
        let halves = &mut halves[..read.len()];
        for texel in 0..TILE {
            for (half, lane) in halves.iter_mut().zip(read) {
                // A register holds fp16 values, so nothing is lost.
                *half = Half::round(lane.0[texel]);
            }
            for (row, sums) in rows.iter_mut().enumerate() {
                sums.0[texel] = general::fused_row(&self.asset.layers[index], row, halves);
            }
        }
    }
}

fn each(sums: &Halves, results: &mut Sums, of: impl Fn(f32) -> i32) {
    for (result, &sum) in results.0.iter_mut().zip(&sums.0) {
        *result = of(sum);
    }
}
