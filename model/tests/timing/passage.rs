//! Nothing is lost, doubled or overtaken, however small the queues are.

use crate::any::{Asked, asked, unit};
use crate::fixture::materials;
use ntmu_model::time::watch::{Interval, Signal, Stage};
use ntmu_model::time::{Cause, Unit, Watch, simulate};
use proptest::prelude::*;
use std::collections::BTreeMap;

/// What a run showed.
#[derive(Default)]
struct Seen {
    /// In the order in which they ended.
    intervals: BTreeMap<Stage, Vec<Interval>>,
    levels: BTreeMap<Signal, Vec<u64>>,
    charges: Vec<(Cause, u64, u64)>,
    lines: u64,
    missed: u64,
    fetched: u64,
}

impl Watch for Seen {
    fn interval(&mut self, interval: Interval) {
        self.intervals
            .entry(interval.stage)
            .or_default()
            .push(interval);
    }

    fn charge(&mut self, cause: Cause, start: u64, end: u64) {
        self.charges.push((cause, start, end));
    }

    fn level(&mut self, signal: Signal, _at: u64, value: u64) {
        self.levels.entry(signal).or_default().push(value);
    }

    fn lookup(&mut self, _pixel: [u32; 2], lines: u32, misses: u32) {
        self.lines += u64::from(lines);
        self.missed += u64::from(misses);
    }

    fn miss(&mut self, _at: u64, _address: u64) {
        self.fetched += 1;
    }
}

impl Seen {
    fn of(&self, stage: Stage) -> &[Interval] {
        self.intervals.get(&stage).map_or(&[], Vec::as_slice)
    }

    /// The stages of groups: each group passes each once, one after the other, all in one order.
    fn check_groups(&self) -> Result<(), TestCaseError> {
        let front: Vec<Stage> = Stage::ALL
            .into_iter()
            .filter(|stage| stage.is_front())
            .collect();
        for (number, requested) in self.of(Stage::Request).iter().enumerate() {
            let mut before = requested.start;
            for &stage in &front {
                let passed = self.of(stage)[number];
                prop_assert_eq!(passed.number, number as u64, "{:?}", stage);
                let follows = if matches!(stage, Stage::Request | Stage::Address) {
                    // The request queue may hold it for a while.
                    passed.start >= before
                } else {
                    passed.start == before
                };
                prop_assert!(follows && passed.end >= passed.start, "{:?}", passed);
                before = passed.end;
            }
        }
        for &stage in &front {
            let passed = self.of(stage);
            prop_assert_eq!(passed.len(), self.of(Stage::Request).len());
            for pair in passed.windows(2) {
                prop_assert!(pair[0].end <= pair[1].end, "{:?}", stage);
                // All but the FIFO hold one group.
                let is_single = stage != Stage::Corners;
                prop_assert!(!is_single || pair[0].end <= pair[1].start, "{:?}", stage);
            }
        }
        Ok(())
    }

    /// The stages of jobs: each job passes each once, and all pass all in the order of the array.
    fn check_jobs(&self) -> Result<(), TestCaseError> {
        let numbers = |stage| -> Vec<u64> { self.of(stage).iter().map(|i| i.number).collect() };
        let order = numbers(Stage::JobWait);
        let mut sorted = order.clone();
        sorted.sort_unstable();
        prop_assert_eq!(sorted, (0..order.len() as u64).collect::<Vec<u64>>());
        for stage in [Stage::Filter, Stage::OutputWait, Stage::Output] {
            prop_assert_eq!(numbers(stage), order.clone(), "{:?}", stage);
        }
        for index in 0..order.len() {
            let at = |stage: Stage| self.of(stage)[index];
            let start = at(Stage::JobWait).end;
            let (filter, wait) = (at(Stage::Filter), at(Stage::OutputWait));
            prop_assert!(at(Stage::JobWait).start <= start && start <= filter.start);
            prop_assert!(filter.start <= filter.end && filter.end <= wait.start);
            prop_assert!(wait.start <= wait.end && wait.end == at(Stage::Output).start);
            if index > 0 {
                prop_assert!(self.of(Stage::Output)[index - 1].end <= at(Stage::Output).start);
            }
        }
        self.check_layers(&order)
    }

