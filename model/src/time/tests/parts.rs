//! Claims about single parts of a unit, seen from outside.

use crate::demand::Demand;
use crate::material::Material;
use crate::request::Request;
use crate::time::choice::{CacheKind, Dataflow, Misses, Wiring};
use crate::time::fixture::{
    Asked, Hidden, Sketch, addresses, demand, hardware_sized, scan, simulate, thin, tiny, unit,
    with_weight_bits,
};
use crate::time::{self, Cause, Timing, Unit};
use ntmu_isa::activation::Activation;
use ntmu_isa::layout::Layout;

/// `mobile` with some numbers and then choices changed.
fn chosen(numbers: &[(&str, u32)], choices: &[(&str, &str)]) -> Unit {
    let mut configuration = *unit(numbers).configuration();
    for (field, name) in choices {
        configuration.choose(field, name).unwrap();
    }
    Unit::new("chosen", configuration).unwrap()
}

fn run(unit: &Unit, materials: &[Material], demands: Vec<Demand>) -> Timing {
    let run = time::simulate(unit, materials, &mut demands.into_iter(), &mut ());
    run.unwrap_or_else(|never| match never {})
}

/// Texel n of a row of mip 0.
fn texel(n: u32) -> Request {
    Request::within(n, 0, 0)
}

#[test]
fn a_quad_decodes_a_texel_once_and_answers_every_pixel() {
    let (asset, program, _) = scan(&thin(), Layout::TILED);
    let materials = [Material::new("a", &asset, &program)];
    // Neighbours share one of their two texels.
    let pixels = |count: u32| (0..count).map(|n| demand(0, &[texel(n), texel(n + 1)]));
    let counts = |quad| {
        let mut demands: Vec<Demand> = pixels(4).collect();
        for (n, demand) in demands.iter_mut().enumerate() {
            demand.pixel = [n as u32 % 2, n as u32 / 2];
        }
        let timing = run(&unit(&[("quad_pixels", quad)]), &materials, demands);
        assert_eq!((timing.pixels, timing.texels), (4, 8));
        assert_eq!(timing.decodes + timing.shared_texels, 8);
        timing.decodes
    };
    assert_eq!([1, 2, 4].map(counts), [8, 6, 5]);
}

#[test]
fn a_decoded_block_is_decoded_once_and_filtered_from_again() {
    let (asset, program, _) = scan(&thin(), Layout::TILED);
    let materials = [Material::new("a", &asset, &program)];
    let demands = || -> Vec<Demand> {
        Request::blocks(&asset.shape, 0)
            .take(64)
            .chain(Request::blocks(&asset.shape, 0).take(64))
            .map(|texel| demand(0, &[texel]))
            .collect()
    };
    let none = run(&unit(&[]), &materials, demands());
    assert_eq!((none.decodes, none.held_texels), (128, 0));
    let held = |blocks, side| {
        let cached = unit(&[
            ("decoded_cache_blocks", blocks),
            ("decoded_cache_ways", 4),
            ("decoded_block_side", side),
        ]);
        let timing = run(&cached, &materials, demands());
        assert_eq!(timing.pixels, 128);
        (timing.decodes, timing.held_texels)
    };
    // 64 texels are four blocks of 4×4; the first texel of a block decodes it.
    assert_eq!(held(64, 4), (64, 124));
    // Single texels: the second round finds them all.
    assert_eq!(held(1024, 1), (64, 64));
}

#[test]
fn weights_come_in_again_when_another_material_took_their_place() {
    let (asset, program, _) = scan(&hardware_sized(), Layout::TILED);
    let materials = ["a", "b"].map(|name| Material::new(name, &asset, &program));
    let bytes = time::work_of(&asset, &program).parameter_bytes();
    // Four texels of one material, four of the other, and so on.
    let demands = || -> Vec<Demand> {
        let asked = |n: u32| demand(((n / 4) % 2) as u16, &[texel(n)]);
        (0..64).map(asked).collect()
    };
    let fills = |sram: u64, bins| {
        let sram = [("weight_sram_bytes", sram as u32), ("material_bins", bins)];
        let timing = run(&unit(&sram), &materials, demands());
        assert_eq!((timing.pixels, timing.decodes), (64, 64));
        assert_eq!(timing.weight_bytes, timing.weight_fills * bytes);
        (timing.weight_fills, timing.jobs)
    };
    // Room for both: each once. Without bins every change closes a job.
    assert_eq!(fills(2 * bytes, 1), (2, 16));
    // Room for one: every job but none of the same material after itself brings its own.
    assert_eq!(fills(bytes, 1), (16, 16));
    // Two bins gather 16 texels of each: two jobs each, in turns.
    assert_eq!(fills(bytes, 2), (4, 4));
}

