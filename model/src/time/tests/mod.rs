//! Claims about whole runs.

mod operands;
mod parts;
mod random;

use super::fixture::{
    Asked, Hidden, Kind, Sketch, addresses, hardware_sized, scan, simulate, thin, tiny, unit,
};
use super::watch::Watch;
use super::{Cause, Resource, Unit, work_of};
use crate::request::Request;
use crate::time;
use crate::trace::Fetch;
use ntmu_isa::activation::Activation;
use ntmu_isa::layout::Layout;
use ntmu_isa::rescale::Multiplier;
use std::collections::BTreeSet;

/// The addresses of all misses.
#[derive(Default)]
struct Missed(Vec<u64>);

impl Watch for Missed {
    fn miss(&mut self, _at: u64, address: u64) {
        self.0.push(address);
    }
}

#[test]
fn two_texels_take_the_cycles_counted_by_hand() {
    let (asset, program, _) = scan(&tiny(), Layout::LINEAR);
    let trace = Asked::Texels(Request::blocks(&asset.shape, 0).take(2).collect());
    let unit = unit(&[
        ("requests_per_cycle", 1),
        ("coalesced_texels", 1),
        ("address_generators", 2),
        ("weight_latency_cycles", 0),
        ("hit_latency_cycles", 1),
        ("memory_latency_cycles", 10),
        ("memory_bytes_per_cycle", 64),
        ("unpack_lanes", 4),
        ("interpolator_lanes", 1),
        ("embed_lanes", 1),
        ("batch_texels", 2),
        ("weight_fill_bytes_per_cycle", 5),
        ("tile_load_cycles", 1),
        ("mac_rows", 1),
        ("mac_columns", 3),
        ("mac_depth_cycles", 2),
        ("requantizer_lanes", 1),
        ("requantizer_depth_cycles", 1),
        ("output_channels_per_cycle", 1),
    ]);
    let timing = simulate(&unit, &asset, &program, &trace);
    // 6 weights and 9 bytes of row parameters at 5 bytes a cycle: 3 cycles. From there on:
    //   texel 0  request 0-1, address 1-3, tags 3-5. Both lines miss: 3 + 1 + 10 = 14, 4 + 11 = 15.
    //   texel 1  request 1-2, address 3-5, tags 5-7; both lines are under way.
    //   corners are there at 15, read at 16; embedding takes 8 latents / 4 lanes = 2 each: 16-20.
    //   array    2 column tiles of 2 texels: 20-24. Requantisers 26-28, ready at 29. Out 29-31.
    let expected = [
        (Cause::Compute, 4),
        (Cause::WeightFill, 3),
        (Cause::Requantize, 2),
        (Cause::Dependency, 3),
        (Cause::Embed, 4),
        (Cause::Lookup, 3),
        (Cause::LatentMiss, 10),
        (Cause::Address, 2),
        (Cause::Starved, 1),
        (Cause::Drain, 2),
    ];
    for (cause, cycles) in timing.ledger.entries() {
        let by_hand = expected
            .iter()
            .find(|entry| entry.0 == cause)
            .map_or(0, |entry| entry.1);
        assert_eq!(cycles, by_hand, "{}", cause.name());
    }
    assert_eq!(timing.cycles, 34);
    assert_eq!((timing.hits, timing.merges, timing.misses), (0, 2, 2));
    assert_eq!(
        (timing.macs, timing.latent_bytes, timing.weight_bytes),
        (12, 128, 15)
    );
    // The closed form waits for the first line only, which is there a cycle before the second.
    assert_eq!(timing.closed_form.cycles, 33);
}