    /// Each layer of each batch of a job is multiplied once, and then requantised once.
    fn check_layers(&self, order: &[u64]) -> Result<(), TestCaseError> {
        let (dense, requantized) = (self.of(Stage::Dense), self.of(Stage::Requantize));
        prop_assert_eq!(dense.len(), requantized.len());
        let mut of_job: BTreeMap<u64, Vec<u32>> = BTreeMap::new();
        for (multiplied, requantized) in dense.iter().zip(requantized) {
            let same =
                (multiplied.number, multiplied.part) == (requantized.number, requantized.part);
            prop_assert!(same && multiplied.end == requantized.start);
            of_job
                .entry(multiplied.number)
                .or_default()
                .push(multiplied.part);
        }
        for pair in dense.windows(2) {
            prop_assert!(pair[0].end <= pair[1].start, "one layer at a time");
        }
        for parts in of_job.values() {
            let last = parts.iter().max().copied().unwrap_or(0);
            let (layers, batches) = ((last >> 8) + 1, (last & 255) + 1);
            let all =
                (0..layers).flat_map(|layer| (0..batches).map(move |batch| layer << 8 | batch));
            prop_assert_eq!(parts, &all.collect::<Vec<u32>>());
        }
        let multiplied: Vec<u64> = order
            .iter()
            .copied()
            .filter(|n| of_job.contains_key(n))
            .collect();
        let mut jobs: Vec<u64> = dense.iter().map(|interval| interval.number).collect();
        jobs.dedup();
        prop_assert_eq!(jobs, multiplied);
        Ok(())
    }

    /// Queues hold no more than they can, and what went into one came out.
    fn check_levels(&self, unit: &Unit, pixels: u64) -> Result<(), TestCaseError> {
        let groups = |texels: u32| u64::from(texels / unit.coalesced_texels);
        for (signal, room) in [
            (Signal::RequestQueue, groups(unit.request_queue_texels)),
            (Signal::CornerFifo, groups(unit.corner_fifo_texels)),
            (Signal::MissRegisters, u64::from(unit.mshrs)),
            (Signal::HeldJobs, u64::from(unit.material_bins) + 1),
            (Signal::OutputQueue, u64::from(unit.output_queue_pixels)),
        ] {
            let levels = self.levels.get(&signal).map_or(&[][..], Vec::as_slice);
            for &level in levels {
                prop_assert!(level <= room, "{:?}: {} of {}", signal, level, room);
            }
        }
        let queue = self
            .levels
            .get(&Signal::OutputQueue)
            .map_or(&[][..], Vec::as_slice);
        let before = std::iter::once(0).chain(queue.iter().copied());
        let came_in: u64 = before
            .zip(queue)
            .map(|(b, &after)| after.saturating_sub(b))
            .sum();
        prop_assert_eq!(came_in, pixels);
        prop_assert_eq!(queue.last().copied().unwrap_or(0), 0);
        Ok(())
    }
}

fn watched(unit: &Unit, asked: &Asked) -> Result<Seen, TestCaseError> {
    let mut seen = Seen::default();
    let materials = materials(&asked.built);
    let mut demands = asked.demands.iter().cloned();
    let timing = simulate(unit, &materials, &mut demands, &mut seen).unwrap();
    // Watching changes nothing.
    let mut again = asked.demands.iter().cloned();
    prop_assert_eq!(
        &simulate(unit, &materials, &mut again, &mut ()).unwrap(),
        &timing
    );
    let mut now = 0;
    let mut causes: BTreeMap<Cause, u64> = BTreeMap::new();
    for &(cause, start, end) in &seen.charges {
        prop_assert!(start == now && end >= start);
        now = end;
        *causes.entry(cause).or_default() += end - start;
    }
    prop_assert_eq!(now, timing.cycles);
    for (cause, cycles) in timing.ledger.entries() {
        prop_assert_eq!(causes.get(&cause).copied().unwrap_or(0), cycles);
    }
    prop_assert_eq!((seen.lines, seen.missed), (timing.lookups, timing.misses));
    prop_assert_eq!(seen.fetched, timing.fetched_lines);
    prop_assert_eq!(seen.of(Stage::JobWait).len() as u64, timing.jobs);
    Ok(seen)
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(400) })]

    #[test]
    fn every_group_and_every_job_passes_every_stage_once_and_in_order(
        unit in unit(), asked in asked(3),
    ) {
        let seen = watched(&unit, &asked)?;
        seen.check_groups()?;
        seen.check_jobs()?;
        seen.check_levels(&unit, asked.demands.len() as u64)?;
    }

    #[test]
    fn jobs_of_one_material_leave_in_the_order_in_which_they_were_opened(
        unit in unit(), asked in asked(3),
    ) {
        let seen = watched(&unit, &asked)?;
        // A job shows its material by its number of layers, where those differ.
        let layers: Vec<usize> =
            materials(&asked.built).iter().map(|material| material.work().dense.len()).collect();
        let mut jobs: BTreeMap<u64, u32> = BTreeMap::new();
        for interval in seen.of(Stage::Dense) {
            let layers = jobs.entry(interval.number).or_default();
            *layers = (*layers).max((interval.part >> 8) + 1);
        }
        for (index, &own) in layers.iter().enumerate() {
            let is_alone = layers.iter().enumerate().all(|(other, &n)| other == index || n != own);
            if own == 0 || !is_alone {
                continue;
            }
            let left: Vec<u64> = seen
                .of(Stage::Output)
                .iter()
                .map(|interval| interval.number)
                .filter(|number| jobs.get(number).is_some_and(|&n| n as usize == own))
                .collect();
            prop_assert!(left.is_sorted(), "material {}: {:?}", index, left);
        }
    }
}
