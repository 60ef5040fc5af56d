//! The trace events, read back as JSON.

use crate::run::{Seen, run, units};
use ntmu::model::time::Unit;
use ntmu::model::time::watch::{Interval, Signal, Stage};
use ntmu::timing::waves::{Perfetto, Summary, Window};
use serde_json::Value;
use std::collections::HashMap;

fn trace(unit: &Unit, window: Window) -> (Value, Summary) {
    let mut file = Vec::new();
    let mut perfetto = Perfetto::new(&mut file, unit, window);
    run(unit, &mut perfetto);
    let summary = perfetto.finish().unwrap();
    (serde_json::from_slice(&file).unwrap(), summary)
}

fn events<'t>(trace: &'t Value, ph: &'t str) -> impl Iterator<Item = &'t Value> {
    let events = trace["traceEvents"].as_array().unwrap();
    events.iter().filter(move |event| event["ph"] == ph)
}

fn range(event: &Value) -> (u64, u64) {
    let start = event["ts"].as_u64().unwrap();
    (start, start + event["dur"].as_u64().unwrap())
}

/// What the window shows of the intervals, as numbers that can be sorted.
fn cut(intervals: &[Interval], summary: Summary) -> Vec<(Stage, u64, u32, u64, u64)> {
    let mut cut: Vec<_> = intervals
        .iter()
        .map(|i| {
            let (start, end) = (i.start.max(summary.from), i.end.min(summary.to));
            (i.stage, i.number, i.part, start, end)
        })
        .filter(|interval| interval.3 < interval.4)
        .collect();
    cut.sort_unstable();
    cut
}

fn check(trace: &Value, summary: Summary, seen: &Seen) {
    let names: HashMap<u64, &str> = events(trace, "M")
        .filter(|event| event["name"] == "thread_name")
        .map(|event| {
            let name = event["args"]["name"].as_str().unwrap();
            (event["tid"].as_u64().unwrap(), name)
        })
        .collect();
    let mut tracks: HashMap<u64, Vec<(u64, u64)>> = HashMap::new();
    let mut found = Vec::new();
    let causes = seen.causes();
    for event in events(trace, "X") {
        let (start, end) = range(event);
        assert!(summary.from <= start && start < end && end <= summary.to);
        let tid = event["tid"].as_u64().unwrap();
        assert!(tid <= u64::from(u32::MAX >> 1));
        tracks.entry(tid).or_default().push((start, end));
        let track = names[&tid].split(" +").next().unwrap();
        if track == "ledger" {
            for cycle in start..end {
                assert_eq!(event["name"], causes[cycle as usize].name());
            }
            continue;
        }
        let stage = *Stage::ALL.iter().find(|s| s.name() == track).unwrap();
        assert_eq!(event["cat"], stage.name());
        let args = &event["args"];
        let part = |name: &str| args[name].as_u64().unwrap_or(0) as u32;
        let part = part("layer") << 8 | part("batch");
        found.push((stage, args["number"].as_u64().unwrap(), part, start, end));
    }
    found.sort_unstable();
    assert_eq!(found, cut(&seen.intervals, summary));
    for (tid, mut ranges) in tracks {
        ranges.sort_unstable();
        let track = names[&tid];
        assert!(ranges.windows(2).all(|w| w[0].1 <= w[1].0), "{track}");
        if track == "ledger" {
            assert!(ranges.windows(2).all(|w| w[0].1 == w[1].0));
            let (first, last) = (ranges[0].0, ranges[ranges.len() - 1].1);
            assert_eq!((first, last), (summary.from, summary.to));
        }
    }
    for signal in Signal::ALL {
        let mut values = vec![None; summary.cycles as usize + 1];
        let mut last = None;
        for event in events(trace, "C").filter(|event| event["name"] == signal.name()) {
            let at = event["ts"].as_u64().unwrap();
            assert!(last.is_none_or(|last| last < at), "once in a cycle");
            last = Some(at);
            let value = event["args"]["value"].as_u64();
            values[at as usize..].fill(value);
        }
        let expected = seen.values(signal, summary.cycles);
        for cycle in summary.from..summary.to {
            let cycle = cycle as usize;
            assert_eq!(values[cycle], Some(expected[cycle]), "{signal:?} {cycle}");
        }
    }
}

#[test]
fn every_interval_cause_and_level_is_there_and_tracks_do_not_overlap() {
    for unit in units() {
        let (seen, timing) = Seen::of(&unit);
        let (trace, summary) = trace(&unit, Window::ALL);
        assert_eq!((summary.from, summary.to), (0, timing.cycles));
        assert_eq!(trace["otherData"]["unit"], unit.identity());
        assert_eq!(trace["otherData"]["cycles"], timing.cycles);
        check(&trace, summary, &seen);
    }
}

#[test]
fn a_window_shows_the_same_in_its_cycles() {
    for unit in units() {
        let (seen, timing) = Seen::of(&unit);
        let window = Window {
            from: timing.cycles / 3,
            to: timing.cycles / 2,
        };
        let (trace, summary) = trace(&unit, window);
        assert!(summary.left_out > 0);
        check(&trace, summary, &seen);
    }
}

#[test]
fn a_stage_has_as_many_tracks_as_things_at_once() {
    for unit in units() {
        let (seen, timing) = Seen::of(&unit);
        let (trace, _) = trace(&unit, Window::ALL);
        for stage in Stage::ALL {
            let most = seen.held(stage, timing.cycles).iter().map(Vec::len).max();
            let named = events(&trace, "M").filter(|event| {
                let name = event["args"]["name"].as_str().unwrap_or("");
                event["name"] == "thread_name" && name.split(" +").next().unwrap() == stage.name()
            });
            assert_eq!(named.count(), most.unwrap().max(1), "{stage:?}");
        }
    }
}
