//! The value change dump, read back with the parser of the crate `vcd`.
#![allow(
    clippy::wildcard_enum_match_arm,
    reason = "the parser's enums may grow, and what is not known fails"
)]

use crate::run::{Seen, run, units};
use ntmu::model::time::watch::{Signal, Stage};
use ntmu::model::time::{Cause, Unit};
use ntmu::timing::waves::{Summary, Vcd, VcdTime, Window};
use std::collections::BTreeMap;
use std::collections::HashMap;
use vcd::{Command, IdCode, Parser, ScopeItem, TimescaleUnit, Value};

/// A dump: each variable's value by time, and the last time.
struct Dump {
    timescale: (u32, TimescaleUnit),
    variables: HashMap<String, BTreeMap<u64, Shown>>,
    first: u64,
    last: u64,
}

#[derive(Clone, Debug, PartialEq, Eq)]
enum Shown {
    Number(Option<u64>),
    Text(String),
}

fn number(bits: impl IntoIterator<Item = Value>) -> Shown {
    let mut value = 0;
    for bit in bits {
        match bit {
            Value::V0 => value *= 2,
            Value::V1 => value = value * 2 + 1,
            Value::X => return Shown::Number(None),
            Value::Z => panic!("nothing is driven to z"),
        }
    }
    Shown::Number(Some(value))
}

fn names(items: &[ScopeItem], path: &str, into: &mut HashMap<IdCode, String>) {
    for item in items {
        match item {
            ScopeItem::Scope(scope) => {
                names(&scope.items, &format!("{path}{}.", scope.identifier), into);
            }
            ScopeItem::Var(var) => {
                let before = into.insert(var.code, format!("{path}{}", var.reference));
                assert_eq!(before, None);
            }
            ScopeItem::Comment(_) => {}
            other => panic!("{other:?}"),
        }
    }
}

fn read(bytes: &[u8]) -> Dump {
    let mut parser = Parser::new(bytes);
    let header = parser.parse_header().unwrap();
    let mut codes = HashMap::new();
    names(&header.items, "", &mut codes);
    let mut variables: HashMap<String, BTreeMap<u64, Shown>> = HashMap::new();
    let (mut first, mut now) = (None, None);
    for command in parser {
        let (code, value) = match command.unwrap() {
            Command::Timestamp(at) => {
                assert!(now.is_none_or(|now| now <= at), "time goes back to {at}");
                now = Some(at);
                first = first.or(now);
                continue;
            }
            Command::ChangeScalar(code, value) => (code, number([value])),
            Command::ChangeVector(code, value) => (code, number(&value)),
            Command::ChangeString(code, value) => (code, Shown::Text(value)),
            Command::Begin(_) | Command::End(_) => continue,
            other => panic!("{other:?}"),
        };
        let values = variables.entry(codes[&code].clone()).or_default();
        let before = values.last_key_value().map(|last| last.1);
        assert_ne!(before, Some(&value), "no change of {}", codes[&code]);
        values.insert(now.unwrap(), value);
    }
    assert_eq!(variables.len(), codes.len(), "each has a first value");
    Dump {
        timescale: header.timescale.unwrap(),
        variables,
        first: first.unwrap(),
        last: now.unwrap(),
    }
}

impl Dump {
    fn at(&self, name: &str, time: u64) -> &Shown {
        let values = &self.variables[name];
        values.range(..=time).next_back().unwrap().1
    }
}

fn dump(unit: &Unit, window: Window, time: VcdTime) -> (Dump, Summary) {
    let mut file = Vec::new();
    let mut vcd = Vcd::new(&mut file, unit, window, time);
    run(unit, &mut vcd);
    let summary = vcd.finish().unwrap();
    (read(&file), summary)
}

