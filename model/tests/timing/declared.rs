//! A run does the work that its programs declare, no more and no less.

use crate::any::{Asked, asked, changed, unit};
use crate::bounds::run;
use crate::fixture::materials;
use ntmu_model::Place;
use ntmu_model::time::work::{Operands, Work};
use ntmu_model::time::{Timing, Unit};
use ntmu_model::trace::Fetch;
use proptest::prelude::*;
use std::collections::BTreeSet;

/// Decodes of each material when nothing is kept decoded: each place once for successive pixels of
/// one material in one square of pixels.
fn decodes(unit: &Unit, asked: &Asked) -> Vec<u64> {
    let side = if unit.quad_pixels > 4 { 4 } else { 2 };
    let mut decodes = vec![0; asked.built.len()];
    let mut quad = None;
    let (mut pixels, mut seen) = (0, BTreeSet::<Place>::new());
    for demand in &asked.demands {
        let here = (demand.material, demand.pixel.map(|at| at / side));
        if quad != Some(here) || pixels == unit.quad_pixels {
            quad = Some(here);
            pixels = 0;
            seen.clear();
        }
        pixels += 1;
        for &place in &demand.places {
            decodes[usize::from(demand.material)] += u64::from(seen.insert(place));
        }
    }
    decodes
}

/// What the timing must say of decodes, by the programs' own numbers.
fn check(asked: &Asked, timing: &Timing, decodes: &[u64]) -> Result<(), TestCaseError> {
    let materials = materials(&asked.built);
    let total = |each: &dyn Fn(&Work) -> u64| -> u64 {
        let works = materials.iter().map(|material| each(material.work()));
        works.zip(decodes).map(|(each, count)| each * count).sum()
    };
    let macs = |operands: Operands| {
        total(&|work: &Work| {
            let dense = work.dense.iter().filter(|dense| dense.operands == operands);
            dense.map(|dense| dense.macs()).sum()
        })
    };
    let operations = &timing.operations;
    let skips = |work: &Work| {
        let dense = work.dense.iter();
        dense.map(|dense| u64::from(dense.skip_reads)).sum()
    };
    prop_assert_eq!(timing.decodes, decodes.iter().sum::<u64>());
    prop_assert_eq!(timing.macs, total(&Work::macs));
    prop_assert_eq!(operations.macs_narrow, macs(Operands::Narrow));
    prop_assert_eq!(operations.macs_bytes, macs(Operands::Bytes));
    prop_assert_eq!(operations.macs_wide, macs(Operands::Wide));
    prop_assert_eq!(operations.macs_half, macs(Operands::Half));
    prop_assert_eq!(operations.requantised, total(&Work::requantizer_slots));
    prop_assert_eq!(operations.skip_adds, total(&skips));
    prop_assert_eq!(
        operations.address_steps,
        total(&|work| work.address_steps.into())
    );
    prop_assert_eq!(
        operations.unpacked_latents,
        total(&|work| work.unpacked.into())
    );
    prop_assert_eq!(
        operations.interpolations,
        total(&|work| work.interpolated.into())
    );
    prop_assert_eq!(operations.embedded, total(&|work| work.embedded.into()));
    // A fetch reads as many bytes wherever it is.
    let mut corner_bytes = Vec::new();
    for (index, material) in materials.iter().enumerate() {
        let mut places = asked
            .demands
            .iter()
            .filter(|d| usize::from(d.material) == index);
        let mut fetches: Vec<Fetch> = Vec::new();
        if let Some(place) = places.find_map(|demand| demand.places.first()) {
            material.addresses().fetches(place, &mut fetches);
        }
        let bytes = |f: &Fetch| 4 * u64::from(f.planes) * u64::from(f.cell_bytes);
        corner_bytes.push(fetches.iter().map(bytes).sum::<u64>() * decodes[index]);
    }
    prop_assert_eq!(operations.l1_read_bytes, corner_bytes.iter().sum::<u64>());
    Ok(())
}

/// What the timing must say of pixels and lines, however they were decoded.
fn check_pixels(unit: &Unit, asked: &Asked, timing: &Timing) -> Result<(), TestCaseError> {
    let materials = materials(&asked.built);
    let channels = |material: u16| u64::from(materials[usize::from(material)].work().channels);
    let (mut outputs, mut codes, mut texels) = (0, 0, 0);
    for demand in &asked.demands {
        outputs += channels(demand.material);
        texels += demand.places.len() as u64;
        // A single texel is not filtered.
        let weights = u64::from(demand.weights);
        codes += if weights > 1 { weights } else { 0 } * channels(demand.material);
    }
    let operations = &timing.operations;
    prop_assert_eq!(timing.pixels, asked.demands.len() as u64);
    prop_assert_eq!(timing.texels, texels);
    prop_assert_eq!(operations.output_bytes, outputs);
    prop_assert_eq!(operations.filtered_codes, codes);
    prop_assert_eq!(operations.tag_lookups, timing.lookups);
    prop_assert_eq!(timing.hits + timing.merges + timing.misses, timing.lookups);
    prop_assert_eq!(timing.level2_hits + timing.fetched_lines, timing.misses);
    let line = u64::from(unit.line_bytes);
    let moved = line.next_multiple_of(u64::from(unit.burst_bytes));
    prop_assert_eq!(timing.latent_bytes, timing.fetched_lines * moved);
    prop_assert_eq!(operations.memory_bytes, timing.latent_bytes);
    prop_assert_eq!(operations.l1_fill_bytes, timing.misses * line);
    prop_assert_eq!(operations.weight_fill_bytes, timing.weight_bytes);
    prop_assert!(timing.distinct_lines <= timing.misses);
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(300) })]

    #[test]
    fn operations_are_the_declared_work_times_the_decodes_of_each_material(
        unit in unit(), asked in asked(3),
    ) {
        let unit = changed(&unit, &[("decoded_cache_blocks", 0)]);
        let timing = run(&unit, &asked);
        let decodes = decodes(&unit, &asked);
        check(&asked, &timing, &decodes)?;
        check_pixels(&unit, &asked, &timing)?;
        prop_assert_eq!(timing.shared_texels, timing.texels - timing.decodes);
        prop_assert_eq!(timing.held_texels, 0);
    }

    #[test]
    fn operations_are_the_declared_work_with_decoded_texels_kept_too(
        unit in unit(), asked in asked(1), sets in 1..9_u32,
    ) {
        let unit = changed(&unit, &[("decoded_cache_blocks", sets * unit.decoded_cache_ways)]);
        let timing = run(&unit, &asked);
        check(&asked, &timing, &[timing.decodes])?;
        check_pixels(&unit, &asked, &timing)?;
        // What is asked for is shared, held, or the reason for a decode.
        prop_assert!(timing.shared_texels + timing.held_texels + timing.decodes >= timing.texels);
    }
}
