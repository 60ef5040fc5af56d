//! Summary: what a run says, per pixel, texel and texel block, with the unit in every name.
//!
//! A *block* is 16 pixels of answers. A *texel* is a texel, or a place between texels, that a pixel
//! asked for, also where another pixel of the quad asked for it too; a *decode* is one that went
//! through the synthesizer.

use super::counts::Counts;
use crate::model::time::choice::CacheKind;
use crate::model::time::energy::{EnergyTable, Operation};
use crate::model::time::report::BLOCK_PIXELS;
use crate::model::time::{ClosedForm, Resource, Timing, Unit};
use serde::Serialize;

/// A run, or the part of one that was looked at.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// The unit that ran.
    pub unit: String,
    /// Plain counts.
    pub totals: Totals,
    /// What comes out in time.
    pub throughput: Throughput,
    /// Cycles from the end of a job to the end of the next, for 16 pixels of it. `None` for an
    /// estimate.
    pub block_percentiles: Option<Percentiles>,
    /// Bytes by where they come from.
    pub traffic: Vec<Traffic>,
    /// What was found where.
    pub hit_rates: HitRates,
    /// Every cycle by cause, in the order of the texel's journey backwards.
    pub ledger: Vec<LedgerRow>,
    /// The cause with most cycles in which the array does not multiply.
    pub largest_stall: Option<&'static str>,
    /// The lower bounds.
    pub closed_form: Bounds,
}

/// Plain counts.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Totals {
    /// Cycles.
    pub cycles: u64,
    /// Pixels that left in those cycles. For a part of a run, at whose ends jobs are cut, it differs
    /// from `pixels` by less than a job at each.
    pub timed_pixels: u64,
    /// Pixels that asked.
    pub pixels: u64,
    /// Texels that they asked for.
    pub texels: u64,
    /// Of those, asked for by another pixel of the quad too.
    pub shared_texels: u64,
    /// Of those, held by the decoded-texel cache.
    pub held_texels: u64,
    /// Texels that were decoded.
    pub decodes: u64,
    /// Multiplications.
    pub macs: u64,
    /// Jobs of the array.
    pub jobs: u64,
    /// Lines looked up in the latent cache: `hits + merges + misses`.
    pub lookups: u64,
    /// Lookups of lines that were there.
    pub hits: u64,
    /// Lookups of lines that were on their way.
    pub merges: u64,
    /// Lookups of lines that had to be asked for.
    pub misses: u64,
    /// Misses that the second level held.
    pub level2_hits: u64,
    /// Lines asked of memory.
    pub fetched_lines: u64,
    /// Different lines among all lookups. `None` for an estimate: parts share lines.
    pub distinct_lines: Option<u64>,
    /// Times that a material's parameters came in.
    pub weight_fills: u64,
}

/// What comes out in time.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Throughput {
    /// Cycles per block: the mean.
    pub cycles_per_block: f64,
    /// Pixels per cycle.
    pub pixels_per_cycle: f64,
    /// Decodes per cycle.
    pub decodes_per_cycle: f64,
    /// The unit's clock, in MHz.
    pub clock_mhz: u32,
    /// 10^9 pixels per second at that clock.
    pub gigapixels_per_second: f64,
    /// 10^9 texels per second: those asked for, as fill rates of filtering units are counted.
    pub gigatexels_per_second: f64,
    /// 10^9 bytes per second from outside, latents and parameters.
    pub gigabytes_per_second: f64,
    /// Cycles of multipliers that products took, of all that there were, 0 to 1.
    pub mac_utilisation: f64,
}

/// Cycles per block of jobs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Percentiles {
    /// Of the median job.
    pub p50_cycles: f64,
    /// Of the job that 99 of 100 are not slower than.
    pub p99_cycles: f64,
}

/// Bytes from one level.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Traffic {
    /// Where they come from.
    pub level: &'static str,
    /// All of them.
    pub bytes: u64,
    /// For each pixel.
    pub bytes_per_pixel: f64,
    /// For each texel asked for.
    pub bytes_per_texel: f64,
    /// For each block.
    pub bytes_per_block: f64,
}

/// What was found where, 0 to 1; `None` where the unit has no such cache.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct HitRates {
    /// Lookups of the latent cache that asked for nothing: hits and merges.
    pub latent_cache: Option<f64>,
    /// Misses of the latent cache that the second level held.
    pub second_level: Option<f64>,
    /// Texels that the decoded-texel cache held, of those that no other pixel of the quad asked for.
    pub decoded_cache: Option<f64>,
}

