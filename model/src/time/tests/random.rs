//! Claims about random units, programs and requests.

use crate::request::Request;
use crate::time::Unit;
use crate::time::fixture::{Asked, Hidden, Kind, Sketch, asset, simulate, simulate_with_stride};
use crate::time::unit::{FIELDS, Range, Value};
use ntmu_isa::activation::Activation;
use ntmu_isa::layout::Layout;
use ntmu_isa::rescale::Multiplier;
use ntmu_isa::{Asset, Program};
use proptest::prelude::*;

/// The largest value that a random unit has in a field. Rates come in two sizes, so that every
/// stage gets to be the bottleneck.
fn ceiling(field: &str, is_wide: bool) -> u32 {
    match field {
        "requests_per_cycle" | "address_generators" | "output_channels_per_cycle" if !is_wide => 2,
        "unpack_lanes" | "interpolator_lanes" | "embed_lanes" | "requantizer_lanes"
        | "skip_lanes" => [8, 2000][usize::from(is_wide)],
        "mac_rows" | "mac_columns" => [8, 100][usize::from(is_wide)],
        "cache_ways" | "lookups_per_bank" | "mac_arrays" | "batches_in_flight" => 3,
        "mshrs" | "mac_depth_cycles" | "requantizer_depth_cycles" | "tile_load_cycles" => 9,
        "memory_latency_cycles" => 200,
        "weight_sram_bytes" => 8192,
        _ => 40,
    }
}

fn any_unit() -> impl Strategy<Value = Unit> {
    let raw = prop::collection::vec(any::<(u32, bool)>(), FIELDS.len());
    raw.prop_map(|raw| {
        let mut c = *Unit::mobile().configuration();
        for (field, (raw, is_wide)) in FIELDS.iter().zip(raw) {
            let Range::Number { low, high } = field.range else {
                continue;
            };
            let high = ceiling(field.name, is_wide).clamp(low, high);
            let value = low + raw % (high - low + 1);
            c.set(field.name, value).unwrap();
        }
        c.coalesced_texels = [1, 2, 4, 8][c.coalesced_texels as usize % 4];
        c.batch_texels = c.batch_texels.next_multiple_of(c.coalesced_texels);
        for power in [
            &mut c.line_bytes,
            &mut c.cache_sets,
            &mut c.cache_banks,
            &mut c.burst_bytes,
            &mut c.level2_sets,
        ] {
            *power = power.next_power_of_two().min(64);
        }
        c.cache_banks = c.cache_banks.min(c.cache_sets);
        c.decoded_block_side = 1 << (c.decoded_block_side % 4);
        c.decoded_cache_blocks = c
            .decoded_cache_blocks
            .next_multiple_of(c.decoded_cache_ways);
        for queue in [&mut c.request_queue_texels, &mut c.corner_fifo_texels] {
            *queue = (*queue).max(c.coalesced_texels);
        }
        c.output_queue_pixels = c
            .output_queue_pixels
            .max(c.batch_texels * c.batches_in_flight);
        Unit::new("random", c).unwrap()
    })
}

fn any_hidden() -> impl Strategy<Value = Hidden> {
    let bits = prop_oneof![Just(4), Just(8), Just(9), Just(16)];
    let kind = prop_oneof![3 => bits.prop_map(Kind::Integer), 2 => Just(Kind::Half)];
    (kind, 1..40_u16, 0..5_u8).prop_map(|(kind, outputs, activation)| {
        let scale = match kind {
            Kind::Integer(_) => Multiplier::power_of_two(8),
            Kind::Half => Multiplier::power_of_two(0),
        };
        let activation = match (activation, kind) {
            (0, _) | (4, Kind::Half) => Activation::Identity,
            (1, _) => Activation::Relu,
            (2, _) => Activation::Leaky { shift: 2 },
            (4, Kind::Integer(_)) => Activation::Table,
            _ => Activation::HardGelu {
                scale,
                is_clamped: outputs % 2 == 0,
            },
        };
        Hidden {
            kind,
            outputs,
            activation,
            adds: false,
        }
    })
}

