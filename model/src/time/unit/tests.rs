//! Claims about units, their files and their brackets.

use super::*;
use std::collections::BTreeSet;

fn numbers() -> impl Iterator<Item = (&'static Field, u32, u32)> {
    FIELDS.iter().filter_map(|field| match field.range {
        Range::Number { low, high } => Some((field, low, high)),
        Range::Choice(_) => None,
    })
}

/// Why this file is no unit.
fn refused(text: &str) -> String {
    Unit::from_toml("x", text).unwrap_err().to_string()
}

/// Why `mobile` with these changes is no unit.
fn refused_change(changes: &[(&str, &str)]) -> String {
    Unit::mobile().with(changes).unwrap_err().to_string()
}

#[test]
fn every_number_is_set_by_name_and_refused_just_outside_its_range() {
    for (field, low, high) in numbers() {
        let (below, above) = (i64::from(low) - 1, i64::from(high) + 1);
        for found in [below, above, i64::MIN, i64::MAX] {
            let expected = UnitError::Range {
                field: field.name,
                found,
                low,
                high,
            };
            let text = found.to_string();
            let changed = Unit::mobile().with(&[(field.name, &text)]);
            assert_eq!(changed, Err(expected.clone()));
            let file = format!("base = \"mobile\"\n{} = {found}", field.name);
            assert_eq!(Unit::from_toml("x", &file), Err(expected.clone()));
            if let Ok(number) = u32::try_from(found) {
                let mut changed = *Unit::mobile().configuration();
                changed.set(field.name, number).unwrap();
                assert_eq!(Unit::new("x", changed), Err(expected));
            }
        }
    }
    let mut unit = *Unit::mobile().configuration();
    assert!(matches!(
        unit.set("mac_row", 1),
        Err(UnitError::Field { .. })
    ));
}

#[test]
fn fields_that_contradict_each_other_are_refused() {
    for (changes, expected) in [
        (
            &[("cache_sets", "3")][..],
            "unit.cache_sets: found 3; allowed: a power of two",
        ),
        (
            &[("level2_sets", "3")],
            "unit.level2_sets: found 3; allowed: a power of two",
        ),
        (
            &[("batch_texels", "6")],
            "unit.batch_texels: found 6; allowed: a multiple of 4, its coalesced_texels",
        ),
        (
            &[("decoded_cache_blocks", "6")],
            "unit.decoded_cache_blocks: found 6; allowed: a multiple of 4, its decoded_cache_ways",
        ),
        (
            &[("corner_fifo_texels", "3")],
            "unit.corner_fifo_texels: found 3; allowed: at least 4, one coalesced group",
        ),
        (
            &[("request_queue_texels", "3")],
            "unit.request_queue_texels: found 3; allowed: at least 4, one coalesced group",
        ),
        (
            &[("output_queue_pixels", "15")],
            "unit.output_queue_pixels: found 15; allowed: at least 16, one job",
        ),
        (
            &[("cache_sets", "1"), ("cache_banks", "2")],
            "unit.cache_banks: found 2; allowed: at most 1, its cache_sets, so that no bank is empty",
        ),
        (
            &[("level2_latency_cycles", "9")],
            "unit.level2_latency_cycles: found 9; allowed: at most 0, as level2_sets is 0",
        ),
        (
            &[("cache_ways", "3"), ("replacement", "tree-plru")],
            "unit.cache_ways: found 3; allowed: a power of two, as replacement is tree-plru",
        ),
        (
            &[
                ("level2_sets", "4"),
                ("level2_ways", "6"),
                ("replacement", "tree-plru"),
            ],
            "unit.level2_ways: found 6; allowed: a power of two, as replacement is tree-plru",
        ),
    ] {
        assert_eq!(refused_change(changes), expected);
    }
    assert!(Unit::mobile().with(&[("cache_ways", "3")]).is_ok());
}

#[test]
fn a_change_without_effect_is_refused() {
    for (changes, because) in [
        (&[("level2_ways", "8")][..], "level2_sets is 0"),
        (&[("level2_bytes_per_cycle", "8")], "level2_sets is 0"),
        (&[("decoded_cache_ways", "8")], "decoded_cache_blocks is 0"),
        (&[("decoded_block_side", "8")], "decoded_cache_blocks is 0"),
        (&[("cache", "none"), ("cache_ways", "8")], "cache is none"),
        (
            &[("cache", "infinite"), ("cache_sets", "8")],
            "cache is infinite",
        ),
        (
            &[("cache", "none"), ("replacement", "fifo")],
            "level2_sets is 0",
        ),
    ] {
        let (field, found) = changes[changes.len() - 1];
        let expected = format!(
            "unit.{field}: found {found}; allowed: no change, as {because} and so it has no effect"
        );
        assert_eq!(refused_change(changes), expected);
        let lines: Vec<String> = changes
            .iter()
            .map(|(key, value)| match value.parse::<u32>() {
                Ok(number) => format!("{key} = {number}\n"),
                Err(_) => format!("{key} = {value:?}\n"),
            })
            .collect();
        assert_eq!(
            refused(&format!("base = \"mobile\"\n{}", lines.concat())),
            expected
        );
    }
    let second = [("level2_sets", "64"), ("level2_ways", "8")];
    assert_eq!(
        Unit::mobile().with(&second).unwrap().level2_bytes(),
        32 * 1024
    );
}