/// A cause.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct LedgerRow {
    /// Its name.
    pub cause: &'static str,
    /// Its cycles.
    pub cycles: u64,
    /// Its share in hundredths of a percent. All of them add up to 10,000.
    pub hundredths_of_percent: u32,
    /// What it means.
    pub meaning: &'static str,
}

/// The lower bounds of a run's cycles.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Bounds {
    /// The closed form. For an estimate the largest work of a resource, as parts have no beginning.
    pub cycles: u64,
    /// The same for each block.
    pub cycles_per_block: f64,
    /// The cycles that the unit took, over this.
    pub measured_over_bound: f64,
    /// The longest path through all groups and jobs. `None` for an estimate.
    pub critical_path_cycles: Option<u64>,
    /// The resource whose bound is the largest.
    pub binds: &'static str,
    /// Every resource, in the order of the texel's journey.
    pub resources: Vec<BoundRow>,
}

/// A resource's bound.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct BoundRow {
    /// Its name.
    pub resource: &'static str,
    /// Cycles in which it works.
    pub work_cycles: u64,
    /// Those and the cycles before the first thing can reach it. `None` for an estimate.
    pub bound_cycles: Option<u64>,
    /// Its work for each block.
    pub work_cycles_per_block: f64,
}

/// Operations at the prices of a table, in picojoules of that table; no estimate of power.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EnergyRows {
    /// The table's identity.
    pub table: String,
    /// All operations for each block.
    pub picojoules_per_block: f64,
    /// Every kind of operation, in the order of the texel's journey.
    pub operations: Vec<EnergyRow>,
}

/// One kind of operation.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EnergyRow {
    /// Its name.
    pub operation: &'static str,
    /// How many.
    pub count: u64,
    /// Picojoules of the table for each block.
    pub picojoules_per_block: f64,
    /// Its share of the sum, 0 to 1.
    pub share: f64,
}

fn over(numerator: f64, denominator: f64) -> f64 {
    if denominator == 0.0 {
        0.0
    } else {
        numerator / denominator
    }
}

fn blocks(pixels: u64) -> f64 {
    pixels as f64 / BLOCK_PIXELS as f64
}

impl Summary {
    /// A whole run.
    #[must_use]
    pub fn of(timing: &Timing, unit: &Unit) -> Summary {
        let counts = Counts::of(timing, unit);
        let mut summary = Summary::of_parts(&counts, unit);
        summary.totals.distinct_lines = Some(timing.distinct_lines);
        summary.block_percentiles = Some(Percentiles {
            p50_cycles: timing.block_cycles_p50,
            p99_cycles: timing.block_cycles_p99,
        });
        summary.closed_form.complete(&timing.closed_form, &counts);
        summary
    }

    /// Parts of runs, added up.
    #[must_use]
    pub fn of_parts(counts: &Counts, unit: &Unit) -> Summary {
        let cause = counts.ledger.largest_stall();
        Summary {
            unit: unit.identity(),
            totals: totals(counts),
            throughput: throughput(counts, unit),
            block_percentiles: None,
            traffic: traffic(counts),
            hit_rates: hit_rates(counts, unit),
            ledger: ledger(counts),
            largest_stall: cause.map(|cause| cause.name()),
            closed_form: Bounds::of(counts),
        }
    }
}

fn totals(counts: &Counts) -> Totals {
    Totals {
        cycles: counts.cycles,
        timed_pixels: counts.timed_pixels,
        pixels: counts.pixels,
        texels: counts.texels,
        shared_texels: counts.shared_texels,
        held_texels: counts.held_texels,
        decodes: counts.decodes,
        macs: counts.macs,
        jobs: counts.jobs,
        lookups: counts.lookups,
        hits: counts.hits,
        merges: counts.merges,
        misses: counts.misses,
        level2_hits: counts.level2_hits,
        fetched_lines: counts.fetched_lines,
        distinct_lines: None,
        weight_fills: counts.weight_fills,
    }
}

fn throughput(counts: &Counts, unit: &Unit) -> Throughput {
    let cycles_per_pixel = over(counts.cycles as f64, counts.timed_pixels as f64);
    let pixels_per_cycle = over(counts.timed_pixels as f64, counts.cycles as f64);
    let each = |count: u64| over(count as f64, counts.pixels as f64);
    let bytes = counts.latent_bytes + counts.weight_bytes;
    let gigahertz = f64::from(unit.clock_mhz) / 1000.0;
    let multiplied = each(counts.multiplier_cycles) * pixels_per_cycle;
    Throughput {
        cycles_per_block: cycles_per_pixel * BLOCK_PIXELS as f64,
        pixels_per_cycle,
        decodes_per_cycle: each(counts.decodes) * pixels_per_cycle,
        clock_mhz: unit.clock_mhz,
        gigapixels_per_second: pixels_per_cycle * gigahertz,
        gigatexels_per_second: each(counts.texels) * pixels_per_cycle * gigahertz,
        gigabytes_per_second: each(bytes) * pixels_per_cycle * gigahertz,
        mac_utilisation: multiplied / unit.macs_per_cycle() as f64,
    }
}