/// Every variable in every cycle of the dump.
fn check(dump: &Dump, summary: Summary, seen: &Seen, stamp: impl Fn(u64) -> u64) {
    assert_eq!(dump.first, stamp(summary.from));
    assert_eq!(dump.last, stamp(summary.to));
    let some = |value: u64| Shown::Number(Some(value));
    let cycles = summary.from..summary.to;
    for (cycle, cause) in seen.causes().into_iter().enumerate() {
        if cycles.contains(&(cycle as u64)) {
            let at = stamp(cycle as u64);
            let name = Shown::Text(cause.name().to_owned());
            assert_eq!(dump.at("unit.ledger.cause", at), &name);
            let code = Cause::ALL.iter().position(|&c| c == cause).unwrap();
            assert_eq!(dump.at("unit.ledger.cause_code", at), &some(code as u64));
        }
    }
    for signal in Signal::ALL {
        let name = format!("unit.signals.{}", signal.name());
        let values = seen.values(signal, summary.cycles);
        for cycle in cycles.clone() {
            let value = some(values[cycle as usize]);
            assert_eq!(dump.at(&name, stamp(cycle)), &value, "{name} {cycle}");
        }
    }
    for stage in Stage::ALL {
        let name = |what| format!("unit.{}.{what}", stage.name().replace('-', "_"));
        let held = seen.held(stage, summary.cycles);
        for cycle in cycles.clone() {
            let at = stamp(cycle);
            let first = held[cycle as usize].first();
            let busy = some(u64::from(first.is_some()));
            assert_eq!(dump.at(&name("busy"), at), &busy, "{stage:?} {cycle}");
            let number = Shown::Number(first.map(|first| first.number));
            assert_eq!(dump.at(&name("number"), at), &number, "{stage:?} {cycle}");
            if matches!(stage, Stage::Dense | Stage::Requantize) {
                let part = first.map(|first| u64::from(first.part));
                let layer = Shown::Number(part.map(|part| part / 256));
                let batch = Shown::Number(part.map(|part| part % 256));
                assert_eq!(dump.at(&name("layer"), at), &layer);
                assert_eq!(dump.at(&name("batch"), at), &batch);
            }
        }
    }
}

#[test]
fn every_wire_is_right_in_every_cycle() {
    for unit in units() {
        let (seen, timing) = Seen::of(&unit);
        let (dump, summary) = dump(&unit, Window::ALL, VcdTime::Cycles);
        assert_eq!((summary.from, summary.to), (0, timing.cycles));
        assert_eq!(dump.timescale, (1, TimescaleUnit::NS));
        check(&dump, summary, &seen, |cycle| cycle);
        // Behind the last cycle everything is idle.
        for stage in Stage::ALL {
            let name = format!("unit.{}.busy", stage.name().replace('-', "_"));
            assert_eq!(dump.at(&name, timing.cycles), &Shown::Number(Some(0)));
        }
    }
}

#[test]
fn seconds_are_those_of_the_clock() {
    for unit in units() {
        let (seen, _) = Seen::of(&unit);
        let (dump, summary) = dump(&unit, Window::ALL, VcdTime::Seconds);
        assert_eq!(dump.timescale, (1, TimescaleUnit::FS));
        let clock = u64::from(unit.clock_mhz);
        check(&dump, summary, &seen, |cycle| cycle * 1_000_000_000 / clock);
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
        let (dump, summary) = dump(&unit, window, VcdTime::Cycles);
        assert_eq!((summary.from, summary.to), (window.from, window.to));
        assert!(summary.left_out > 0);
        check(&dump, summary, &seen, |cycle| cycle);
    }
}

#[test]
fn a_window_behind_the_run_is_empty() {
    let unit = Unit::mobile();
    let window = Window {
        from: 1 << 40,
        to: 1 << 41,
    };
    let (dump, summary) = dump(&unit, window, VcdTime::Cycles);
    assert_eq!((summary.from, summary.to), (summary.cycles, summary.cycles));
    assert_eq!((dump.first, dump.last), (summary.cycles, summary.cycles));
}
