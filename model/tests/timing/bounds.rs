//! What every run obeys: its bounds, its ledger, and itself again.

use crate::any::{Asked, asked, unit};
use crate::fixture::materials;
use ntmu_model::time::{Timing, Unit, closed_form, simulate};
use proptest::prelude::*;

pub(crate) fn run(unit: &Unit, asked: &Asked) -> Timing {
    let mut demands = asked.demands.iter().cloned();
    simulate(unit, &materials(&asked.built), &mut demands, &mut ()).unwrap()
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(400) })]

    #[test]
    fn no_run_is_faster_than_its_closed_form(unit in unit(), asked in asked(3)) {
        let timing = run(&unit, &asked);
        prop_assert!(timing.cycles >= timing.closed_form.cycles, "{:?}", timing);
        // The bound is the same whether the unit is stepped or not.
        let mut demands = asked.demands.iter().cloned();
        let bound = closed_form(&unit, &materials(&asked.built), &mut demands).unwrap();
        prop_assert_eq!(bound, timing.closed_form);
    }

    #[test]
    fn behind_an_ideal_memory_with_endless_queues_every_run_takes_exactly_its_closed_form(
        unit in unit(), asked in asked(3),
    ) {
        let timing = run(&unit.with_ideal_memory().with_unbounded_queues(), &asked);
        prop_assert_eq!(timing.cycles, timing.closed_form.cycles);
    }

    #[test]
    fn every_cycle_has_one_cause_and_a_run_repeats_itself(unit in unit(), asked in asked(3)) {
        let timing = run(&unit, &asked);
        prop_assert_eq!(timing.ledger.entries().map(|entry| entry.1).sum::<u64>(), timing.cycles);
        prop_assert_eq!(run(&unit, &asked), timing);
    }
}
