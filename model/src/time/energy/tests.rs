//! Claims about tables of energies and what is made of them.

use super::*;
use crate::time::Unit;

const WHOLE: &str = include_str!("../../../../units/energy.toml");

fn table() -> EnergyTable {
    EnergyTable::by_name("energy").unwrap()
}

/// The price of one operation on a unit.
fn price(operation: Operation, unit: &Unit) -> f64 {
    let energy = table().of(&Operations::ONE_OF_EACH, unit);
    let mut levels = energy.levels.into_iter();
    let level = levels.find(|level| level.operation == operation);
    level.unwrap().picojoules_each
}

#[test]
fn every_built_in_table_is_read_and_gives_every_price_a_source() {
    for name in EnergyTable::names() {
        let table = EnergyTable::by_name(name).unwrap();
        assert_eq!(table.name(), *name);
        assert!(!table.about().is_empty());
        assert!(table.prices().iter().all(|(_, _, why)| why.len() > 8));
    }
    assert_eq!(
        EnergyTable::by_name("5nm").unwrap_err().to_string(),
        "energy table: found \"5nm\"; allowed: energy, energy-7nm"
    );
}

#[test]
fn the_default_table_has_the_published_figures() {
    let found: Vec<f64> = table().prices().into_iter().map(|(_, p, _)| p).collect();
    assert_eq!(
        found,
        [
            0.2, 0.1, 3.1, 1.1, 0.03, 0.1, 0.9, 2.0, 1300.0, 10.0, 20.0, 100.0
        ]
    );
}

#[test]
fn a_table_is_refused_with_where_found_and_allowed() {
    let refused = |from: &str, to: &str| {
        assert!(WHOLE.contains(from), "{from}");
        let text = WHOLE.replacen(from, to, 1);
        EnergyTable::from_toml("x", &text).unwrap_err().to_string()
    };
    let range = "allowed: above 0, at most 1000000";
    for found in ["0", "-0.2", "nan", "inf", "1e7"] {
        let message = refused("{ picojoules = 0.2", &format!("{{ picojoules = {found}"));
        assert!(
            message.starts_with("energy.int8_multiply.picojoules: found "),
            "{message}"
        );
        assert!(message.ends_with(range), "{message}");
    }
    assert!(refused("int8_multiply = ", "int7_multiply = ").contains("unknown field `int7"));
    assert!(refused("{ picojoules = 0.2", "{ watts = 1, picojoules = 0.2").contains("watts"));
    assert!(refused("{ picojoules = 0.2", "{ picojoules = \"0.2\"").contains("string"));
    assert!(refused("picojoules = 0.2, ", "").contains("missing field `picojoules`"));
    let order = "found out of order; allowed: at least one, larger ones later and not cheaper";
    assert_eq!(
        refused("bytes = 32_768", "bytes = 8192"),
        format!("energy.sram[1]: {order}")
    );
    assert_eq!(
        refused("picojoules = 20.0", "picojoules = 101"),
        format!("energy.sram[2]: {order}")
    );
    assert_eq!(
        refused("bytes = 8_192", "bytes = 0"),
        format!("energy.sram[0]: {order}")
    );
    let source = WHOLE.split("source = \"").nth(1).unwrap();
    let source = &source[..source.find('"').unwrap()];
    assert_eq!(
        refused(source, " "),
        "energy.int8_multiply.source: found none; allowed: a text"
    );
}

#[test]
fn every_entry_of_a_table_moves_some_operation_and_its_identity() {
    let unit = Unit::desktop();
    let before = table().of(&Operations::ONE_OF_EACH, &unit);
    for (index, (name, picojoules, _)) in table().prices().into_iter().enumerate() {
        let mut dearer: toml::Table = WHOLE.parse().unwrap();
        let entry = match index.checked_sub(9) {
            None => &mut dearer[&name],
            Some(sram) => &mut dearer["sram"][sram],
        };
        entry["picojoules"] = toml::Value::Float(picojoules * 1.5);
        let dearer = EnergyTable::from_toml("energy", &dearer.to_string()).unwrap();
        let after = dearer.of(&Operations::ONE_OF_EACH, &unit);
        assert!(after.picojoules > before.picojoules, "{name}");
        assert_ne!(after.table, before.table, "{name}");
    }
}

#[test]
fn the_energy_is_the_sum_of_counts_times_prices() {
    let unit = Unit::mobile();
    let mut operations = Operations {
        macs_bytes: 1000,
        memory_bytes: 64,
        ..Operations::default()
    };
    let energy = table().of(&operations, &unit);
    // 1000 times 0.2 and 0.1, and 8 times 64 bits.
    let expected = 1000.0 * (0.2 + 0.1) + 64.0 * (1300.0 / 8.0);
    assert_eq!(energy.picojoules, expected);
    assert_eq!(energy.levels.len(), Operation::ALL.len());
    let multiplied = energy.levels.iter().find(|level| level.count == 1000);
    let multiplied = multiplied.unwrap();
    assert_eq!(multiplied.formula, "int8_multiply + int32_add");
    assert!(multiplied.source.contains("Horowitz"));
    operations += operations;
    assert_eq!(table().of(&operations, &unit).picojoules, 2.0 * expected);
    assert_eq!(table().of(&Operations::default(), &unit).picojoules, 0.0);
}

#[test]
fn wider_numbers_cost_more() {
    let unit = Unit::mobile();
    let kinds = [
        Operation::MacsNarrow,
        Operation::MacsBytes,
        Operation::MacsWide,
        Operation::MacsHalf,
    ];
    let prices = kinds.map(|kind| price(kind, &unit));
    assert!(prices.is_sorted_by(|a, b| a < b), "{prices:?}");
}

#[test]
fn the_published_sizes_of_an_array_have_the_published_prices_and_others_lie_between() {
    let at = |bytes| table().sram_of(bytes).picojoules();
    let published = [8 << 10, 32 << 10, 1 << 20].map(at);
    assert_eq!(published, [10.0, 20.0, 100.0]);
    assert_eq!([at(0), at(1), at(4096)], [10.0; 3]);
    let mut before = at(8 << 10);
    for kib in 9..4096 {
        let price = at(kib << 10);
        assert!(price > before, "{kib} KiB");
        before = price;
    }
    // Half way between 8 and 32 KiB, by factors, is half way between 10 and 20.
    assert!((at(16 << 10) - 200.0_f64.sqrt()).abs() < 1e-12);
}

#[test]
fn a_larger_array_makes_its_bytes_dearer() {
    let reads = [
        (Operation::L1ReadBytes, "cache_sets", ["64", "4096"]),
        (Operation::TagLookups, "cache_ways", ["2", "4"]),
        (
            Operation::WeightSramReadBytes,
            "weight_sram_bytes",
            ["8192", "65536"],
        ),
        (
            Operation::DecodedCacheReadBytes,
            "decoded_cache_blocks",
            ["32", "1024"],
        ),
        (Operation::L2ReadBytes, "level2_sets", ["64", "1024"]),
    ];
    for (operation, field, sizes) in reads {
        let [small, large] = sizes.map(|size| {
            let unit = Unit::mobile().with(&[(field, size)]).unwrap();
            price(operation, &unit)
        });
        assert!(small < large, "{field}: {small}, {large}");
    }
    let none = Unit::mobile().without_cache();
    assert!(price(Operation::L1ReadBytes, &none) < price(Operation::L1ReadBytes, &Unit::mobile()));
}
