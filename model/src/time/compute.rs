//! Compute: one job in the MAC array and the requantisers.
//!
//! The batches of a job take turns at the array in a fixed order: layer 0 of each batch, layer 1 of
//! each batch, and so on. A layer of a batch is a row of tiles after the other; the accumulators of
//! a row go to the requantisers while the next row is multiplied. A batch's next layer starts when
//! the array is free and the batch's last accumulator of this layer has been requantised.

use super::cost::{Cost, RowCycles};
use super::ledger::Cause;
use super::rate::Rate;

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
    fn ends(&self) -> [u64; 3] {
        let computed = self.start + self.cycles.compute;
        let loaded = computed + self.cycles.load;
        [computed, loaded, loaded + self.cycles.fill]
    }
}

/// A job's way through the array.
#[derive(Clone, Debug)]
struct Job {
    /// Texels of each batch.
    batches: Vec<u64>,
    tails: Vec<Tail>,
    layer: usize,
    batch: usize,
    row_tile: u64,
    row: Option<Row>,
}

/// The array, the requantisers and the skip port.
#[derive(Debug)]
pub(super) struct Compute<'a> {
    cost: &'a Cost<'a>,
    requantizer: Rate,
    skip_port: Rate,
    job: Option<Job>,
}

impl<'a> Compute<'a> {
    pub(super) fn new(cost: &'a Cost<'a>) -> Compute<'a> {
        Compute {
            cost,
            requantizer: Rate::new(u64::from(cost.unit.requantizer_lanes)),
            skip_port: Rate::new(u64::from(cost.unit.skip_lanes)),
            job: None,
        }
    }

    /// Whether no job is in the array.
    pub(super) fn is_idle(&self) -> bool {
        self.job.is_none()
    }

    /// Takes a job of so many texels.
    pub(super) fn start(&mut self, now: u64, texels: u64) {
        let batches: Vec<u64> = self.cost.batches(texels).collect();
        let tails = vec![
            Tail {
                arrival: now,
                done: now,
                ready: now
            };
            batches.len()
        ];
        self.job = Some(Job {
            batches,
            tails,
            layer: 0,
            batch: 0,
            row_tile: 0,
            row: None,
        });
    }

    /// Whether the job is done: everything multiplied, requantised and ready.
    pub(super) fn is_done(&self, now: u64) -> bool {
        let layers = self.cost.layers.len();
        self.job.as_ref().is_some_and(|job| {
            job.layer == layers && job.tails.iter().all(|tail| tail.ready <= now)
        })
    }

    /// Gives the job away.
    pub(super) fn release(&mut self) {
        self.job = None;
    }

    /// What happens at the start of cycle `now`; whether anything did.
    pub(super) fn advance(&mut self, now: u64) -> bool {
        let unit = self.cost.unit;
        let Some(job) = self.job.as_mut() else {
            return false;
        };
        if job.layer == self.cost.layers.len() {
            return false;
        }
        let texels = job.batches[job.batch];
        let layer = &self.cost.layers[job.layer];
        match job.row {
            None if job.tails[job.batch].ready <= now => {
                let cycles = self.cost.row(job.layer, job.row_tile, texels);
                job.row = Some(Row { start: now, cycles });
                true
            }
            Some(row) if row.ends()[2] <= now => {
                let outputs = layer.outputs_of(job.row_tile);
                let arrival = now + u64::from(unit.mac_depth_cycles);
                let requantized = self
                    .requantizer
                    .serve(arrival, texels * layer.slots(outputs));
                let skipped = self.skip_port.serve(arrival, texels * layer.skips(outputs));
                let done = requantized.max(skipped);
                job.row_tile += 1;
                job.row = None;
                if job.row_tile < layer.row_tiles {
                    // Nothing in this layer depends on this row: the next one follows at once.
                    let cycles = self.cost.row(job.layer, job.row_tile, texels);
                    job.row = Some(Row { start: now, cycles });
                    return true;
                }
                let ready = done + u64::from(unit.requantizer_depth_cycles);
                job.tails[job.batch] = Tail {
                    arrival,
                    done,
                    ready,
                };
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
    fn awaited(&self, job: &Job) -> Tail {
        if job.layer == self.cost.layers.len() {
            job.tails[job.tails.len() - 1]
        } else {
            job.tails[job.batch]
        }
    }

    /// What cycle `now` is spent on, of a job that is in the array and not done.
    pub(super) fn cause(&self, now: u64) -> Option<Cause> {
        let job = self.job.as_ref()?;
        Some(match job.row {
            Some(row) => {
                let [computed, loaded, _] = row.ends();
                if now < computed {
                    Cause::Compute
                } else if now < loaded {
                    Cause::WeightLoad
                } else {
                    Cause::WeightFill
                }
            }
            None => {
                let tail = self.awaited(job);
                if (tail.arrival..tail.done).contains(&now) {
                    Cause::Requantize
                } else {
                    Cause::Dependency
                }
            }
        })
    }

    /// The cycles at which the cause may change or something may happen.
    pub(super) fn events(&self) -> [u64; 3] {
        match &self.job {
            None => [0; 3],
            Some(Job { row: Some(row), .. }) => row.ends(),
            Some(job) => {
                let tail = self.awaited(job);
                [tail.arrival, tail.done, tail.ready]
            }
        }
    }
}
