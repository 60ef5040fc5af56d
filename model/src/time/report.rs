//! Report: what a run says, as plain numbers.

use super::closed_form::{ClosedForm, Resource};
use super::ledger::{Cause, Ledger};
use super::unit::Unit;

/// Texels of a texel block, 4×4: the unit of every figure per block.
pub const BLOCK_TEXELS: u64 = 16;

/// A run of one unit.
#[derive(Clone, Debug, PartialEq)]
pub struct Timing {
    /// Cycles from the first request to the last channel, weight fill included.
    pub cycles: u64,
    /// Texels decoded.
    pub texels: u64,
    /// Texel blocks: texels / 16.
    pub blocks: f64,
    /// Cycles for each texel block: the inverse of the throughput.
    pub cycles_per_block: f64,
    /// Cycles between a job and the one before it, for each of its texel blocks: the median job.
    /// The first job's are its latency.
    pub block_cycles_p50: f64,
    /// The same for the job that 99 of 100 are not slower than.
    pub block_cycles_p99: f64,
    /// Bytes of latents from memory: misses × line, rounded up to bursts.
    pub latent_bytes: u64,
    /// Bytes of parameters from outside: what stays once, what does not for each batch.
    pub weight_bytes: u64,
    /// Both, for each texel block.
    pub bytes_per_block: f64,
    /// Lines looked up, each once for a fetch of a coalesced group: `hits + merges + misses`.
    pub lookups: u64,
    /// Lookups of lines that were there.
    pub hits: u64,
    /// Lookups of lines that were on their way.
    pub merges: u64,
    /// Lookups of lines that were asked of memory.
    pub misses: u64,
    /// (hits + merges) / lookups: the lookups that asked nothing of memory.
    pub hit_rate: f64,
    /// Multiplications.
    pub macs: u64,
    /// Multiplications / (cycles × multiplications of bytes per cycle): an array that always
    /// multiplies halves in two passes has ½.
    pub mac_utilisation: f64,
    /// What limits the unit if nothing is waited for: the resource of the largest bound.
    pub bottleneck: Resource,
    /// What it waits for most. `None` if the array multiplies in every cycle.
    pub largest_stall: Option<Cause>,
    /// Every cycle, by cause.
    pub ledger: Ledger,
    /// The lower bound, and its resource.
    pub closed_form: ClosedForm,
    /// Million texels per second at the unit's clock.
    pub megatexels_per_second: f64,
    /// 10^9 bytes per second from outside, latents and parameters, at the unit's clock.
    pub gigabytes_per_second: f64,
}

/// What a run counted.
pub(super) struct Counts {
    pub(super) ledger: Ledger,
    pub(super) closed_form: ClosedForm,
    pub(super) texels: u64,
    pub(super) macs_per_texel: u64,
    pub(super) latent_bytes: u64,
    pub(super) weight_bytes: u64,
    pub(super) hits: u64,
    pub(super) merges: u64,
    pub(super) misses: u64,
    /// When each job's last channel left.
    pub(super) left: Vec<u64>,
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
    pub(super) fn new(unit: &Unit, counts: Counts) -> Timing {
        let cycles = counts.ledger.cycles();
        let blocks = counts.texels as f64 / BLOCK_TEXELS as f64;
        let bytes = (counts.latent_bytes + counts.weight_bytes) as f64;
        let lookups = counts.hits + counts.merges + counts.misses;
        let macs = counts.texels * counts.macs_per_texel;
        let available = cycles as f64 * unit.macs_per_cycle() as f64;
        let clock = f64::from(unit.clock_mhz);
        let intervals = intervals(&counts.left, counts.texels, u64::from(unit.job_texels()));
        Timing {
            cycles,
            texels: counts.texels,
            blocks,
            cycles_per_block: ratio(cycles as f64, blocks),
            block_cycles_p50: percentile(&intervals, 50),
            block_cycles_p99: percentile(&intervals, 99),
            latent_bytes: counts.latent_bytes,
            weight_bytes: counts.weight_bytes,
            bytes_per_block: ratio(bytes, blocks),
            lookups,
            hits: counts.hits,
            merges: counts.merges,
            misses: counts.misses,
            hit_rate: ratio((counts.hits + counts.merges) as f64, lookups as f64),
            macs,
            mac_utilisation: ratio(macs as f64, available),
            bottleneck: counts.closed_form.bottleneck,
            largest_stall: counts.ledger.largest_stall(),
            ledger: counts.ledger,
            closed_form: counts.closed_form,
            megatexels_per_second: ratio(counts.texels as f64 * clock, cycles as f64),
            gigabytes_per_second: ratio(bytes * clock / 1000.0, cycles as f64),
        }
    }
}

/// Cycles per texel block of each job, in ascending order.
fn intervals(left: &[u64], texels: u64, job_texels: u64) -> Vec<f64> {
    let mut before = 0;
    let mut intervals: Vec<f64> = (0_u64..)
        .zip(left)
        .map(|(job, &at)| {
            let size = job_texels.min(texels - job * job_texels);
            let interval = at - std::mem::replace(&mut before, at);
            (interval * BLOCK_TEXELS) as f64 / size as f64
        })
        .collect();
    intervals.sort_by(f64::total_cmp);
    intervals
}

/// The smallest value that at least `percent` of 100 values do not exceed.
fn percentile(sorted: &[f64], percent: usize) -> f64 {
    let rank = (sorted.len() * percent).div_ceil(100);
    sorted.get(rank.saturating_sub(1)).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_values_that_occurred() {
        let values: Vec<f64> = (1..=200).map(f64::from).collect();
        assert_eq!(percentile(&values, 50), 100.0);
        assert_eq!(percentile(&values, 99), 198.0);
        assert_eq!(percentile(&values[..1], 99), 1.0);
        assert_eq!(percentile(&[], 50), 0.0);
    }

    #[test]
    fn intervals_count_blocks_of_a_short_last_job() {
        // 40 texels in jobs of 32: 64 cycles for two blocks, then 8 cycles for half a block.
        assert_eq!(intervals(&[64, 72], 40, 32), [16.0, 32.0]);
    }
}
