//! More of a resource never slows a run: of any rate, of any queue, less of any latency.
//!
//! Where lines are found does not depend on time behind an ideal memory, which holds them all, nor
//! with an infinite cache, which asks for each once. Then a run is a chain of stages that each take
//! things in one order, and starts are maxima of sums of costs: nothing can end later when a cost
//! falls or a queue grows. Behind a finite cache there is no such claim: which lines are under way
//! when a line is wanted again decides whether it is fetched again, so a faster stage may meet a
//! miss that a slower one did not.
//!
//! Left out, because more of it is another unit and not a faster one:
//!
//! - `quad_pixels`, `coalesced_texels`, `batch_texels`, `batches_in_flight`, `material_bins`, and the
//!   decoded-texel cache: they decide which texels go together, so another group or job is waited for;
//! - `line_bytes`, `cache_sets`, `cache_ways`, `burst_bytes`, and the second level: what is fetched;
//! - `weight_sram_bytes`: a store that keeps a larger part of one material may drop another;
//! - `mac_rows` and `mac_columns` of a systolic array, whose operands have further to go, and of an
//!   array that streams weights, whose tiles wait for other parts of them;
//! - `clock_mhz`, which changes no cycle.

use crate::any::{Asked, asked, changed, unit};
use crate::bounds::run;
use ntmu_model::time::Unit;
use ntmu_model::time::choice::Wiring;
use ntmu_model::time::unit::{Configuration, FIELDS, Range, Value};
use proptest::prelude::*;

/// Where more is better.
const RATES: [&str; 13] = [
    "requests_per_cycle",
    "address_generators",
    "lookups_per_bank",
    "unpack_lanes",
    "interpolator_lanes",
    "embed_lanes",
    "mac_arrays",
    "narrow_columns",
    "requantizer_lanes",
    "skip_lanes",
    "filter_lanes",
    "output_channels_per_cycle",
    "tile_buffers",
];

const QUEUES: [&str; 3] = [
    "request_queue_texels",
    "corner_fifo_texels",
    "output_queue_pixels",
];

/// Where more is better, behind the latent cache and in front of the weight SRAM.
const OUTSIDE: [&str; 3] = [
    "mshrs",
    "memory_bytes_per_cycle",
    "weight_fill_bytes_per_cycle",
];

/// Where less is better.
const LATENCIES: [&str; 9] = [
    "hit_latency_cycles",
    "memory_latency_cycles",
    "weight_latency_cycles",
    "tile_load_cycles",
    "wide_passes",
    "half_passes",
    "mac_depth_cycles",
    "requantizer_depth_cycles",
    "filter_depth_cycles",
];

fn number(configuration: &Configuration, name: &str) -> u32 {
    let fields = configuration.fields();
    let found = fields.into_iter().find(|(field, _)| field.name == name);
    match found.unwrap().1 {
        Value::Number(number) => number,
        Value::Choice(choice) => panic!("{name} is {choice}"),
    }
}

/// The unit with one more of a number, and with as much as there may be; the same for one less.
fn better(unit: &Unit, name: &str, is_more: bool) -> Vec<Unit> {
    let field = FIELDS.iter().find(|field| field.name == name).unwrap();
    let Range::Number { low, high } = field.range else {
        panic!("{name} is a choice");
    };
    let value = number(unit.configuration(), name);
    let values = match is_more {
        true if value < high => vec![value + 1, (4 * value).min(high), high],
        false if value > low => vec![value - 1, low],
        true | false => Vec::new(),
    };
    values
        .into_iter()
        .map(|value| changed(unit, &[(name, value)]))
        .collect()
}

fn compare(unit: &Unit, asked: &Asked, names: &[&str], is_more: bool) -> Result<(), TestCaseError> {
    let before = run(unit, asked).cycles;
    for name in names {
        for better in better(unit, name, is_more) {
            let after = run(&better, asked).cycles;
            prop_assert!(
                after <= before,
                "{}: {} cycles, then {}",
                name,
                before,
                after
            );
        }
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(100) })]

    #[test]
    fn more_never_slows_a_run_behind_an_ideal_memory(unit in unit(), asked in asked(3)) {
        let unit = unit.with_ideal_memory();
        compare(&unit, &asked, &RATES, true)?;
        compare(&unit, &asked, &QUEUES, true)?;
        compare(&unit, &asked, &LATENCIES, false)?;
        if unit.wiring == Wiring::Broadcast {
            compare(&unit, &asked, &["mac_rows", "mac_columns"], true)?;
        }
    }

    #[test]
    fn more_never_slows_a_run_with_an_infinite_cache(unit in unit(), asked in asked(3)) {
        let unit = unit.with_infinite_cache();
        compare(&unit, &asked, &RATES, true)?;
        compare(&unit, &asked, &QUEUES, true)?;
        compare(&unit, &asked, &OUTSIDE, true)?;
        compare(&unit, &asked, &LATENCIES, false)?;
        let sets = unit.cache_sets.max(2 * unit.cache_banks);
        let banks = [("cache_sets", sets), ("cache_banks", (2 * unit.cache_banks).min(64))];
        let (before, after) = (run(&unit, &asked).cycles, run(&changed(&unit, &banks), &asked).cycles);
        prop_assert!(after <= before, "cache_banks: {} cycles, then {}", before, after);
    }
}