#[test]
fn filtering_takes_its_codes_and_a_single_texel_passes() {
    let (asset, program, _) = scan(&tiny(), Layout::LINEAR);
    let materials = [Material::new("a", &asset, &program)];
    let slow = unit(&[("filter_lanes", 1), ("filter_depth_cycles", 3)]);
    let cycles = |texels: &[Request]| {
        let timing = run(&slow, &materials, vec![demand(0, texels)]);
        (
            timing.operations.filtered_codes,
            timing.ledger.of(Cause::Drain),
        )
    };
    let [(single, passing), (four, filtering)] =
        [cycles(&[texel(0)]), cycles(&[0, 1, 2, 3].map(texel))];
    // One channel: four codes in four cycles and the depth, in front of the one output cycle.
    assert_eq!((single, four), (0, 4));
    assert_eq!((passing, filtering), (1, 4 + 3 + 1));
}

#[test]
fn accumulators_that_stay_take_as_many_cycles_as_there_are_inputs() {
    let sketch = Sketch {
        hidden: vec![Hidden::bytes(40, Activation::Relu, false)],
        ..tiny()
    };
    let (asset, program, _) = scan(&sketch, Layout::LINEAR);
    let asked = Asked::Texels(Request::blocks(&asset.shape, 0).take(16).collect());
    let array = |dataflow: Dataflow, wiring: Wiring| {
        let choices = [("dataflow", dataflow.name()), ("wiring", wiring.name())];
        let unit = chosen(&[("tile_load_cycles", 1)], &choices);
        let timing = simulate(&unit, &asset, &program, &asked);
        (
            timing.ledger.of(Cause::Compute),
            timing.ledger.of(Cause::ArrayFill),
        )
    };
    // 16 rows and columns, 16 texels; 6 inputs to 40 outputs, 40 inputs to one.
    let (ws, os) = (Dataflow::WeightStationary, Dataflow::OutputStationary);
    // Three row tiles by one column tile and one by three, a pass of 16 cycles each.
    assert_eq!(array(ws, Wiring::Broadcast), (6 * 16, 0));
    assert_eq!(array(ws, Wiring::Systolic), (6 * 16, 6 * 30));
    // Three passes of 6 inputs and one of 40.
    assert_eq!(array(os, Wiring::Broadcast), (3 * 6 + 40, 0));
    assert_eq!(array(os, Wiring::Systolic), (3 * 6 + 40, 4 * (30 + 16)));
}

#[test]
fn a_tile_that_cannot_be_loaded_behind_a_pass_is_loaded_in_front_of_it() {
    let (asset, program, asked) = scan(&hardware_sized(), Layout::TILED);
    let load = |buffers| {
        let unit = unit(&[("tile_buffers", buffers), ("tile_load_cycles", 10)]);
        simulate(&unit, &asset, &program, &asked)
            .ledger
            .of(Cause::WeightLoad)
    };
    // 61 inputs and 64: four column tiles by four rows in three layers, and four for the last.
    let passes = 3 * 16 + 4;
    let batches = asked.count() as u64 / 16;
    assert_eq!([load(2), load(1)], [0, passes * batches * 10]);
}