fn any_sketch() -> impl Strategy<Value = Sketch> {
    let hidden = prop::collection::vec((any_hidden(), any::<bool>()), 0..4);
    let last = prop_oneof![Just(Kind::Integer(8)), Just(Kind::Half)];
    let sizes = (1..12_u16, 1..12_u16, 0..=3_u8, 1..9_u16);
    (sizes, hidden, last).prop_map(|((first, second, octaves, channels), hidden, last)| {
        let mut layers: Vec<Hidden> = Vec::new();
        for (mut layer, adds) in hidden {
            if let (Some(before), true) = (layers.last(), adds) {
                // A skip path joins registers of one kind. Halves stay halves only up to an fp16
                // layer, and integers come from any layer before an integer one.
                let joins = layer.kind != Kind::Half || before.kind == Kind::Half;
                if joins {
                    layer.outputs = before.outputs;
                    layer.adds = true;
                }
            }
            layers.push(layer);
        }
        Sketch {
            size: 64,
            mip_count: 7,
            grid_channels: [first, second],
            octaves,
            hidden: layers,
            last,
            channels,
        }
    })
}

/// A run of a random program for some texels: blocks in order, or anything anywhere.
fn any_run() -> impl Strategy<Value = (Asset, Program, Asked)> {
    let texel = (0..7_u8, any::<u32>(), any::<u32>());
    let scattered = prop::collection::vec(texel, 1..120).prop_map(Some);
    let order = prop_oneof![Just(None), scattered];
    (
        any_sketch(),
        prop::sample::select(vec![Layout::LINEAR, Layout::TILED]),
        order,
        1..300_usize,
    )
        .prop_map(|(sketch, layout, order, count)| {
            let asset = asset(&sketch);
            let shape = &asset.shape;
            let requests: Vec<Request> = match order {
                None => Request::blocks(shape, 0).take(count).collect(),
                Some(texels) => {
                    let request = |(mip, x, y): (u8, u32, u32)| {
                        let (width, height) = shape.mip_size(mip);
                        Request::new(shape, x % width, y % height, mip).unwrap()
                    };
                    texels.into_iter().map(request).collect()
                }
            };
            let trace = Asked::Texels(requests);
            let program = Program::compile(&asset, layout);
            (asset, program, trace)
        })
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(300) })]

    #[test]
    fn a_run_is_never_faster_than_its_closed_form(unit in any_unit(), run in any_run()) {
        let (asset, program, trace) = run;
        let timing = simulate(&unit, &asset, &program, &trace);
        prop_assert!(timing.cycles >= timing.closed_form.cycles, "{:?}", timing);
        prop_assert_eq!(timing.ledger.entries().map(|entry| entry.1).sum::<u64>(), timing.cycles);
        prop_assert_eq!(timing.pixels as usize, trace.count());
    }

    #[test]
    fn a_run_behind_an_ideal_memory_takes_exactly_its_closed_form(unit in any_unit(), run in any_run()) {
        let (asset, program, trace) = run;
        let unit = unit.with_ideal_memory().with_unbounded_queues();
        let timing = simulate(&unit, &asset, &program, &trace);
        prop_assert_eq!(timing.cycles, timing.closed_form.cycles);
    }

    #[test]
    fn a_run_is_the_same_in_single_cycles_and_again(unit in any_unit(), run in any_run()) {
        let (asset, program, trace) = run;
        let timing = simulate(&unit, &asset, &program, &trace);
        prop_assert_eq!(&simulate_with_stride(&unit, &asset, &program, &trace, 1), &timing);
        prop_assert_eq!(&simulate(&unit, &asset, &program, &trace), &timing);
    }

    #[test]
    fn more_of_a_resource_never_slows_a_run_behind_an_ideal_memory(unit in any_unit(), run in any_run()) {
        let (asset, program, trace) = run;
        let unit = unit.with_ideal_memory();
        let before = simulate(&unit, &asset, &program, &trace).cycles;
        for name in [
            "requests_per_cycle", "request_queue_texels", "address_generators", "cache_ways",
            "corner_fifo_texels", "unpack_lanes", "interpolator_lanes", "embed_lanes", "mac_rows",
            "mac_columns", "mac_arrays", "requantizer_lanes", "skip_lanes", "output_queue_pixels",
            "output_channels_per_cycle",
        ] {
            let mut more = *unit.configuration();
            let (_, value) = more.fields().into_iter().find(|(field, _)| field.name == name).unwrap();
            let Value::Number(value) = value else { continue };
            more.set(name, value + 1).unwrap();
            let after = simulate(&Unit::new("more", more).unwrap(), &asset, &program, &trace).cycles;
            prop_assert!(after <= before, "{}: {} cycles, then {}", name, before, after);
        }
    }
}
