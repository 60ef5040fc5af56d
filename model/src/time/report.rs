//! Report: what a run says, as plain numbers.

use super::closed_form::{ClosedForm, Resource};
use super::cost::Cost;
use super::energy::Operations;
use super::ledger::{Cause, Ledger};
use super::stepped::Stepped;
use super::unit::Unit;
use super::watch::Watch;
use crate::demand::Demands;

/// Pixels of a texel block, 4×4: the unit of every figure per block.
pub const BLOCK_PIXELS: u64 = 16;

/// A run of one unit.
#[derive(Clone, Debug, PartialEq)]
pub struct Timing {
    /// Cycles from the first request to the last channel, the first weights included.
    pub cycles: u64,
    /// Pixels answered.
    pub pixels: u64,
    /// Texels that they asked for.
    pub texels: u64,
    /// Texels that another pixel of the quad asked for too.
    pub shared_texels: u64,
    /// Texels that the decoded-texel cache held.
    pub held_texels: u64,
    /// Texels that went through the synthesizer.
    pub decodes: u64,
    /// Texel blocks of answers: pixels / 16.
    pub blocks: f64,
    /// Cycles for each texel block: the inverse of the throughput.
    pub cycles_per_block: f64,
    /// Cycles between a job and the one before it, for 16 of its pixels: the median job. The first
    /// job's are its latency.
    pub block_cycles_p50: f64,
    /// The same for the job that 99 of 100 are not slower than.
    pub block_cycles_p99: f64,
    /// Bytes of latents from memory, lines rounded up to bursts.
    pub latent_bytes: u64,
    /// Bytes of parameters from outside: each filling of a material's, and what is streamed.
    pub weight_bytes: u64,
    /// Both, for each texel block.
    pub bytes_per_block: f64,
    /// Lines looked up, each once for a fetch of a group: `hits + merges + misses`.
    pub lookups: u64,
    /// Lookups of lines that were there.
    pub hits: u64,
    /// Lookups of lines that were on their way.
    pub merges: u64,
    /// Lookups of lines that had to be asked for.
    pub misses: u64,
    /// (hits + merges) / lookups: the lookups that asked for nothing.
    pub hit_rate: f64,
    /// Misses that the second level held.
    pub level2_hits: u64,
    /// Lines asked of memory.
    pub fetched_lines: u64,
    /// Different lines among all lookups.
    pub distinct_lines: u64,
    /// Times that a material's parameters came in.
    pub weight_fills: u64,
    /// Jobs of the array.
    pub jobs: u64,
    /// Multiplications.
    pub macs: u64,
    /// Cycles of a multiplier that the products took / (cycles × multipliers): a product of halves
    /// takes as many as it takes passes.
    pub mac_utilisation: f64,
    /// What limits the unit if nothing is waited for: the resource of the largest bound.
    pub bottleneck: Resource,
    /// What it waits for most. `None` if the array multiplies in every cycle.
    pub largest_stall: Option<Cause>,
    /// Every cycle, by cause.
    pub ledger: Ledger,
    /// The lower bounds.
    pub closed_form: ClosedForm,
    /// Pixels per cycle.
    pub pixels_per_cycle: f64,
    /// Million pixels per second at the unit's clock.
    pub megapixels_per_second: f64,
    /// 10^9 bytes per second from outside, latents and parameters, at the unit's clock.
    pub gigabytes_per_second: f64,
    /// What was done, for an energy table.
    pub operations: Operations,
    /// What was measured behind the pixels that were to warm up.
    pub measured: Measured,
}

/// A run without its first pixels: from when the last of them left to when the very last did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Measured {
    /// Cycles.
    pub cycles: u64,
    /// Pixels that left in them.
    pub pixels: u64,
    /// The cycles by cause, up to the end of the run.
    pub ledger: Ledger,
}

/// The quotient, 0 where there is nothing to divide by.
fn ratio(numerator: f64, denominator: f64) -> f64 {
    if denominator == 0.0 {
        0.0
    } else {
        numerator / denominator
    }
}

impl Timing {
    pub(super) fn new<D: Demands, W: Watch>(
        unit: &Unit,
        costs: &[Cost],
        run: &Stepped<D, W>,
    ) -> Timing {
        let cycles = run.ledger.cycles();
        let (meter, assembled) = (&run.meter, run.assembler.assembled);
        let (memory, outcomes) = (&run.front.lookup.memory, run.front.lookup.outcomes);
        let line_bytes = u64::from(unit.line_bytes);
        let mut operations = meter.operations;
        operations.l1_fill_bytes = (memory.fetched + memory.level2_hits) * line_bytes;
        if unit.level2_sets > 0 {
            operations.l2_read_bytes = (memory.fetched + memory.level2_hits) * line_bytes;
            operations.l2_fill_bytes = memory.fetched * line_bytes;
        }
        operations.memory_bytes = memory.bytes;
        let weight_bytes = run.jobs.fill_bytes + meter.streamed_bytes;
        operations.weight_fill_bytes = weight_bytes;
        if unit.decoded_cache_blocks > 0 {
            let channels = costs
                .first()
                .map_or(0, |cost| u64::from(cost.work.channels));
            operations.decoded_cache_read_bytes = assembled.held * channels;
            operations.decoded_cache_fill_bytes = assembled.decodes * channels;
        }
        let blocks = assembled.pixels as f64 / BLOCK_PIXELS as f64;
        let bytes = (memory.bytes + weight_bytes) as f64;
        let lookups = outcomes.hits + outcomes.merges + outcomes.misses;
        let available = cycles as f64 * unit.macs_per_cycle() as f64;
        let clock = f64::from(unit.clock_mhz);
        let pixels = assembled.pixels as f64;
        let closed_form = run.sums.bound();
        let macs = operations.macs_bytes
            + operations.macs_narrow
            + operations.macs_wide
            + operations.macs_half;
        let measured = meter.mark.map_or(Measured::default(), |mark| Measured {
            cycles: meter.last - mark.cycle,
            pixels: meter.pixels - mark.pixels,
            ledger: run.ledger.since(&mark.ledger),
        });
        Timing {
            cycles,
            pixels: assembled.pixels,
            texels: assembled.texels,
            shared_texels: assembled.shared,
            held_texels: assembled.held,
            decodes: assembled.decodes,
            blocks,
            cycles_per_block: ratio(cycles as f64, blocks),
            block_cycles_p50: meter.percentile(50),
            block_cycles_p99: meter.percentile(99),
            latent_bytes: memory.bytes,
            weight_bytes,
            bytes_per_block: ratio(bytes, blocks),
            lookups,
            hits: outcomes.hits,
            merges: outcomes.merges,
            misses: outcomes.misses,
            hit_rate: ratio((outcomes.hits + outcomes.merges) as f64, lookups as f64),
            level2_hits: memory.level2_hits,
            fetched_lines: memory.fetched,
            distinct_lines: run.sums.distinct_lines(),
            weight_fills: run.jobs.fills,
            jobs: meter.jobs,
            macs,
            mac_utilisation: ratio(meter.multiplier_cycles as f64, available),
            bottleneck: closed_form.bottleneck,
            largest_stall: run.ledger.largest_stall(),
            ledger: run.ledger,
            closed_form,
            pixels_per_cycle: ratio(pixels, cycles as f64),
            megapixels_per_second: ratio(pixels * clock, cycles as f64),
            gigabytes_per_second: ratio(bytes * clock / 1000.0, cycles as f64),
            operations,
            measured,
        }
    }
}