#[test]
fn work_counts_the_multiplications_of_the_layers() {
    let gate = Activation::HardGelu {
        scale: Multiplier::power_of_two(8),
        is_clamped: false,
    };
    let gated = Sketch {
        hidden: [false, true]
            .map(|adds| Hidden::bytes(5, gate, adds))
            .to_vec(),
        ..tiny()
    };
    let mixed = Sketch {
        hidden: vec![
            Hidden::bytes(5, gate, false),
            Hidden {
                kind: Kind::Half,
                ..Hidden::bytes(7, Activation::Relu, false)
            },
        ],
        ..tiny()
    };
    for sketch in [tiny(), thin(), hardware_sized(), gated.clone(), mixed] {
        let (asset, program, _) = scan(&sketch, Layout::TILED);
        let work = work_of(&asset, &program);
        assert_eq!(work.macs(), u64::from(asset.macs()));
        assert_eq!(work.parameter_bytes(), asset.parameter_bits() / 8);
        assert_eq!(work.channels, u32::from(sketch.channels));
        assert_eq!((work.positions, work.fetches), (2, 2));
    }
    let (asset, program, _) = scan(&gated, Layout::TILED);
    // Two gated layers of 5, one channel; the second layer adds 5 skipped activations.
    let work = work_of(&asset, &program);
    assert_eq!(work.requantizer_slots(), 5 * 3 + 5 * 3 + 1);
    assert_eq!(
        work.dense.iter().map(|dense| dense.skip_reads).sum::<u32>(),
        5
    );
}

#[test]
fn a_cache_that_holds_everything_reads_every_line_once() {
    for layout in [Layout::LINEAR, Layout::TILED] {
        let (asset, program, trace) = scan(&thin(), layout);
        let unit = unit(&[("cache_sets", 1024), ("cache_ways", 8)]);
        let timing = simulate(&unit, &asset, &program, &trace);
        let line = u64::from(unit.line_bytes);
        let material = trace.material(&asset, &program);
        let mut fetches = Vec::new();
        for demand in trace.demands() {
            material
                .addresses()
                .fetches(&demand.places[0], &mut fetches);
        }
        let cells = fetches.iter().flat_map(|fetch| {
            let bytes = u64::from(fetch.cell_bytes);
            let touched = move |at| at / line..=(at + bytes - 1) / line;
            fetch.addresses.into_iter().flat_map(touched)
        });
        let distinct: BTreeSet<u64> = cells.collect();
        let count = distinct.len() as u64;
        assert_eq!((timing.misses, timing.latent_bytes), (count, count * line));
        assert_eq!(timing.distinct_lines, count);
        // Whoever watches sees the same lines, each once.
        let mut missed = Missed::default();
        let materials = [material];
        let run = time::simulate(&unit, &materials, &mut trace.demands(), &mut missed);
        assert_eq!(run, Ok(timing));
        missed.0.sort_unstable();
        let starts: Vec<u64> = distinct.iter().map(|at| at * line).collect();
        assert_eq!(missed.0, starts);
    }
}

#[test]
fn a_line_is_looked_up_once_for_the_texels_of_a_group_and_a_cell_may_lie_in_two() {
    let (asset, program, _) = scan(&tiny(), Layout::LINEAR);
    let lookups = |coalesced, trace: &Asked| {
        let unit = unit(&[("coalesced_texels", coalesced), ("cache_banks", 4)]);
        let timing = simulate(&unit, &asset, &program, trace);
        (timing.lookups, timing.misses)
    };
    // Lines 0; 1 and 2; 0; 3.
    let trace = addresses(&[[0; 4], [64, 64, 128, 128], [1; 4], [200; 4]]);
    assert_eq!(
        [1, 2, 4].map(|n| lookups(n, &trace)),
        [(5, 4), (5, 4), (4, 4)]
    );
    let fetch = |planes| {
        Asked::Fetches(vec![Fetch {
            grid: 0,
            addresses: [60, 60, 64, 0],
            cell_bytes: 8,
            planes,
            plane_bytes: 256,
        }])
    };
    assert_eq!(lookups(1, &fetch(1)), (2, 2));
    // Two lines in each of three planes.
    assert_eq!(lookups(1, &fetch(3)), (6, 6));
}

