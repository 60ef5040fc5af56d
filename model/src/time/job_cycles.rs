//! Job cycles: how long a job is in the MAC array, from sums and maxima, without stepping.

use super::closed_form::Resource;
use super::cost::Cost;
use std::collections::HashMap;

/// A job in the array: its cycles, and those of each resource it uses.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct JobCycles {
    pub(super) total: u64,
    pub(super) work: [u64; JobCycles::RESOURCES.len()],
}

impl JobCycles {
    /// The resources of a job, in the order of its `work`.
    pub(super) const RESOURCES: [Resource; 6] = [
        Resource::MacArray,
        Resource::ArrayFill,
        Resource::WeightLoad,
        Resource::WeightStream,
        Resource::Requantizer,
        Resource::SkipPort,
    ];

    /// The cycles of a job of so many texels, layer by layer and batch by batch.
    ///
    /// With R rows of tiles of m cycles each, the array is busy for R·m; row r's accumulators arrive
    /// at the requantisers after (r+1)·m, so these are done at the latest of arrival(r) + rest(r) /
    /// rate over r, which is linear in r but for the last row and therefore largest at an end.
    fn of(cost: &Cost, texels: u64) -> JobCycles {
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
        let (mut array, mut used) = ([0_u64; 4], [0_u64; 2]);
        for (index, layer) in cost.layers.iter().enumerate() {
            let last_row = layer.row_tiles - 1;
            for (batch, &texels) in batches.iter().enumerate() {
                let (full, last) = (
                    cost.row(index, 0, texels),
                    cost.row(index, last_row, texels),
                );
                let start = array_free.max(ready[batch]);
                array_free = start + last_row * full.total() + last.total();
                let full_parts = [full.compute, full.skew, full.load, full.fill];
                let last_parts = [last.compute, last.skew, last.load, last.fill];
                for (sum, (full, last)) in array.iter_mut().zip(full_parts.iter().zip(last_parts)) {
                    *sum += last_row * full + last;
                }
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
        let [compute, skew, load, fill] = array;
        let ports = [used[0].div_ceil(rates[0]), used[1].div_ceil(rates[1])];
        JobCycles {
            total: ready.into_iter().fold(0, u64::max),
            work: [compute, skew, load, fill, ports[0], ports[1]],
        }
    }
}

/// The cycles of jobs, by material and texels: most jobs are alike.
#[derive(Debug, Default)]
pub(super) struct JobTable {
    known: HashMap<(usize, u64), JobCycles>,
}

impl JobTable {
    pub(super) fn of(&mut self, cost: &Cost, material: usize, texels: u64) -> &JobCycles {
        let entry = self.known.entry((material, texels));
        entry.or_insert_with(|| JobCycles::of(cost, texels))
    }
}
