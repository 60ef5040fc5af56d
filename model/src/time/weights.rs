//! Weights: whose parameters the weight SRAM holds.
//!
//! What does not fit beside the others goes, the material not used for longest first, in the order
//! in which the array takes the jobs. A material whose parameters alone are too many keeps the layers
//! that fit and streams the rest for each batch; see [`Cost`].

use super::assemble::Job;
use super::cost::Cost;
use super::unit::Unit;

#[derive(Clone, Copy, Debug)]
struct Resident {
    material: u16,
    bytes: u64,
    /// The last job that uses it, counted from 1 in the order of the array.
    last_job: u64,
}

/// The weight SRAM, by material.
#[derive(Clone, Debug)]
pub(super) struct WeightStore {
    bytes: u64,
    /// The most recently used last.
    residents: Vec<Resident>,
    jobs: u64,
}

impl WeightStore {
    pub(super) fn new(unit: &Unit) -> WeightStore {
        WeightStore {
            bytes: u64::from(unit.weight_sram_bytes),
            residents: Vec::new(),
            jobs: 0,
        }
    }

    /// The next job of the array, with what has to come in for it. The very first has nothing: its
    /// material's parameters come before the first request.
    pub(super) fn place(&mut self, mut job: Job, costs: &[Cost]) -> Job {
        self.jobs += 1;
        let here = self
            .residents
            .iter()
            .position(|r| r.material == job.material);
        let bytes = costs[usize::from(job.material)].resident_bytes;
        if let Some(index) = here {
            self.residents.remove(index);
        } else {
            let mut used: u64 = self.residents.iter().map(|r| r.bytes).sum();
            while used + bytes > self.bytes && !self.residents.is_empty() {
                let gone = self.residents.remove(0);
                used -= gone.bytes;
                job.fill_after = job.fill_after.max(gone.last_job);
            }
            job.fill_bytes = (self.jobs > 1 && bytes > 0).then_some(bytes);
        }
        self.residents.push(Resident {
            material: job.material,
            bytes,
            last_job: self.jobs,
        });
        job
    }
}
