//! Closed form: a lower bound of a run's cycles from sums and maxima alone, without stepping.
//!
//! A unit is a line of stages, and all groups but the last are alike, as are all jobs but the last.
//! Such a line takes the time of the longest path through it: along the first group to the
//! bottleneck, along the bottleneck to the last group, and along the last group to the end. Finite
//! queues do not lengthen it, because the schedule that starts a job every bottleneck period never
//! fills them. Hence the bound is met exactly with an ideal memory ([`Unit::with_ideal_memory`]);
//! real memory only adds waits, each of which delays what follows and nothing else.
//!
//! [`Unit::with_ideal_memory`]: super::Unit::with_ideal_memory

use super::cost::Cost;
use super::lookup::{Lines, fetches};
use super::memory;
use crate::trace::Trace;

/// What a bound is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Resource {
    /// The requests that come in.
    Requests,
    /// The address generators.
    Address,
    /// The tags and their banks.
    Lookup,
    /// The bytes that memory delivers in a cycle, each distinct line once.
    Memory,
    /// The miss registers, each distinct line held for the latency once.
    Mshrs,
    /// Unpacking, interpolation, waves and level.
    Embed,
    /// The multiplications.
    MacArray,
    /// Tiles of weights on their way into the array.
    WeightLoad,
    /// Weights on their way into the unit.
    WeightFill,
    /// The requantisers.
    Requantizer,
    /// The residual store.
    SkipPort,
    /// The channels that go out.
    Output,
}

impl Resource {
    /// The name in tables and JSON.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Resource::Requests => "requests",
            Resource::Address => "address",
            Resource::Lookup => "lookup",
            Resource::Memory => "memory",
            Resource::Mshrs => "mshrs",
            Resource::Embed => "embed",
            Resource::MacArray => "mac-array",
            Resource::WeightLoad => "weight-load",
            Resource::WeightFill => "weight-fill",
            Resource::Requantizer => "requantizer",
            Resource::SkipPort => "skip-port",
            Resource::Output => "output",
        }
    }
}

/// The fewest cycles of a run, as far as one resource is concerned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bound {
    /// The resource. For the array and what feeds it, the one that a job uses longest.
    pub resource: Resource,
    /// Cycles in which the resource works.
    pub work: u64,
    /// Those, and the fill before and the drain behind them.
    pub cycles: u64,
}

/// A lower bound of a run's cycles.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ClosedForm {
    /// The largest bound.
    pub cycles: u64,
    /// Whose it is; among equals, the resource with most work.
    pub bottleneck: Resource,
    /// The bound of each resource, in the order of the texel's journey.
    pub bounds: Vec<Bound>,
}

/// A job in the array: its cycles, and those of each resource it uses.
#[derive(Clone, Copy, Debug)]
pub(super) struct JobCycles {
    pub(super) total: u64,
    work: [(Resource, u64); 5],
}

/// The cycles of a job of so many texels in the array, layer by layer and batch by batch.
///
/// With R rows of tiles of m cycles each, the array is busy for R·m; row r's accumulators arrive at
/// the requantisers after (r+1)·m, so these are done at the latest of arrival(r) + rest(r) / rate
/// over r, which is linear in r but for the last row and therefore largest at an end.
pub(super) fn job_cycles(cost: &Cost, texels: u64) -> JobCycles {
    let unit = cost.unit;
    let depth = u64::from(unit.mac_depth_cycles);
    let rates = [
        u64::from(unit.requantizer_lanes),
        u64::from(unit.skip_lanes),
    ];
    let batches: Vec<u64> = cost.batches(texels).collect();
    let mut ready = vec![0_u64; batches.len()];
    let mut array_free = 0;
    // When each rate is free, in units of its work.
    let mut free = [0_u64; 2];
    let (mut compute, mut load, mut fill, mut used) = (0, 0, 0, [0_u64; 2]);
    for (index, layer) in cost.layers.iter().enumerate() {
        let last_row = layer.row_tiles - 1;
        for (batch, &texels) in batches.iter().enumerate() {
            let (full, last) = (
                cost.row(index, 0, texels),
                cost.row(index, last_row, texels),
            );
            let start = array_free.max(ready[batch]);
            array_free = start + last_row * full.total() + last.total();
            compute += last_row * full.compute + last.compute;
            load += last_row * full.load + last.load;
            fill += last_row * full.fill + last.fill;
            let ends = [0, last_row.saturating_sub(1), last_row];
            let mut done = 0;
            for (port, rate) in rates.into_iter().enumerate() {
                let work = |outputs| match port {
                    0 => texels * layer.slots(outputs),
                    _ => texels * layer.skips(outputs),
                };
                let all = work(layer.outputs_from(0));
                let through = ends.map(|row| {
                    let end = if row == last_row {
                        array_free
                    } else {
                        start + (row + 1) * full.total()
                    };
                    (end + depth) * rate + work(layer.outputs_from(row))
                });
                free[port] = through.into_iter().fold(free[port] + all, u64::max);
                used[port] += all;
                done = done.max(free[port].div_ceil(rate));
            }
            ready[batch] = done + u64::from(unit.requantizer_depth_cycles);
        }
    }
    let work = [
        (Resource::MacArray, compute),
        (Resource::WeightLoad, load),
        (Resource::WeightFill, fill),
        (Resource::Requantizer, used[0].div_ceil(rates[0])),
        (Resource::SkipPort, used[1].div_ceil(rates[1])),
    ];
    JobCycles {
        total: ready.into_iter().fold(0, u64::max),
        work,
    }
}

