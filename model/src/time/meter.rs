//! Meter: what a run did, counted as it goes by.

use super::assemble::{Group, Job};
use super::cost::Cost;
use super::energy::Operations;
use super::ledger::Ledger;
use super::unit::Unit;
use super::work::Operands;
use std::collections::BTreeMap;

/// The moment from which a run is measured.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mark {
    /// When the last pixel before it left.
    pub(super) cycle: u64,
    /// Pixels that had left.
    pub(super) pixels: u64,
    /// The cycles up to there.
    pub(super) ledger: Ledger,
}

/// The counts of a run.
#[derive(Debug)]
pub(super) struct Meter<'a> {
    unit: &'a Unit,
    costs: &'a [Cost<'a>],
    pub(super) operations: Operations,
    /// Cycles of one multiplier that the products took.
    pub(super) multiplier_cycles: u64,
    /// Bytes of parameters streamed for batches.
    pub(super) streamed_bytes: u64,
    pub(super) jobs: u64,
    /// Pixels that have left.
    pub(super) pixels: u64,
    /// When the last of them left.
    pub(super) last: u64,
    /// Jobs by their cycles per texel block, as bits of an f64; those of positive numbers are in
    /// their order.
    pub(super) intervals: BTreeMap<u64, u64>,
    /// Pixels in front of what is measured.
    pub(super) measured_from: u64,
    pub(super) mark: Option<Mark>,
}

impl<'a> Meter<'a> {
    pub(super) fn new(unit: &'a Unit, costs: &'a [Cost<'a>]) -> Meter<'a> {
        Meter {
            unit,
            costs,
            operations: Operations::default(),
            multiplier_cycles: 0,
            streamed_bytes: 0,
            jobs: 0,
            pixels: 0,
            last: 0,
            intervals: BTreeMap::new(),
            measured_from: 0,
            mark: None,
        }
    }

    /// A group has passed the tags.
    pub(super) fn passed(&mut self, group: &Group) {
        let work = self.costs[usize::from(group.material)].work;
        let decodes = |each: u32| group.decodes * u64::from(each);
        let operations = &mut self.operations;
        operations.address_steps += decodes(work.address_steps);
        operations.tag_lookups += group.lines.len() as u64;
        operations.l1_read_bytes += group.corner_bytes;
        operations.unpacked_latents += decodes(work.unpacked);
        operations.interpolations += decodes(work.interpolated);
        operations.embedded += decodes(work.embedded);
    }

    /// The array has taken a job.
    pub(super) fn started(&mut self, job: &Job) {
        let cost = &self.costs[usize::from(job.material)];
        let batches = job.decodes.div_ceil(u64::from(self.unit.batch_texels));
        let operations = &mut self.operations;
        for layer in &cost.layers {
            let macs = layer.macs() * job.decodes;
            let (count, cycles) = match layer.operands {
                Operands::Narrow => {
                    let columns = u64::from(self.unit.narrow_columns);
                    (&mut operations.macs_narrow, macs.div_ceil(columns))
                }
                Operands::Bytes => (&mut operations.macs_bytes, macs),
                Operands::Wide => {
                    let passes = u64::from(self.unit.wide_passes);
                    (&mut operations.macs_wide, macs * passes)
                }
                Operands::Half => {
                    let passes = u64::from(self.unit.half_passes);
                    (&mut operations.macs_half, macs * passes)
                }
            };
            *count += macs;
            self.multiplier_cycles += cycles;
            let outputs = layer.outputs_from(0);
            operations.requantised += layer.slots(outputs) * job.decodes;
            operations.skip_adds += layer.skips(outputs) * job.decodes;
            operations.activation_bytes += layer.activation_bytes() * job.decodes;
            operations.weight_sram_read_bytes += layer.weight_bytes_per_batch() * batches;
        }
        let channels = u64::from(cost.work.channels);
        operations.filtered_codes += job.weighted * channels;
        operations.output_bytes += job.pixels * channels;
        self.streamed_bytes += batches * cost.streamed_bytes;
        self.jobs += 1;
    }

    /// A job's last channel has left.
    pub(super) fn left(&mut self, now: u64, job: &Job, ledger: &Ledger) {
        if job.pixels == 0 {
            return;
        }
        // Cycles since the pixels before it, for 16 of its pixels; the first job's are its latency.
        let cycles = (now - self.last) as f64 * 16.0 / job.pixels as f64;
        *self.intervals.entry(cycles.to_bits()).or_insert(0) += 1;
        self.last = now;
        self.pixels += job.pixels;
        if self.mark.is_none() && self.pixels >= self.measured_from {
            self.mark = Some(Mark {
                cycle: now,
                pixels: self.pixels,
                ledger: *ledger,
            });
        }
    }

    /// The cycles per texel block that `percent` of 100 jobs do not exceed.
    pub(super) fn percentile(&self, percent: u64) -> f64 {
        let jobs: u64 = self.intervals.values().sum();
        let rank = (jobs * percent).div_ceil(100).max(1);
        let mut seen = 0;
        for (&bits, &count) in &self.intervals {
            seen += count;
            if seen >= rank {
                return f64::from_bits(bits);
            }
        }
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_values_that_occurred() {
        let unit = Unit::mobile();
        let mut meter = Meter::new(&unit, &[]);
        assert_eq!(meter.percentile(50), 0.0);
        for value in 1..=200_u32 {
            meter.intervals.insert(f64::from(value).to_bits(), 1);
        }
        assert_eq!(meter.percentile(50), 100.0);
        assert_eq!(meter.percentile(99), 198.0);
    }
}
