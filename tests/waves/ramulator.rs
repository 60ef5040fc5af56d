//! The memory trace.

use crate::run::{Seen, run, units};
use ntmu::model::time::Unit;
use ntmu::timing::waves::{Ramulator, RamulatorFormat, Summary, Window};

fn trace(
    unit: &Unit,
    window: Window,
    format: RamulatorFormat,
    access_bytes: u32,
) -> (Vec<[String; 2]>, Summary) {
    let mut file = Vec::new();
    let mut ramulator = Ramulator::new(&mut file, unit, window, format, access_bytes);
    run(unit, &mut ramulator);
    let summary = ramulator.finish().unwrap();
    let text = String::from_utf8(file).unwrap();
    let lines = text.lines().map(|line| {
        let (first, second) = line.split_once(' ').unwrap();
        [first.to_owned(), second.to_owned()]
    });
    (lines.collect(), summary)
}

#[test]
fn loads_are_the_lines_asked_of_memory_in_order() {
    for unit in units() {
        let (seen, timing) = Seen::of(&unit);
        let load_store = RamulatorFormat::LoadStore;
        let (lines, summary) = trace(&unit, Window::ALL, load_store, unit.line_bytes);
        assert_eq!(lines.len() as u64, timing.fetched_lines);
        assert_eq!(summary.shown, timing.fetched_lines);
        for ([operation, address], (_, expected)) in lines.iter().zip(&seen.misses) {
            assert_eq!(operation, "LD");
            let digits = address.strip_prefix("0x").unwrap();
            assert_eq!(u64::from_str_radix(digits, 16), Ok(*expected));
        }
    }
}

#[test]
fn a_line_is_as_many_accesses_as_it_holds() {
    for unit in units() {
        let (seen, _) = Seen::of(&unit);
        let access = unit.line_bytes / 4;
        let (lines, _) = trace(&unit, Window::ALL, RamulatorFormat::LoadStore, access);
        let parts = |&(_, address): &(u64, u64)| {
            (0..4).map(move |part| format!("{:#x}", address + part * u64::from(access)))
        };
        let expected: Vec<String> = seen.misses.iter().flat_map(parts).collect();
        let found: Vec<String> = lines.into_iter().map(|[_, address]| address).collect();
        assert_eq!(found, expected);
    }
}

#[test]
fn instructions_bring_each_access_to_its_cycle_or_right_behind_the_one_before() {
    for unit in units() {
        let (seen, timing) = Seen::of(&unit);
        let window = Window {
            from: timing.cycles / 4,
            to: timing.cycles / 2,
        };
        let format = RamulatorFormat::Instructions;
        let (lines, _) = trace(&unit, window, format, unit.line_bytes);
        let mut misses = seen.misses.clone();
        misses.retain(|&(at, _)| window.from <= at && at < window.to);
        assert_eq!(lines.len(), misses.len());
        // An instruction a cycle: bubbles, then the access.
        let mut now = window.from;
        for ([bubbles, address], (at, expected)) in lines.into_iter().zip(misses) {
            let issued = now + bubbles.parse::<u64>().unwrap();
            assert_eq!(issued, at.max(now));
            assert_eq!(address.parse(), Ok(expected));
            now = issued + 1;
        }
    }
}