/// What a trace asks of the latent cache and the memory, whatever the order of replacement.
#[derive(Clone, Copy, Debug, Default)]
struct Footprint {
    /// Lines touched at least once.
    distinct_lines: u64,
    /// Cycles of the tags.
    lookup_cycles: u64,
    /// Whether the first group touches a line.
    is_cold: bool,
}

fn footprint(cost: &Cost, trace: &Trace) -> Footprint {
    let mut lines = Lines::new(cost.unit);
    let mut distinct: Vec<u64> = Vec::new();
    let mut footprint = Footprint::default();
    for group in 0..cost.groups {
        let first = group * u64::from(cost.unit.coalesced_texels);
        let count = cost.texels_of_group(group);
        for fetch in 0..fetches(cost, trace, first, count) {
            footprint.lookup_cycles += lines.collect(trace, first, count, fetch as usize);
            // Most lines were touched by the group before; the sort below sees the rest.
            let recent = distinct.len().saturating_sub(8);
            let new = |line: &&u64| !distinct[recent..].contains(line);
            let new: Vec<u64> = lines.lines.iter().filter(new).copied().collect();
            distinct.extend(new);
        }
        footprint.is_cold |= group == 0 && !distinct.is_empty();
    }
    distinct.sort_unstable();
    distinct.dedup();
    footprint.distinct_lines = distinct.len() as u64;
    footprint
}

/// The bound of every resource, and the largest.
pub(super) fn bound(cost: &Cost, trace: &Trace) -> ClosedForm {
    if cost.jobs == 0 {
        return ClosedForm {
            cycles: 0,
            bottleneck: Resource::Requests,
            bounds: Vec::new(),
        };
    }
    let mut bounds = Line::new(cost, trace).bounds();
    for bound in &mut bounds {
        bound.cycles += cost.weight_fill();
    }
    let largest = bounds.iter().max_by_key(|bound| (bound.cycles, bound.work));
    let (cycles, bottleneck) = largest.map_or((0, Resource::Requests), |bound| {
        (bound.cycles, bound.resource)
    });
    ClosedForm {
        cycles,
        bottleneck,
        bounds,
    }
}

/// The stages that a group passes one after the other; the latency of a hit lies before the last.
const FRONT: [Resource; 4] = [
    Resource::Requests,
    Resource::Address,
    Resource::Lookup,
    Resource::Embed,
];

/// The line of stages, with the cycles of each for a full and for the last group or job.
struct Line<'a> {
    cost: &'a Cost<'a>,
    footprint: Footprint,
    front: [u64; 4],
    last_front: [u64; 4],
    job: JobCycles,
    last_job: JobCycles,
    output: u64,
    last_output: u64,
}

