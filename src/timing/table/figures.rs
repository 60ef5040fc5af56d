//! Figures: what one run costs for each texel block, between its bounds and brackets.

use super::Ratios;
use ntmu_model::Material;
use ntmu_model::stream::Stream;
use ntmu_model::time::energy::EnergyTable;
use ntmu_model::time::{self, Timing, Unit};
use serde::Serialize;

/// What a subject costs on a unit in a scene. A block is 16 pixels' answers, and where each pixel asks
/// for one texel, a 4×4 texel block.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Figures {
    /// Pixels answered.
    pub pixels: u64,
    /// Texels that went through the synthesizer, or were decoded without one.
    pub decodes: u64,
    /// Cycles of the whole run, cold caches and the first weights included.
    pub cycles: u64,
    /// Cycles per block: the inverse of the throughput.
    pub cycles_per_block: f64,
    /// Cycles between a job and the one before it, for 16 pixels; the median job.
    pub block_cycles_p50: f64,
    /// The same for the job that 99 of 100 are not slower than.
    pub block_cycles_p99: f64,
    /// 10^9 pixels answered per second at the unit's clock: texels, where each pixel asks for one.
    pub gigatexels_per_second: f64,
    /// Bytes of latents (or blocks) and parameters from outside, per block.
    pub bytes_per_block: f64,
    /// The parameters among them.
    pub weight_bytes_per_block: f64,
    /// Multiplier cycles used over those that there were, 0 to 1.
    pub mac_utilisation: f64,
    /// The resource with the largest lower bound.
    pub binds: String,
    /// What most cycles in which the array does not multiply were spent on; empty if there are none.
    pub largest_stall: String,
    /// Those cycles over all, 0 to 1.
    pub largest_stall_share: f64,
    /// The closed form's lower bound, per block.
    pub closed_form_per_block: f64,
    /// Cycles per block behind an ideal memory.
    pub ideal_memory_per_block: f64,
    /// Cycles per block with a latent cache that keeps all.
    pub infinite_cache_per_block: f64,
    /// Cycles per block without a latent cache.
    pub no_cache_per_block: f64,
    /// Picojoules of the table per block: a proxy that ranks, no power.
    pub picojoules_per_block: f64,
}

/// The quotient, 0 where there is nothing to divide by.
fn ratio(numerator: f64, denominator: f64) -> f64 {
    if denominator == 0.0 {
        0.0
    } else {
        numerator / denominator
    }
}

fn timed(unit: &Unit, materials: &[Material], stream: &Stream) -> Timing {
    let run = time::simulate(unit, materials, &mut stream.demands(), &mut ());
    run.unwrap_or_else(|never| match never {})
}

impl Figures {
    pub(super) fn of(
        unit: &Unit,
        materials: &[Material],
        stream: &Stream,
        energy: &EnergyTable,
    ) -> Figures {
        let timing = timed(unit, materials, stream);
        let per_block = |unit: &Unit| timed(unit, materials, stream).cycles_per_block;
        let stall = timing.largest_stall;
        let stalled = stall.map_or(0, |cause| timing.ledger.of(cause));
        let picojoules = energy.of(&timing.operations, unit).picojoules;
        Figures {
            pixels: timing.pixels,
            decodes: timing.decodes,
            cycles: timing.cycles,
            cycles_per_block: timing.cycles_per_block,
            block_cycles_p50: timing.block_cycles_p50,
            block_cycles_p99: timing.block_cycles_p99,
            gigatexels_per_second: timing.megapixels_per_second / 1000.0,
            bytes_per_block: timing.bytes_per_block,
            weight_bytes_per_block: ratio(timing.weight_bytes as f64, timing.blocks),
            mac_utilisation: timing.mac_utilisation,
            binds: timing.bottleneck.name().to_owned(),
            largest_stall: stall.map_or("", |cause| cause.name()).to_owned(),
            largest_stall_share: ratio(stalled as f64, timing.cycles as f64),
            closed_form_per_block: ratio(timing.closed_form.cycles as f64, timing.blocks),
            ideal_memory_per_block: per_block(&unit.with_ideal_memory()),
            infinite_cache_per_block: per_block(&unit.with_infinite_cache()),
            no_cache_per_block: per_block(&unit.without_cache()),
            picojoules_per_block: ratio(picojoules, timing.blocks),
        }
    }

    pub(super) fn over(&self, control: &Figures) -> Ratios {
        Ratios {
            cycles: ratio(self.cycles_per_block, control.cycles_per_block),
            bytes: ratio(self.bytes_per_block, control.bytes_per_block),
            picojoules: ratio(self.picojoules_per_block, control.picojoules_per_block),
        }
    }
}
