//! Compute: one job in the MAC array and the requantisers.
//!
//! The batches of a job take turns at the array in a fixed order: layer 0 of each batch, layer 1 of
//! each batch, and so on. A layer of a batch is a row of tiles after the other; the accumulators of
//! a row go to the requantisers while the next row is multiplied. A batch's next layer starts when
//! the array is free and the batch's last accumulator of this layer has been requantised.

use super::assemble::Job as Plan;
use super::cost::{Cost, RowCycles};
use super::ledger::Cause;
use super::rate::Rate;
use super::unit::Unit;
use super::watch::{Interval, Stage, Watch};

/// What becomes of the last accumulators that a batch gave to the requantisers.
#[derive(Clone, Copy, Debug, Default)]
struct Tail {
    /// The requantisers have them.
    arrival: u64,
    /// The requantisers and the skip port have taken their share.
    done: u64,
    /// The activations can be read.
    ready: u64,
}

/// The row of tiles in the array.
#[derive(Clone, Copy, Debug)]
struct Row {
    start: u64,
    cycles: RowCycles,
}

impl Row {
    /// When the array has computed, is empty, has its next tile, and has its weights.
    fn ends(&self) -> [u64; 4] {
        let computed = self.start + self.cycles.compute;
        let empty = computed + self.cycles.skew;
        let loaded = empty + self.cycles.load;
        [computed, empty, loaded, loaded + self.cycles.fill]
    }
}

/// A job's way through the array.
#[derive(Clone, Debug)]
struct Job<'a> {
    cost: &'a Cost<'a>,
    number: u64,
    /// Texels of each batch.
    batches: Vec<u64>,
    tails: Vec<Tail>,
    layer: usize,
    batch: usize,
    row_tile: u64,
    row: Option<Row>,
    /// When the first row of the layer and batch started.
    layer_start: u64,
}

/// The array, the requantisers and the skip port.
#[derive(Debug)]
pub(super) struct Compute<'a> {
    depths: [u64; 2],
    requantizer: Rate,
    skip_port: Rate,
    job: Option<Job<'a>>,
}

impl<'a> Compute<'a> {
    pub(super) fn new(unit: &Unit) -> Compute<'a> {
        let depths = [unit.mac_depth_cycles, unit.requantizer_depth_cycles];
        Compute {
            depths: depths.map(u64::from),
            requantizer: Rate::new(u64::from(unit.requantizer_lanes)),
            skip_port: Rate::new(u64::from(unit.skip_lanes)),
            job: None,
        }
    }

    /// Whether no job is in the array.
    pub(super) fn is_idle(&self) -> bool {
        self.job.is_none()
    }

    /// Takes a job.
    pub(super) fn start(&mut self, now: u64, cost: &'a Cost<'a>, plan: &Plan) {
        let batches: Vec<u64> = cost.batches(plan.decodes).collect();
        let tail = Tail {
            arrival: now,
            done: now,
            ready: now,
        };
        self.job = Some(Job {
            cost,
            number: plan.number,
            tails: vec![tail; batches.len()],
            // Nothing to decode is decoded at once.
            layer: if batches.is_empty() {
                cost.layers.len()
            } else {
                0
            },
            batches,
            batch: 0,
            row_tile: 0,
            row: None,
            layer_start: now,
        });
    }

    /// Whether the job is done: everything multiplied, requantised and ready.
    pub(super) fn is_done(&self, now: u64) -> bool {
        self.job.as_ref().is_some_and(|job| {
            job.layer == job.cost.layers.len() && job.tails.iter().all(|tail| tail.ready <= now)
        })
    }

    /// Gives the job away.
    pub(super) fn release(&mut self) {
        self.job = None;
    }

    /// What happens at the start of cycle `now`; whether anything did.
    pub(super) fn advance(&mut self, now: u64, watch: &mut impl Watch) -> bool {
        let [mac_depth, requantizer_depth] = self.depths;
        let Some(job) = self.job.as_mut() else {
            return false;
        };
        if job.layer == job.cost.layers.len() {
            return false;
        }
        let texels = job.batches[job.batch];
        let layer = &job.cost.layers[job.layer];
        match job.row {
            None if job.tails[job.batch].ready <= now => {
                let cycles = job.cost.row(job.layer, job.row_tile, texels);
                job.row = Some(Row { start: now, cycles });
                job.layer_start = now;
                true
            }
            Some(row) if row.ends()[3] <= now => {
                let outputs = layer.outputs_of(job.row_tile);
                let arrival = now + mac_depth;
                let requantized = self
                    .requantizer
                    .serve(arrival, texels * layer.slots(outputs));
                let skipped = self.skip_port.serve(arrival, texels * layer.skips(outputs));
                let done = requantized.max(skipped);
                job.row_tile += 1;
                job.row = None;
                if job.row_tile < layer.row_tiles {
                    // Nothing in this layer depends on this row: the next one follows at once.
                    let cycles = job.cost.row(job.layer, job.row_tile, texels);
                    job.row = Some(Row { start: now, cycles });
                    return true;
                }
                let ready = done + requantizer_depth;
                job.tails[job.batch] = Tail {
                    arrival,
                    done,
                    ready,
                };
                job.watch(now, ready, watch);
                job.row_tile = 0;
                job.batch += 1;
                if job.batch == job.batches.len() {
                    job.batch = 0;
                    job.layer += 1;
                }
                true
            }
            None | Some(_) => false,
        }
    }

    /// What a waiting array waits for: the batch whose turn it is or, at the end, the last one.
    fn awaited(job: &Job) -> Tail {
        let index = if job.layer == job.cost.layers.len() {
            job.tails.len().saturating_sub(1)
        } else {
            job.batch
        };
        job.tails.get(index).copied().unwrap_or_default()
    }

    /// What cycle `now` is spent on, of a job that is in the array and not done.
    pub(super) fn cause(&self, now: u64) -> Option<Cause> {
        let job = self.job.as_ref()?;
        Some(match job.row {
            Some(row) => {
                let [computed, empty, loaded, _] = row.ends();
                if now < computed {
                    Cause::Compute
                } else if now < empty {
                    Cause::ArrayFill
                } else if now < loaded {
                    Cause::WeightLoad
                } else {
                    Cause::WeightFill
                }
            }
            None => {
                let tail = Compute::awaited(job);
                if (tail.arrival..tail.done).contains(&now) {
                    Cause::Requantize
                } else {
                    Cause::Dependency
                }
            }
        })
    }

    /// The cycles at which the cause may change or something may happen.
    pub(super) fn events(&self) -> [u64; 4] {
        match &self.job {
            None => [0; 4],
            Some(Job { row: Some(row), .. }) => row.ends(),
            Some(job) => {
                let tail = Compute::awaited(job);
                [tail.arrival, tail.done, tail.ready, 0]
            }
        }
    }
}

impl Job<'_> {
    /// Shows a layer of a batch that has left the array at `now`, and its way to its activations.
    fn watch(&self, now: u64, ready: u64, watch: &mut impl Watch) {
        let part = (self.layer as u32) << 8 | self.batch as u32;
        let mut show = |stage, start, end| {
            watch.interval(Interval {
                stage,
                number: self.number,
                part,
                start,
                end,
            });
        };
        show(Stage::Dense, self.layer_start, now);
        show(Stage::Requantize, now, ready);
    }
}