#[test]
fn narrow_weights_take_fewer_passes_where_multipliers_split() {
    let (mut asset, program, asked) = scan(&thin(), Layout::TILED);
    let compute = |asset: &ntmu_isa::Asset, columns| {
        let unit = unit(&[("narrow_columns", columns)]);
        simulate(&unit, asset, &program, &asked)
            .ledger
            .of(Cause::Compute)
    };
    let texels = asked.count() as u64;
    // 41 inputs: three columns of 16, or two of 32; weights of eight bits do not split.
    assert_eq!([1, 2].map(|n| compute(&asset, n)), [3 * texels; 2]);
    asset = with_weight_bits(asset, 4);
    assert_eq!([1, 2].map(|n| compute(&asset, n)), [3 * texels, 2 * texels]);
}

#[test]
fn a_second_level_gives_back_what_the_first_has_lost() {
    let (asset, program, _) = scan(&tiny(), Layout::LINEAR);
    // Nine lines of one set of two ways, three times.
    let lines: Vec<[u64; 4]> = (0..27).map(|n| [n % 9 * 4096; 4]).collect();
    let asked = addresses(&lines);
    let misses = |sets| {
        let unit = unit(&[
            ("coalesced_texels", 1),
            // One line under way, so that none is wanted again before it is lost.
            ("mshrs", 1),
            ("level2_sets", sets),
            ("level2_ways", 16),
            ("level2_latency_cycles", 20 * u32::from(sets > 0)),
        ]);
        let timing = simulate(&unit, &asset, &program, &asked);
        assert_eq!(timing.misses, timing.level2_hits + timing.fetched_lines);
        (timing.misses, timing.level2_hits)
    };
    assert_eq!(misses(0), (27, 0));
    assert_eq!(misses(1), (27, 18));
}

#[test]
fn a_blocking_cache_waits_for_every_line_and_one_that_looks_on_does_not() {
    let (asset, program, _) = scan(&tiny(), Layout::LINEAR);
    let lines: Vec<[u64; 4]> = (0..8).map(|n| [n * 64; 4]).collect();
    let asked = addresses(&lines);
    let cycles = |misses: Misses| {
        let numbers = [("coalesced_texels", 1), ("memory_latency_cycles", 500)];
        let unit = chosen(&numbers, &[("misses", misses.name())]);
        simulate(&unit, &asset, &program, &asked).cycles
    };
    let (hit_under, blocking) = (cycles(Misses::HitUnderMiss), cycles(Misses::Blocking));
    assert!(hit_under < 2 * 500, "{hit_under}");
    assert!(blocking > 8 * 500, "{blocking}");
}

#[test]
fn the_brackets_of_a_cache_fetch_every_line_always_and_once() {
    let (asset, program, asked) = scan(&thin(), Layout::LINEAR);
    let fetched = |kind: CacheKind| {
        let unit = chosen(&[("cache_sets", 2)], &[("cache", kind.name())]);
        let timing = simulate(&unit, &asset, &program, &asked);
        (timing.fetched_lines, timing.lookups, timing.distinct_lines)
    };
    let (none, lookups, distinct) = fetched(CacheKind::None);
    assert_eq!(none, lookups);
    assert_eq!(fetched(CacheKind::Infinite), (distinct, lookups, distinct));
    let (finite, ..) = fetched(CacheKind::Finite);
    assert!(
        distinct < finite && finite < none,
        "{distinct} {finite} {none}"
    );
}

#[test]
fn what_is_measured_behind_the_warm_up_is_the_rest_of_the_run() {
    let (asset, program, asked) = scan(&hardware_sized(), Layout::TILED);
    let materials = [asked.material(&asset, &program)];
    let measured = |warm_up| {
        let run = time::simulate_behind(&unit(&[]), &materials, &mut asked.demands(), warm_up);
        run.unwrap_or_else(|never| match never {})
    };
    let whole = measured(0);
    let pixels = asked.count() as u64;
    // Jobs of 16: the first to leave begins what is measured.
    assert_eq!(whole.measured.pixels, pixels - 16);
    let half = measured(pixels / 2);
    assert_eq!(half.measured.pixels, pixels / 2);
    assert_eq!(
        Timing {
            measured: whole.measured,
            ..half.clone()
        },
        whole
    );
    // The last channel leaves with the last cycle.
    assert_eq!(half.measured.ledger.cycles(), half.measured.cycles);
}