#[test]
fn corners_in_one_bank_are_looked_up_one_after_the_other() {
    let (asset, program, _) = scan(&tiny(), Layout::LINEAR);
    let run = |trace: &Asked, banks, lookups| {
        let ideal = unit(&[("coalesced_texels", 1), ("batch_texels", 1)]).with_ideal_memory();
        let changes = [("cache_banks", banks), ("lookups_per_bank", lookups)];
        let mut configuration = *ideal.configuration();
        for (name, value) in changes {
            configuration.set(name, value).unwrap();
        }
        let unit = Unit::new("banked", configuration).unwrap();
        simulate(&unit, &asset, &program, trace)
            .ledger
            .of(Cause::BankConflict)
    };
    // Lines 0, 1, 2, 3 and lines 0, 4, 8, 12: apart, or all in bank 0 of four.
    let apart = addresses(&[[0, 64, 128, 192]]);
    let together = addresses(&[[0, 256, 512, 768]]);
    assert_eq!(
        [run(&apart, 4, 1), run(&apart, 2, 1), run(&apart, 1, 1)],
        [0, 1, 3]
    );
    assert_eq!(
        [
            run(&together, 4, 1),
            run(&together, 4, 2),
            run(&together, 4, 4)
        ],
        [3, 1, 0]
    );
}

#[test]
fn a_miss_waits_for_a_register_and_a_second_miss_of_a_line_does_not() {
    let (asset, program, _) = scan(&tiny(), Layout::LINEAR);
    let changes = [("coalesced_texels", 1), ("batch_texels", 1), ("mshrs", 1)];
    let unit = unit(&changes);
    let one_line = simulate(
        &unit,
        &asset,
        &program,
        &addresses(&[[0, 1, 2, 3], [4, 5, 6, 7]]),
    );
    assert_eq!((one_line.hits, one_line.merges, one_line.misses), (0, 1, 1));
    assert_eq!(one_line.ledger.of(Cause::MshrFull), 0);
    let two_lines = simulate(&unit, &asset, &program, &addresses(&[[0, 64, 64, 0]]));
    assert_eq!((two_lines.merges, two_lines.misses), (0, 2));
    // Both are looked up in one cycle; the second has its register when the first is there, after
    // 64 bytes at 8 a cycle and 150 cycles of latency.
    assert_eq!(two_lines.ledger.of(Cause::MshrFull), 8 + 150);
}

#[test]
fn a_slow_output_is_charged_to_the_output_queue() {
    let (asset, program, trace) = scan(&hardware_sized(), Layout::TILED);
    let slow = unit(&[
        ("output_channels_per_cycle", 1),
        ("mac_rows", 64),
        ("mac_columns", 64),
        ("mac_depth_cycles", 0),
        ("requantizer_lanes", 1024),
        ("requantizer_depth_cycles", 0),
        ("skip_lanes", 1024),
    ]);
    let timing = simulate(&slow, &asset, &program, &trace);
    assert_eq!(timing.largest_stall, Some(Cause::OutputFull));
    assert_eq!(timing.bottleneck, Resource::Output);
    let fast = unit(&[("output_channels_per_cycle", 64)]);
    let timing = simulate(&fast, &asset, &program, &trace);
    assert_eq!(timing.ledger.of(Cause::OutputFull), 0);
}

