//! Closed form: a lower bound of a run's cycles from sums and maxima, without stepping.
//!
//! For each resource: its work in cycles, and when the first thing can reach it. Beside them the
//! longest path through the groups and jobs (`critical`). The bound is the largest
//! of all; a run with ideal memory and endless queues takes exactly as long.

use super::assemble::{Group, Job};
use super::cost::Cost;
use super::critical::CriticalPath;
use super::distinct::DistinctLines;
use super::job_cycles::JobCycles;
use super::memory;
use super::unit::Unit;

macro_rules! resources {
    ($( $(#[doc = $doc:literal])+ $variant:ident = $name:literal, )*) => {
        /// What a bound is about.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub enum Resource {
            $( $(#[doc = $doc])+ $variant, )*
        }

        impl Resource {
            /// Every resource, in the order of the texel's journey.
            pub const ALL: [Resource; [$( $name ),*].len()] = [ $( Resource::$variant ),* ];

            /// The name in tables and JSON.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self { $( Resource::$variant => $name, )* }
            }
        }
    };
}

resources! {
    /// The requests that come in.
    Requests = "requests",
    /// The address generators.
    Address = "address",
    /// The tags and their banks.
    Lookup = "lookup",
    /// The bytes that memory delivers in a cycle, each distinct line once.
    Memory = "memory",
    /// The miss registers, each distinct line held for the latency once.
    Mshrs = "mshrs",
    /// Unpacking, interpolation, waves and level.
    Embed = "embed",
    /// Materials' weights on their way into the unit.
    WeightFill = "weight-fill",
    /// The multiplications.
    MacArray = "mac-array",
    /// Operands on their way through a systolic array.
    ArrayFill = "array-fill",
    /// Tiles of weights on their way into the array.
    WeightLoad = "weight-load",
    /// Layers that do not fit, streamed for each batch, as far as the array waits for them.
    WeightStream = "weight-stream",
    /// The requantisers.
    Requantizer = "requantizer",
    /// The residual store.
    SkipPort = "skip-port",
    /// The filter.
    Filter = "filter",
    /// The channels that go out.
    Output = "output",
}

/// The fewest cycles of a run, as far as one resource is concerned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bound {
    /// The resource.
    pub resource: Resource,
    /// Cycles in which the resource works.
    pub work: u64,
    /// Those, and the cycles before the first thing can reach it.
    pub cycles: u64,
}

/// A lower bound of a run's cycles.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ClosedForm {
    /// The largest bound, or the critical path where that is longer.
    pub cycles: u64,
    /// The longest path through all groups and jobs, with no queue ever full and no line waited for
    /// but the first time.
    pub critical_path: u64,
    /// The resource with the largest bound; among equals, with most work.
    pub bottleneck: Resource,
    /// The bound of each resource, in the order of [`Resource::ALL`].
    pub bounds: Vec<Bound>,
}

/// The sums of the groups so far.
#[derive(Debug)]
pub(super) struct Sums<'a> {
    unit: &'a Unit,
    costs: &'a [Cost<'a>],
    path: CriticalPath<'a>,
    start: u64,
    work: [u64; Resource::ALL.len()],
    lines: DistinctLines,
}

impl<'a> Sums<'a> {
    /// Nothing yet; the first request can come in at `start`, when so many cycles have gone into the
    /// first material's weights.
    pub(super) fn new(unit: &'a Unit, costs: &'a [Cost<'a>], start: u64) -> Sums<'a> {
        let mut work = [0; Resource::ALL.len()];
        work[Resource::WeightFill as usize] = start;
        Sums {
            unit,
            costs,
            path: CriticalPath::new(unit, costs, start),
            start,
            work,
            lines: DistinctLines::default(),
        }
    }

    /// Adds a group, and the jobs that are complete with it.
    pub(super) fn group(&mut self, group: &Group) {
        let Sums {
            costs, work, path, ..
        } = self;
        let cost = &costs[usize::from(group.material)];
        let tags: u64 = group.fetches.iter().map(|fetch| fetch.tag_cycles).sum();
        for (resource, cycles) in [
            (Resource::Requests, cost.request(group)),
            (Resource::Address, cost.address(group)),
            (Resource::Lookup, tags.max(1)),
            (Resource::Embed, cost.embed(group)),
        ] {
            work[resource as usize] += cycles;
        }
        let before = self.lines.count();
        for &line in &group.lines {
            self.lines.add(line);
        }
        let is_new = self.lines.count() > before;
        let latency = u64::from(self.unit.weight_latency_cycles);
        path.group(group, is_new, |job: &Job, cycles: &JobCycles| {
            let cost = &costs[usize::from(job.material)];
            let fill = job.fill_bytes.map_or(0, |bytes| latency + cost.fill(bytes));
            work[Resource::WeightFill as usize] += fill;
            work[Resource::Filter as usize] += cost.filter(job.weighted);
            work[Resource::Output as usize] += cost.output(job.pixels);
            for (resource, cycles) in JobCycles::RESOURCES.into_iter().zip(cycles.work) {
                work[resource as usize] += cycles;
            }
        });
    }

    /// Distinct lines so far.
    pub(super) fn distinct_lines(&self) -> u64 {
        self.lines.count()
    }

    /// The bound of every resource, and the largest.
    pub(super) fn bound(&self) -> ClosedForm {
        let (critical_path, firsts) = self.path.end();
        let unit = self.unit;
        let lines = self.lines.count();
        let bytes = lines * memory::transfer_bytes(unit);
        let bus = bytes.div_ceil(u64::from(unit.memory_bytes_per_cycle));
        let held = (lines * memory::unloaded_cycles(unit)).div_ceil(u64::from(unit.mshrs));
        let latency = if lines > 0 {
            memory::latency_cycles(unit)
        } else {
            0
        };
        let bounds: Vec<Bound> = Resource::ALL
            .into_iter()
            .map(|resource| {
                let work = self.work[resource as usize];
                let (before, work) = match resource {
                    Resource::Requests => (self.start, work),
                    Resource::WeightFill => (0, work),
                    Resource::Address => (firsts.address, work),
                    Resource::Lookup => (firsts.lookup, work),
                    Resource::Memory => (firsts.lookup + latency, bus),
                    Resource::Mshrs => (firsts.lookup, held),
                    Resource::Embed => (firsts.embed, work),
                    Resource::MacArray
                    | Resource::ArrayFill
                    | Resource::WeightLoad
                    | Resource::WeightStream
                    | Resource::Requantizer
                    | Resource::SkipPort => (firsts.array, work),
                    Resource::Filter => (firsts.filter, work),
                    Resource::Output => (firsts.output, work),
                };
                Bound {
                    resource,
                    work,
                    cycles: if work == 0 { 0 } else { before + work },
                }
            })
            .collect();
        let largest = bounds.iter().max_by_key(|bound| (bound.cycles, bound.work));
        let (largest, bottleneck) = largest.map_or((0, Resource::Requests), |bound| {
            (bound.cycles, bound.resource)
        });
        ClosedForm {
            cycles: largest.max(critical_path),
            critical_path,
            bottleneck,
            bounds,
        }
    }
}