#[test]
fn a_file_is_refused_with_where_found_and_allowed() {
    for (line, expected) in [
        (
            "mshr = 1",
            "unit field: found \"mshr\"; allowed: clock_mhz, ",
        ),
        (
            "mshrs = \"1\"",
            "unit.mshrs: found \"1\"; allowed: a whole number",
        ),
        (
            "mshrs = 1.0",
            "unit.mshrs: found 1.0; allowed: a whole number",
        ),
        (
            "mshrs = true",
            "unit.mshrs: found true; allowed: a whole number",
        ),
        ("mshrs = -1", "unit.mshrs: found -1; allowed: 1..=4096"),
        ("mshrs = 0", "unit.mshrs: found 0; allowed: 1..=4096"),
        (
            "mshrs = 4294967297",
            "unit.mshrs: found 4294967297; allowed: 1..=4096",
        ),
        ("mshrs = 99999999999999999999", "unit: no TOML: "),
        ("mshrs = 1\nmshrs = 1", "unit: no TOML: "),
        ("mshrs 1", "unit: no TOML: "),
        (
            "mshrs = { value = 1 }",
            "unit.mshrs: found no why; allowed: a value, or ",
        ),
        (
            "mshrs = { why = \"a\" }",
            "unit.mshrs: found no value; allowed: ",
        ),
        (
            "mshrs = { value = 1, why = \" \" }",
            "unit.mshrs: found why = \" \"; allowed: ",
        ),
        (
            "mshrs = { value = 1, why = 1 }",
            "unit.mshrs: found why = 1; allowed: ",
        ),
        (
            "mshrs = { value = 1, why = \"a\", by = 1 }",
            "unit.mshrs: found the key \"by\"; allowed: ",
        ),
        (
            "misses = \"hit\"",
            "unit.misses: found \"hit\"; allowed: hit-under-miss, blocking",
        ),
        ("misses = 1", "unit.misses: found 1; allowed: a text"),
        ("about = 1", "unit.about: found 1; allowed: a text"),
    ] {
        let found = refused(&format!("base = \"mobile\"\n{line}"));
        assert!(found.starts_with(expected), "{line}: {found}");
    }
    assert_eq!(
        refused("base = \"phone\""),
        "unit: found \"phone\"; allowed: mobile, console, desktop"
    );
    assert_eq!(refused("base = 1"), "unit.base: found 1; allowed: a text");
}

#[test]
fn a_file_without_a_base_has_every_field() {
    let whole = Unit::console().to_toml();
    for field in FIELDS {
        let mut table: toml::Table = whole.parse().unwrap();
        table.remove(field.name).unwrap();
        assert_eq!(
            refused(&table.to_string()),
            format!(
                "unit: found no {}; allowed: every field, or a base that has them",
                field.name
            )
        );
    }
    let preset = Unit::from_complete_toml("x", "base = \"mobile\"");
    assert!(matches!(
        preset,
        Err(UnitError::Entry { field: "base", .. })
    ));
}

#[test]
fn a_change_on_a_command_line_is_refused_like_one_in_a_file() {
    for (changes, expected) in [
        (
            &[("mshr", "1")][..],
            "unit field: found \"mshr\"; allowed: ",
        ),
        (&[("about", "a")], "unit field: found \"about\"; allowed: "),
        (
            &[("mshrs", "many")],
            "unit.mshrs: found \"many\"; allowed: a whole number",
        ),
        (
            &[("mshrs", "1"), ("mshrs", "1")],
            "unit.mshrs: found twice; allowed: once",
        ),
        (
            &[("wiring", "cables")],
            "unit.wiring: found \"cables\"; allowed: broadcast, systolic",
        ),
    ] {
        let found = refused_change(changes);
        assert!(found.starts_with(expected), "{found}");
    }
    let changed = Unit::mobile().with(&[("mshrs", "8"), ("wiring", "systolic")]);
    let changed = changed.unwrap();
    assert_eq!(changed.name(), "mobile, mshrs = 8, wiring = systolic");
    assert_eq!((changed.mshrs, changed.wiring.name()), (8, "systolic"));
    assert_eq!(Unit::mobile().with(&[]), Ok(Unit::mobile()));
}

