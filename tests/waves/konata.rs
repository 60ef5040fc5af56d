//! The pipeline log, read back by the rules of the format.

use crate::run::{Seen, run, units};
use ntmu::model::time::Unit;
use ntmu::model::time::watch::{Interval, Stage};
use ntmu::timing::waves::{Konata, Summary, Window};
use std::collections::{BTreeMap, HashMap};

fn log(unit: &Unit, window: Window) -> (String, Summary) {
    let mut file = Vec::new();
    let mut konata = Konata::new(&mut file, unit, window);
    run(unit, &mut konata);
    let summary = konata.finish().unwrap();
    (String::from_utf8(file).unwrap(), summary)
}

#[derive(Debug, Default)]
struct Row {
    label: String,
    thread: u64,
    begun: u64,
    retired: Option<u64>,
    /// The stage that is open in each lane, and since when.
    open: HashMap<u64, (String, u64)>,
    stages: Vec<(String, u64, u64)>,
}

/// The rows by number, and the last cycle.
fn read(log: &str, from: u64) -> (BTreeMap<u64, Row>, u64) {
    let mut lines = log.lines();
    assert_eq!(lines.next(), Some("Kanata\t0004"));
    assert_eq!(lines.next(), Some(format!("C=\t{from}").as_str()));
    let mut now = from;
    let mut rows: BTreeMap<u64, Row> = BTreeMap::new();
    let mut retired = 0;
    for line in lines {
        let fields: Vec<&str> = line.split('\t').collect();
        let number = |index: usize| fields[index].parse::<u64>().unwrap();
        let id = number(1);
        match fields[0] {
            "C" => {
                assert!(id > 0, "cycles only go forward");
                now += id;
            }
            "I" => {
                assert_eq!(id, rows.len() as u64, "numbers follow each other");
                let row = Row {
                    thread: number(3),
                    begun: now,
                    ..Row::default()
                };
                assert!(rows.insert(id, row).is_none());
            }
            command => {
                let row = rows.get_mut(&id).unwrap();
                assert_eq!(row.retired, None, "nothing comes behind R");
                match command {
                    "L" if fields[2] == "0" => row.label += fields[3],
                    "L" => assert_eq!(fields[2], "1"),
                    "S" => {
                        let stage = (fields[3].to_owned(), now);
                        let before = row.open.insert(number(2), stage);
                        assert_eq!(before, None, "a lane holds one stage: {line}");
                    }
                    "E" => {
                        let (stage, start) = row.open.remove(&number(2)).unwrap();
                        assert_eq!(stage, fields[3]);
                        row.stages.push((stage, start, now));
                    }
                    "R" => {
                        assert!(row.open.is_empty());
                        assert_eq!((number(2), number(3)), (retired, 0));
                        retired += 1;
                        row.retired = Some(now);
                    }
                    other => panic!("{other}"),
                }
            }
        }
    }
    (rows, now)
}

fn expected(intervals: &[Interval], summary: Summary) -> BTreeMap<String, Vec<(String, u64, u64)>> {
    let mut rows: BTreeMap<String, Vec<_>> = BTreeMap::new();
    for i in intervals {
        let (start, end) = (i.start.max(summary.from), i.end.min(summary.to));
        if start >= end {
            continue;
        }
        let name = match i.stage {
            Stage::Request => "Rq",
            Stage::Address => "Ad",
            Stage::Lookup => "Lk",
            Stage::Corners => "Co",
            Stage::Embed => "Em",
            Stage::WeightFill => "Wf",
            Stage::JobWait => "Jw",
            Stage::Dense => "De",
            Stage::Requantize => "Rz",
            Stage::Filter => "Fi",
            Stage::OutputWait => "Ow",
            Stage::Output => "Ou",
        };
        let label = match i.stage {
            Stage::Dense | Stage::Requantize => {
                let (layer, batch) = (i.part / 256, i.part % 256);
                format!("job {} layer {layer} batch {batch}", i.number)
            }
            Stage::Request | Stage::Address | Stage::Lookup | Stage::Corners | Stage::Embed => {
                format!("group {}", i.number)
            }
            Stage::WeightFill
            | Stage::JobWait
            | Stage::Filter
            | Stage::OutputWait
            | Stage::Output => format!("job {}", i.number),
        };
        let stages = rows.entry(label).or_default();
        stages.push((name.to_owned(), start, end));
    }
    for stages in rows.values_mut() {
        stages.sort_unstable();
    }
    rows
}

fn check(unit: &Unit, window: Window) -> Summary {
    let (seen, _) = Seen::of(unit);
    let (log, summary) = log(unit, window);
    let (rows, last) = read(&log, summary.from);
    assert_eq!(last, summary.to);
    let mut expected = expected(&seen.intervals, summary);
    for row in rows.into_values() {
        let mut stages = expected.remove(&row.label).unwrap();
        let first = stages.iter().map(|stage| stage.1).min();
        let end = stages.iter().map(|stage| stage.2).max();
        assert_eq!((Some(row.begun), row.retired), (first, end));
        let thread = match row.label.split(' ').collect::<Vec<_>>()[..] {
            ["group", _] => 0,
            ["job", _] => 1,
            _ => 2,
        };
        assert_eq!(row.thread, thread);
        let mut found = row.stages;
        found.sort_unstable();
        stages.sort_unstable();
        assert_eq!(found, stages);
    }
    assert!(expected.is_empty(), "{expected:?}");
    summary
}

#[test]
fn every_row_has_its_stages_and_retires_behind_the_last() {
    for unit in units() {
        let summary = check(&unit, Window::ALL);
        assert_eq!((summary.from, summary.to), (0, summary.cycles));
    }
}

#[test]
fn a_window_shows_the_same_in_its_cycles() {
    for unit in units() {
        let (_, timing) = Seen::of(&unit);
        let window = Window {
            from: timing.cycles / 3,
            to: timing.cycles / 2,
        };
        let summary = check(&unit, window);
        assert_eq!((summary.from, summary.to), (window.from, window.to));
    }
}