impl<'a> Line<'a> {
    fn new(cost: &'a Cost<'a>, trace: &Trace) -> Line<'a> {
        let front = |texels: u64| {
            [
                cost.request(texels),
                cost.address(texels),
                cost.lookup(),
                cost.embed(texels),
            ]
        };
        let [full, last] = [0, cost.jobs - 1].map(|job| cost.texels_of_job(job));
        Line {
            cost,
            footprint: footprint(cost, trace),
            front: front(cost.texels_of_group(0)),
            last_front: front(cost.texels_of_group(cost.groups - 1)),
            job: job_cycles(cost, full),
            last_job: job_cycles(cost, last),
            output: cost.output(full),
            last_output: cost.output(last),
        }
    }

    fn hit(&self) -> u64 {
        u64::from(self.cost.unit.hit_latency_cycles)
    }

    /// From the last group's embedding to the end.
    fn tail(&self) -> u64 {
        self.last_job.total + self.last_output
    }

    /// When the first group's lookup starts.
    fn first_lookup(&self) -> u64 {
        self.front[0] + self.front[1]
    }

    /// When the first group's corners are there, if it must miss.
    fn first_corners(&self) -> u64 {
        let missed = self.first_lookup() + memory::unloaded_cycles(self.cost.unit) + self.hit();
        if self.footprint.is_cold { missed } else { 0 }
    }

    /// When all groups have passed, if `stage` is never without one.
    fn all_passed(&self, stage: usize) -> u64 {
        let groups = self.cost.groups;
        if groups == 1 {
            return self.last_front.iter().sum::<u64>() + self.hit();
        }
        let along = self.front[stage] * (groups - 2);
        let path = |turn: usize| {
            self.front[..=turn].iter().sum::<u64>() + self.last_front[turn..].iter().sum::<u64>()
        };
        let longest = (stage..self.front.len()).map(path).fold(0, u64::max);
        longest + along + self.hit()
    }

    /// When the groups of the first `jobs` jobs, all full, have passed `stage` and all after it.
    fn jobs_passed(&self, stage: usize, jobs: u64) -> u64 {
        let groups = jobs * self.cost.groups_per_job;
        self.front.iter().sum::<u64>() + (groups - 1) * self.front[stage] + self.hit()
    }

    fn bounds(&self) -> Vec<Bound> {
        let (groups, jobs) = (self.cost.groups, self.cost.jobs);
        let mut bounds = Vec::new();
        for (stage, resource) in FRONT.into_iter().enumerate() {
            let mut cycles = self.all_passed(stage) + self.tail();
            if resource == Resource::Embed {
                let embedded = (groups - 1) * self.front[stage] + self.last_front[stage];
                cycles = cycles.max(self.first_corners() + embedded + self.tail());
            }
            if jobs > 1 {
                // The last full job may be longer than the last job behind it.
                let passed = self.jobs_passed(stage, jobs - 1) + self.job.total;
                cycles = cycles.max(passed + self.tail());
                cycles = cycles.max(passed + self.output + self.last_output);
            }
            let mut work = (groups - 1) * self.front[stage] + self.last_front[stage];
            if resource == Resource::Lookup {
                // Conflicts of banks are known from the trace, wherever they fall.
                work = self.footprint.lookup_cycles;
                cycles = cycles.max(self.first_lookup() + work + self.behind());
            }
            bounds.push(Bound {
                resource,
                work,
                cycles,
            });
            if resource == Resource::Lookup {
                bounds.extend(self.memory());
            }
        }
        bounds.extend(self.array_and_output());
        bounds
    }

    /// The bounds of the array and of the output: the first job as soon as it is embedded, then one
    /// job after the other.
    fn array_and_output(&self) -> [Bound; 2] {
        let others = self.cost.jobs - 1;
        let stages = 0..FRONT.len();
        // Until the first job starts; in the array; behind it until the last job's channels go.
        let (first, job, behind) = if others > 0 {
            let embed = self.front[3] * self.cost.groups_per_job;
            let passed = stages.map(|stage| self.jobs_passed(stage, 1));
            let first = passed.fold(self.first_corners() + embed, u64::max);
            (first, self.job.total, self.output.max(self.last_job.total))
        } else {
            let passed = stages.map(|stage| self.all_passed(stage));
            (
                passed.fold(0, u64::max),
                self.last_job.total,
                self.last_job.total,
            )
        };
        let used = self.job.work.into_iter().zip(self.last_job.work);
        let used = used.map(|(full, last)| (full.0, others * full.1 + last.1));
        let most = |most: (Resource, u64), used: (Resource, u64)| {
            if used.1 > most.1 { used } else { most }
        };
        let (resource, work) = used.fold((Resource::MacArray, 0), most);
        let cycles = first + others * self.job.total + behind + self.last_output;
        let out = others * self.output + self.last_output;
        [
            Bound {
                resource,
                work,
                cycles,
            },
            Bound {
                resource: Resource::Output,
                work: out,
                cycles: first + job + out,
            },
        ]
    }

    /// The least that follows the lookup of any group: its hit, its embedding, its job and its
    /// channels.
    fn behind(&self) -> u64 {
        let embed = self.front[3].min(self.last_front[3]);
        let job = self.job.total.min(self.last_job.total);
        self.hit() + embed + job + self.output.min(self.last_output)
    }

    /// The bounds of the memory and of the miss registers: every distinct line comes at least once.
    fn memory(&self) -> [Bound; 2] {
        let unit = self.cost.unit;
        let lines = self.footprint.distinct_lines;
        let latency = u64::from(unit.memory_latency_cycles);
        let bytes = lines * memory::transfer_bytes(unit);
        let bus = bytes.div_ceil(u64::from(unit.memory_bytes_per_cycle));
        let held = lines.div_ceil(u64::from(unit.mshrs)) * memory::unloaded_cycles(unit);
        let around = self.first_lookup() + self.behind();
        let waits = if lines == 0 { 0 } else { latency };
        [
            Bound {
                resource: Resource::Memory,
                work: bus,
                cycles: around + bus + waits,
            },
            Bound {
                resource: Resource::Mshrs,
                work: held,
                cycles: around + held,
            },
        ]
    }
}
