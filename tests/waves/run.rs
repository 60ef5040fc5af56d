//! The run that all of the tests watch.

use ntmu::isa::layout::Layout;
use ntmu::isa::{Asset, Program};
use ntmu::model::time::watch::{Interval, Signal, Stage, Watch};
use ntmu::model::time::{self, Cause, Timing, Unit};
use ntmu::model::{Demand, Material, Place, Request};

/// Texels of the run.
const TEXELS: usize = 480;

/// Units that differ in what overlaps: one that waits for memory, one with many groups under way
/// and two jobs gathered at once, one that has nothing to spare.
pub(crate) fn units() -> [Unit; 3] {
    let changed = |unit: Unit, changes: &[(&str, &str)]| unit.with(changes).unwrap();
    [
        Unit::mobile(),
        changed(
            Unit::desktop(),
            &[("material_bins", "2"), ("weight_sram_bytes", "4096")],
        ),
        changed(
            Unit::mobile(),
            &[
                ("mshrs", "1"),
                ("misses", "blocking"),
                ("corner_fifo_texels", "4"),
                ("coalesced_texels", "1"),
                ("output_channels_per_cycle", "1"),
                ("output_queue_pixels", "64"),
                ("clock_mhz", "850"),
            ],
        ),
    ]
}

/// Runs a unit on texels of two materials, both the built-in asset, in stretches of 24.
pub(crate) fn run(unit: &Unit, watch: &mut impl Watch) -> Timing {
    let asset: Asset = ntmu::built_in::asset().unwrap();
    let program = Program::compile(&asset, Layout::TILED);
    let materials = ["one", "two"].map(|name| Material::new(name, &asset, &program));
    let texels = Request::blocks(&asset.shape, 0).take(TEXELS);
    let mut demands = texels.enumerate().map(|(index, request)| Demand {
        pixel: [request.x(), request.y()],
        material: (index / 24 % 2) as u16,
        places: vec![Place::of(request)],
        weights: 1,
    });
    time::simulate(unit, &materials, &mut demands, watch).unwrap_or_else(|never| match never {})
}

/// Everything that a run shows.
#[derive(Clone, Debug, Default)]
pub(crate) struct Seen {
    pub(crate) intervals: Vec<Interval>,
    pub(crate) charges: Vec<(Cause, u64, u64)>,
    pub(crate) levels: Vec<(Signal, u64, u64)>,
    pub(crate) lookups: Vec<([u32; 2], u32, u32)>,
    pub(crate) misses: Vec<(u64, u64)>,
}

impl Watch for Seen {
    fn interval(&mut self, interval: Interval) {
        self.intervals.push(interval);
    }

    fn charge(&mut self, cause: Cause, start: u64, end: u64) {
        self.charges.push((cause, start, end));
    }

    fn level(&mut self, signal: Signal, at: u64, value: u64) {
        self.levels.push((signal, at, value));
    }

    fn lookup(&mut self, pixel: [u32; 2], lines: u32, misses: u32) {
        self.lookups.push((pixel, lines, misses));
    }

    fn miss(&mut self, at: u64, address: u64) {
        self.misses.push((at, address));
    }
}

impl Seen {
    /// What a run of the unit shows.
    pub(crate) fn of(unit: &Unit) -> (Seen, Timing) {
        let mut seen = Seen::default();
        let timing = run(unit, &mut seen);
        (seen, timing)
    }

    /// The cause of each cycle.
    pub(crate) fn causes(&self) -> Vec<Cause> {
        let cycles = |&(cause, start, end): &(Cause, u64, u64)| {
            std::iter::repeat_n(cause, (end - start) as usize)
        };
        self.charges.iter().flat_map(cycles).collect()
    }

    /// A signal's value in each cycle, and behind the last.
    pub(crate) fn values(&self, signal: Signal, cycles: u64) -> Vec<u64> {
        let mut values = vec![0; cycles as usize + 1];
        for &(_, at, value) in self.levels.iter().filter(|level| level.0 == signal) {
            values[at as usize..].fill(value);
        }
        values
    }

    /// What is in a stage in each cycle, the one that has been there longest first.
    pub(crate) fn held(&self, stage: Stage, cycles: u64) -> Vec<Vec<Interval>> {
        let mut held = vec![Vec::new(); cycles as usize];
        let mut intervals: Vec<Interval> = self.intervals.clone();
        intervals.retain(|interval| interval.stage == stage);
        intervals.sort_by_key(|interval| (interval.start, interval.number, interval.part));
        for interval in intervals {
            for cycle in interval.start..interval.end {
                held[cycle as usize].push(interval);
            }
        }
        held
    }
}
