//! What a run shows is complete.

use crate::run::{Seen, run, units};
use ntmu::model::time::watch::{Signal, Stage};
use ntmu::timing::heat::MissMap;
use ntmu::timing::waves::{Konata, Perfetto, Ramulator, RamulatorFormat, Vcd, VcdTime, Window};
use std::io::sink;

#[test]
fn a_run_is_the_same_whoever_watches() {
    for unit in units() {
        let alone = run(&unit, &mut ());
        let all = Window::ALL;
        let mut watch = (
            (
                Vcd::new(sink(), &unit, all, VcdTime::Cycles),
                Perfetto::new(sink(), &unit, all),
            ),
            (
                Konata::new(sink(), &unit, all),
                (
                    Ramulator::new(sink(), &unit, all, RamulatorFormat::LoadStore, 64),
                    MissMap::default(),
                ),
            ),
        );
        assert_eq!(run(&unit, &mut watch), alone);
        let ((vcd, perfetto), (konata, (ramulator, _))) = watch;
        let cycles = [
            vcd.finish().unwrap(),
            perfetto.finish().unwrap(),
            konata.finish().unwrap(),
            ramulator.finish().unwrap(),
        ];
        assert_eq!(cycles.map(|summary| summary.cycles), [alone.cycles; 4]);
        assert_eq!(cycles.map(|summary| summary.left_out), [0; 4]);
    }
}

#[test]
fn charges_follow_each_other_and_levels_do_not_go_back() {
    for unit in units() {
        let (seen, timing) = Seen::of(&unit);
        let mut now = 0;
        for &(_, start, end) in &seen.charges {
            assert_eq!(start, now);
            now = end;
        }
        assert_eq!(now, timing.cycles);
        for signal in Signal::ALL {
            let levels = seen.levels.iter().filter(|level| level.0 == signal);
            assert!(levels.clone().is_sorted_by_key(|level| level.1));
            assert!(levels.clone().any(|level| level.2 > 0), "{signal:?}");
            // Nothing is left behind.
            let last = seen.values(signal, timing.cycles);
            assert_eq!(last.last(), Some(&0), "{signal:?}");
        }
    }
}

#[test]
fn intervals_lie_in_the_run_and_each_thing_is_in_a_stage_once() {
    for unit in units() {
        let (seen, timing) = Seen::of(&unit);
        let numbers = |stage: Stage| {
            let of = seen.intervals.iter().filter(|i| i.stage == stage);
            let mut numbers: Vec<_> = of.map(|i| (i.number, i.part)).collect();
            numbers.sort_unstable();
            numbers
        };
        for interval in &seen.intervals {
            assert!(interval.start <= interval.end, "{interval:?}");
            assert!(interval.end <= timing.cycles, "{interval:?}");
        }
        let groups: Vec<_> = (0..seen.lookups.len() as u64).map(|n| (n, 0)).collect();
        let jobs: Vec<_> = (0..timing.jobs).map(|n| (n, 0)).collect();
        for stage in Stage::ALL {
            match stage {
                Stage::WeightFill => {
                    let fills = numbers(stage).len() as u64;
                    assert_eq!(fills, timing.weight_fills);
                    assert!(fills >= 2, "the second material's come too");
                }
                Stage::Dense | Stage::Requantize => {
                    assert!(numbers(stage).is_sorted_by(|a, b| a < b));
                    assert_eq!(numbers(stage), numbers(Stage::Dense));
                }
                Stage::Request | Stage::Address | Stage::Lookup | Stage::Corners | Stage::Embed => {
                    assert_eq!(numbers(stage), groups)
                }
                Stage::JobWait | Stage::Filter | Stage::OutputWait | Stage::Output => {
                    assert_eq!(numbers(stage), jobs);
                }
            }
        }
    }
}

#[test]
fn the_corner_fifo_holds_what_is_in_it() {
    for unit in units() {
        let (seen, timing) = Seen::of(&unit);
        let values = seen.values(Signal::CornerFifo, timing.cycles);
        for (held, value) in seen.held(Stage::Corners, timing.cycles).iter().zip(values) {
            assert_eq!(held.len() as u64, value);
        }
    }
}

#[test]
fn a_job_goes_from_stage_to_stage_without_a_gap_behind_the_array() {
    for unit in units() {
        let (seen, _) = Seen::of(&unit);
        let find = |stage, number| {
            let mut intervals = seen.intervals.iter();
            let found = intervals.find(|i| i.stage == stage && i.number == number);
            *found.unwrap()
        };
        for output in seen.intervals.iter().filter(|i| i.stage == Stage::Output) {
            let wait = find(Stage::OutputWait, output.number);
            let filter = find(Stage::Filter, output.number);
            assert_eq!(wait.end, output.start);
            assert_eq!(filter.end, wait.start);
        }
    }
}