#[test]
fn every_resource_is_the_bottleneck_of_the_unit_that_is_short_of_it() {
    let hidden = [false, true].map(|adds| Hidden::bytes(16, Activation::Relu, adds));
    let sketch = Sketch {
        size: 64,
        hidden: hidden.to_vec(),
        ..thin()
    };
    let (asset, program, blocks) = scan(&sketch, Layout::TILED);
    let scattered: Vec<[u64; 4]> = (0..256)
        .map(|t| [0, 1, 2, 3].map(|c| (4 * t + c) * 64))
        .collect();
    let scattered = addresses(&scattered);
    let wide = [
        "unpack_lanes",
        "interpolator_lanes",
        "embed_lanes",
        "requantizer_lanes",
    ];
    let wide = wide.map(|name| (name, 4096));
    let rest = [
        ("requests_per_cycle", 64),
        ("address_generators", 64),
        ("mac_rows", 64),
        ("mac_columns", 64),
        ("mac_arrays", 16),
        ("tile_load_cycles", 1),
        ("mac_depth_cycles", 0),
        ("requantizer_depth_cycles", 0),
        ("skip_lanes", 4096),
        ("output_channels_per_cycle", 4096),
    ];
    let ample = unit(&[&wide[..], &rest].concat()).with_ideal_memory();
    let short = |changes: &[(&str, u32)]| {
        let mut configuration = *ample.configuration();
        for &(name, value) in changes {
            configuration.set(name, value).unwrap();
        }
        Unit::new("short", configuration).unwrap()
    };
    for (resource, changes) in [
        (Resource::Lookup, ("requests_per_cycle", 64)),
        (Resource::Requests, ("requests_per_cycle", 1)),
        (Resource::Address, ("address_generators", 1)),
        (Resource::Embed, ("unpack_lanes", 16)),
        (Resource::Embed, ("interpolator_lanes", 2)),
        (Resource::MacArray, ("mac_rows", 1)),
        (Resource::WeightLoad, ("tile_load_cycles", 50)),
        (Resource::Requantizer, ("requantizer_lanes", 4)),
        (Resource::SkipPort, ("skip_lanes", 4)),
        (Resource::Output, ("output_channels_per_cycle", 1)),
    ] {
        let timing = simulate(&short(&[changes]), &asset, &program, &blocks);
        assert_eq!(timing.bottleneck, resource, "{changes:?}");
        assert_eq!(timing.cycles, timing.closed_form.cycles, "{changes:?}");
    }
    for (resource, changes) in [
        (
            Resource::WeightStream,
            vec![("weight_sram_bytes", 0), ("weight_fill_bytes_per_cycle", 1)],
        ),
        (Resource::Memory, vec![("memory_bytes_per_cycle", 1)]),
        (
            Resource::Mshrs,
            vec![("memory_latency_cycles", 100), ("mshrs", 1)],
        ),
    ] {
        let timing = simulate(&short(&changes), &asset, &program, &scattered);
        assert_eq!(timing.bottleneck, resource, "{changes:?}");
    }
}

#[test]
fn weights_that_do_not_fit_are_streamed_for_each_batch() {
    let (asset, program, trace) = scan(&hardware_sized(), Layout::TILED);
    let whole = work_of(&asset, &program).parameter_bytes();
    let fits = simulate(&unit(&[]), &asset, &program, &trace);
    assert_eq!(fits.weight_bytes, whole);
    let none = simulate(&unit(&[("weight_sram_bytes", 0)]), &asset, &program, &trace);
    assert_eq!(none.weight_bytes, whole * trace.count().div_ceil(16) as u64);
    assert!(none.ledger.of(Cause::WeightFill) > fits.ledger.of(Cause::WeightFill));
}

#[test]
fn a_deep_corner_fifo_hides_the_latency_of_memory() {
    // Igehy, Eldridge and Proudfoot 1998: 97 % of the performance without latency.
    let (asset, program, trace) = scan(&thin(), Layout::TILED);
    let cycles = |latency, fifo| {
        let wide = unit(&[
            ("memory_latency_cycles", latency),
            ("corner_fifo_texels", fifo),
            ("request_queue_texels", 64),
            ("mac_arrays", 16),
            ("tile_load_cycles", 1),
            ("unpack_lanes", 1024),
            ("interpolator_lanes", 1024),
            ("embed_lanes", 1024),
            ("address_generators", 64),
            ("memory_bytes_per_cycle", 64),
            ("mshrs", 64),
        ]);
        simulate(&wide, &asset, &program, &trace).cycles
    };
    let none = cycles(0, 4);
    assert!(none * 100 >= cycles(300, 1024) * 97);
    assert!(none * 100 < cycles(300, 4) * 97);
}

#[test]
fn no_texels_take_no_cycles() {
    let (asset, program, _) = scan(&tiny(), Layout::LINEAR);
    let timing = simulate(
        &Unit::console(),
        &asset,
        &program,
        &Asked::Texels(Vec::new()),
    );
    assert_eq!(
        (
            timing.cycles,
            timing.weight_bytes,
            timing.closed_form.cycles
        ),
        (0, 0, 0)
    );
    assert_eq!((timing.cycles_per_block, timing.hit_rate), (0.0, 0.0));
}