#[test]
fn a_unit_is_the_same_after_a_round_trip_through_its_file() {
    let odd = Unit::from_toml(
        "odd",
        "about = 'a \"quoted\"\\line'\nbase = \"desktop\"\nmshrs = 9\n\
         wiring = { value = \"systolic\", why = \"tabs\\tand é\" }",
    );
    let bare = Unit::new("bare", *Unit::console().configuration());
    for unit in Unit::presets()
        .into_iter()
        .chain([odd.unwrap(), bare.unwrap()])
    {
        assert_eq!(Unit::from_toml(unit.name(), &unit.to_toml()), Ok(unit));
    }
}

#[test]
fn a_reason_stays_with_its_value() {
    let file = "base = \"mobile\"\nmshrs = 8\ncache_ways = 2\n\
                wiring = { value = \"systolic\", why = \"mine\" }";
    let unit = Unit::from_toml("x", file).unwrap();
    let of = |name: &str| unit.reasons().get(name).map(String::as_str);
    assert_eq!(of("mshrs"), None);
    assert_eq!(of("wiring"), Some("mine"));
    let base = Unit::mobile();
    assert_eq!(of("cache_ways"), Some(&*base.reasons()["cache_ways"]));
    let ideal = base.with_ideal_memory();
    assert!(!ideal.reasons().contains_key("memory_latency_cycles"));
    assert_eq!(ideal.reasons()["mac_rows"], base.reasons()["mac_rows"]);
}

#[test]
fn the_hash_changes_with_every_field_and_with_nothing_else() {
    let base = Unit::desktop();
    let mut hashes = BTreeSet::from([base.hash()]);
    for field in FIELDS {
        let mut changed = *base.configuration();
        match (field.range, base.configuration().value(field).unwrap()) {
            (Range::Number { low, high }, Value::Number(value)) => {
                let other = if value == high { low } else { value + 1 };
                changed.set(field.name, other).unwrap();
            }
            (Range::Choice(names), Value::Choice(value)) => {
                let other = names.iter().find(|name| **name != value).unwrap();
                changed.choose(field.name, other).unwrap();
            }
            (Range::Number { .. } | Range::Choice(_), _) => unreachable!(),
        }
        let changed = Unit {
            configuration: changed,
            ..base.clone()
        };
        assert!(hashes.insert(changed.hash()), "{}", field.name);
    }
    let other = Unit::new("other", *base.configuration()).unwrap();
    assert_eq!(other.hash(), base.hash());
    assert_eq!(base.identity(), format!("desktop@{}", base.hash()));
    assert_eq!(base.hash().len(), 12);
    let plain = Unit::from_toml("x", "base = \"desktop\"").unwrap();
    assert_eq!(plain.hash(), base.hash());
}

#[test]
fn every_bracket_is_itself_a_unit() {
    for unit in Unit::presets() {
        for bracket in [
            unit.with_ideal_memory(),
            unit.with_unbounded_queues(),
            unit.without_cache(),
            unit.with_infinite_cache(),
            unit.with_ideal_memory().with_unbounded_queues(),
        ] {
            let again = Unit::from_toml(bracket.name(), &bracket.to_toml());
            assert_eq!(again, Ok(bracket));
        }
        assert_eq!(unit.without_cache().level2_bytes(), 0);
        assert_eq!(unit.with_infinite_cache().cache.name(), "infinite");
    }
}

#[test]
fn nothing_outside_an_ideal_memory_is_waited_for() {
    use ntmu_isa::limits::{MAX_LANES, MAX_LAYERS};
    let lanes = u64::from(MAX_LANES);
    // Halves are the widest weights; a table and the wide rows of bytes are less.
    let largest = u64::from(MAX_LAYERS) * (lanes * lanes + lanes) * 2;
    for unit in Unit::presets() {
        let ideal = unit.with_ideal_memory();
        assert!(u64::from(ideal.weight_sram_bytes) >= largest);
        assert_eq!(ideal.misses.name(), "hit-under-miss");
        let latencies = [
            ideal.hit_latency_cycles,
            ideal.level2_sets,
            ideal.level2_latency_cycles,
            ideal.memory_latency_cycles,
            ideal.weight_latency_cycles,
        ];
        assert_eq!(latencies, [0; 5]);
        let rates = [
            ideal.memory_bytes_per_cycle,
            ideal.weight_fill_bytes_per_cycle,
            ideal.lookups_per_bank,
            ideal.mshrs,
        ];
        assert_eq!(rates, [1 << 20, 1 << 20, 1 << 12, 1 << 12]);
        let endless = unit.with_unbounded_queues();
        let queues = [
            endless.request_queue_texels,
            endless.corner_fifo_texels,
            endless.output_queue_pixels,
        ];
        assert_eq!(queues, [1 << 16, 1 << 20, 1 << 20]);
    }
}

#[test]
fn no_file_of_the_folder_is_left_out() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../units");
    let files: BTreeSet<String> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| name.ends_with(".toml"))
        .collect();
    let tables = crate::time::energy::EnergyTable::names();
    let named = Unit::names().iter().chain(tables);
    let named: BTreeSet<String> = named.map(|name| format!("{name}.toml")).collect();
    assert_eq!(files, named);
}