fn traffic(counts: &Counts) -> Vec<Traffic> {
    let operations = &counts.operations;
    [
        ("memory, latents", counts.latent_bytes),
        ("second level", operations.l2_read_bytes),
        ("latent cache", operations.l1_read_bytes),
        ("memory, parameters", counts.weight_bytes),
        ("weight SRAM", operations.weight_sram_read_bytes),
    ]
    .map(|(level, bytes)| {
        let all = bytes as f64;
        Traffic {
            level,
            bytes,
            bytes_per_pixel: over(all, counts.pixels as f64),
            bytes_per_texel: over(all, counts.texels as f64),
            bytes_per_block: over(all, blocks(counts.pixels)),
        }
    })
    .to_vec()
}

fn hit_rates(counts: &Counts, unit: &Unit) -> HitRates {
    let rate = |found: u64, of: u64| over(found as f64, of as f64);
    let has_cache = match unit.cache {
        CacheKind::Finite | CacheKind::Infinite => true,
        CacheKind::None => false,
    };
    let found = counts.hits + counts.merges;
    let asked = counts.texels - counts.shared_texels;
    HitRates {
        latent_cache: has_cache.then(|| rate(found, counts.lookups)),
        second_level: (unit.level2_sets > 0).then(|| rate(counts.level2_hits, counts.misses)),
        decoded_cache: (unit.decoded_cache_blocks > 0).then(|| rate(counts.held_texels, asked)),
    }
}

fn ledger(counts: &Counts) -> Vec<LedgerRow> {
    let entries = counts.ledger.entries().zip(counts.ledger.shares());
    entries
        .map(|((cause, cycles), (_, share))| LedgerRow {
            cause: cause.name(),
            cycles,
            hundredths_of_percent: share,
            meaning: cause.summary().trim(),
        })
        .collect()
}

impl Bounds {
    fn of(counts: &Counts) -> Bounds {
        let row = |(resource, work): (Resource, u64)| BoundRow {
            resource: resource.name(),
            work_cycles: work,
            bound_cycles: None,
            work_cycles_per_block: over(work as f64, blocks(counts.pixels)),
        };
        let rows = Resource::ALL.into_iter().zip(counts.work);
        let largest = rows.clone().max_by_key(|(_, work)| *work);
        let (binds, cycles) = largest.unwrap_or((Resource::Requests, 0));
        let mut bounds = Bounds {
            cycles: 0,
            cycles_per_block: 0.0,
            measured_over_bound: 0.0,
            critical_path_cycles: None,
            binds: binds.name(),
            resources: rows.map(row).collect(),
        };
        bounds.set(cycles, counts);
        bounds
    }

    fn set(&mut self, cycles: u64, counts: &Counts) {
        self.cycles = cycles;
        self.cycles_per_block = over(cycles as f64, blocks(counts.pixels));
        let measured = over(counts.cycles as f64, blocks(counts.timed_pixels));
        self.measured_over_bound = over(measured, self.cycles_per_block);
    }

    /// What only a whole run has.
    fn complete(&mut self, closed_form: &ClosedForm, counts: &Counts) {
        self.set(closed_form.cycles, counts);
        self.critical_path_cycles = Some(closed_form.critical_path);
        self.binds = closed_form.bottleneck.name();
        for (row, bound) in self.resources.iter_mut().zip(&closed_form.bounds) {
            row.bound_cycles = Some(bound.cycles);
        }
    }
}

impl EnergyRows {
    /// The operations of a run, or of parts of runs, at the prices of a table.
    #[must_use]
    pub fn of(counts: &Counts, unit: &Unit, table: &EnergyTable) -> EnergyRows {
        let energy = table.of(&counts.operations, unit);
        let per_block = |picojoules: f64| over(picojoules, blocks(counts.pixels));
        let row = |level: &crate::model::time::energy::Level| EnergyRow {
            operation: Operation::name(level.operation),
            count: level.count,
            picojoules_per_block: per_block(level.picojoules),
            share: over(level.picojoules, energy.picojoules),
        };
        EnergyRows {
            picojoules_per_block: per_block(energy.picojoules),
            operations: energy.levels.iter().map(row).collect(),
            table: energy.table,
        }
    }
}
