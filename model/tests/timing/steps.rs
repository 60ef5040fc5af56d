//! A run takes effort in proportion to what is asked, and memory that does not grow with it.
#![allow(
    unsafe_code,
    reason = "an allocator is unsafe to implement; this one hands everything on"
)]

use crate::any::{Asked, asked, unit};
use crate::fixture::{Recipe, Sketch, materials};
use ntmu_isa::layout::Layout;
use ntmu_model::time::watch::{Interval, Stage};
use ntmu_model::time::{Cause, Unit, Watch, simulate};
use ntmu_model::{Demand, Demands, Place, Request};
use proptest::prelude::*;
use std::alloc::{GlobalAlloc, System};
use std::cell::Cell;
use std::convert::Infallible;

/// Counts what its thread holds: tests run side by side.
struct Counting;

thread_local! {
    static HELD: Cell<isize> = const { Cell::new(0) };
    static MOST: Cell<isize> = const { Cell::new(0) };
}

/// Adds to what the thread holds.
fn hold(bytes: isize) {
    HELD.with(|held| {
        held.set(held.get() + bytes);
        MOST.with(|most| most.set(most.get().max(held.get())));
    });
}

// SAFETY: every call goes to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: std::alloc::Layout) -> *mut u8 {
        hold(layout.size() as isize);
        // SAFETY: the caller's promise is handed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: std::alloc::Layout) {
        hold(-(layout.size() as isize));
        // SAFETY: the caller's promise is handed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// So many pixels of a few texels over and over, made without allocating.
struct Round<'p> {
    places: &'p [Place],
    next: u64,
    count: u64,
}

impl Demands for Round<'_> {
    type Error = Infallible;

    fn advance(&mut self, demand: &mut Demand) -> Result<bool, Infallible> {
        if self.next == self.count {
            return Ok(false);
        }
        let at = self.next as usize % self.places.len();
        demand.pixel = [2 * (self.next % 4096) as u32, 0];
        demand.material = 0;
        demand.places.clear();
        demand
            .places
            .extend([self.places[at], self.places[(at + 1) % self.places.len()]]);
        demand.weights = 2;
        self.next += 1;
        Ok(true)
    }
}

/// The most bytes that a run of so many pixels holds beside its materials.
fn most_held(unit: &Unit, count: u64) -> isize {
    let built = [Recipe::Neural(Sketch::plain(64, [4, 4], &[8]), Layout::TILED).build()];
    let materials = materials(&built);
    let shape = built[0].shape();
    let texels = (0..64).flat_map(|y| (0..64).map(move |x| (x, y)));
    let places: Vec<Place> = texels
        .map(|(x, y)| Place::of(Request::new(shape, x, y, 0).unwrap()))
        .collect();
    let mut demands = Round {
        places: &places,
        next: 0,
        count,
    };
    let before = HELD.get();
    MOST.set(before);
    let timing = simulate(unit, &materials, &mut demands, &mut ()).unwrap();
    assert_eq!(timing.pixels, count);
    MOST.get() - before
}

#[test]
fn a_hundred_times_the_pixels_hold_no_more_than_the_times_of_their_jobs() {
    let unit = Unit::desktop();
    let (few, many) = (most_held(&unit, 10_000), most_held(&unit, 1_000_000));
    // Kept are the times of up to 2^17 jobs, 8 bytes each, in a ring that doubles: while it moves,
    // it is there twice, 1 + 2 MiB at the end. Beside it the sizes of jobs that occurred, few.
    assert!(few > 0 && many - few < 4 << 20, "{few} bytes, then {many}");
}

#[test]
fn pixels_beyond_the_times_that_are_kept_hold_nothing_more() {
    // Two decodes a job, so that 2^18 pixels are 2^18 jobs.
    let changes = [
        ("coalesced_texels", 1),
        ("batch_texels", 2),
        ("batches_in_flight", 1),
    ];
    let unit = crate::any::changed(&Unit::mobile(), &changes);
    let most = [1 << 18, 1 << 20].map(|count| most_held(&unit, count));
    assert_eq!(most[0], most[1]);
}

/// Moments at which a run stops, and what passes its stages.
#[derive(Default)]
struct Steps {
    charges: u64,
    groups: u64,
    jobs: u64,
    layers: u64,
}

impl Watch for Steps {
    fn interval(&mut self, interval: Interval) {
        match interval.stage {
            Stage::Embed => self.groups += 1,
            Stage::JobWait => self.jobs += 1,
            Stage::Dense => self.layers += 1,
            Stage::Request
            | Stage::Address
            | Stage::Lookup
            | Stage::Corners
            | Stage::WeightFill
            | Stage::Requantize
            | Stage::Filter
            | Stage::OutputWait
            | Stage::Output => {}
        }
    }

    fn charge(&mut self, _cause: Cause, _start: u64, _end: u64) {
        self.charges += 1;
    }
}

fn steps(unit: &Unit, asked: &Asked) -> Result<(), TestCaseError> {
    let mut steps = Steps::default();
    let materials = materials(&asked.built);
    let mut demands = asked.demands.iter().cloned();
    let timing = simulate(unit, &materials, &mut demands, &mut steps).unwrap();
    let fetches = materials
        .iter()
        .map(|m| u64::from(m.work().fetches))
        .max()
        .unwrap_or(0);
    let rows = materials.iter().flat_map(|m| &m.work().dense);
    let rows = rows
        .map(|dense| u64::from(dense.outputs.div_ceil(unit.mac_rows)))
        .max();
    // Time stops where something may change. A group: the ends of its requests and positions, two
    // moments of each fetch, three of its corners, the end of embedding, and of the wait for every
    // line there. A layer of a batch: four ends of each row of tiles, three of its tail. A job: its
    // weights, filter and output, and when a group opens it. One more: the first weights.
    let group = 2 + 2 * fetches.max(1) + 3 + 1 + 1;
    let layer = 4 * rows.unwrap_or(0) + 3;
    let most = steps.groups * group + timing.misses + steps.layers * layer + 4 * steps.jobs + 1;
    prop_assert!(
        steps.charges <= most,
        "{} steps, at most {}",
        steps.charges,
        most
    );
    prop_assert!(steps.groups <= timing.decodes + timing.pixels);
    prop_assert!(steps.jobs <= steps.groups);
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(300) })]

    #[test]
    fn the_clock_stops_a_bounded_number_of_times_for_each_group_line_layer_and_job(
        unit in unit(), asked in asked(3),
    ) {
        steps(&unit, &asked)?;
    }
}
