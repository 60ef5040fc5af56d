//! Claims about layers of other operands than bytes.

use crate::time::fixture::{Hidden, Kind, Sketch, scan, simulate, thin, tiny, unit};
use crate::time::{Cause, work_of};
use ntmu_isa::activation::Activation;
use ntmu_isa::layout::Layout;
use ntmu_isa::rescale::Multiplier;

#[test]
fn operands_wider_than_bytes_pass_the_array_as_often_as_the_unit_says() {
    let layers = |first, second| Sketch {
        hidden: [first, second]
            .map(|kind| Hidden {
                kind,
                ..Hidden::bytes(16, Activation::Relu, false)
            })
            .to_vec(),
        ..thin()
    };
    let compute = |sketch: &Sketch, changes: &[(&str, u32)]| {
        let (asset, program, trace) = scan(sketch, Layout::TILED);
        let timing = simulate(&unit(changes), &asset, &program, &trace);
        (timing.ledger.of(Cause::Compute), trace.count() as u64)
    };
    // 41 inputs are three columns of tiles, 16 and 16 one each, 5 in all for each texel.
    let [bytes, wide] = [8, 9].map(|bits| layers(Kind::Integer(bits), Kind::Integer(8)));
    let (cycles, texels) = compute(&bytes, &[]);
    assert_eq!(cycles, 5 * texels);
    // The layer after the wide one reads its integers.
    assert_eq!(compute(&wide, &[]).0, 6 * texels);
    assert_eq!(compute(&wide, &[("wide_passes", 4)]).0, 8 * texels);
    assert_eq!(compute(&wide, &[("half_passes", 4)]).0, 6 * texels);
    let half = layers(Kind::Half, Kind::Half);
    assert_eq!(compute(&half, &[]).0, (2 * 3 + 2 + 1) * texels);
    assert_eq!(compute(&half, &[("half_passes", 1)]).0, 5 * texels);
    assert_eq!(compute(&half, &[("wide_passes", 1)]).0, 9 * texels);
}

#[test]
fn a_tile_of_halves_takes_twice_as_long_to_load() {
    let load = |kind| {
        let hidden = Hidden {
            kind,
            ..Hidden::bytes(16, Activation::Relu, false)
        };
        let sketch = Sketch {
            hidden: vec![hidden],
            ..thin()
        };
        let (asset, program, trace) = scan(&sketch, Layout::TILED);
        let unit = unit(&[("tile_load_cycles", 50), ("half_passes", 1)]);
        let timing = simulate(&unit, &asset, &program, &trace);
        let batches = trace.count() as u64 / 16;
        timing.ledger.of(Cause::WeightLoad) / batches
    };
    // Passes of 16 cycles; three tiles of the first layer, one of the last, which are bytes.
    assert_eq!(load(Kind::Integer(8)), 4 * (50 - 16));
    assert_eq!(load(Kind::Half), 3 * (100 - 16) + (50 - 16));
}

#[test]
fn steps_of_an_fp16_layer_are_charged_like_those_that_they_stand_for() {
    let work = |kind, activations: [Activation; 2]| {
        let [first, second] = activations;
        let hidden = [(first, false), (second, true)].map(|(activation, adds)| Hidden {
            kind,
            ..Hidden::bytes(5, activation, adds)
        });
        let sketch = Sketch {
            hidden: hidden.to_vec(),
            last: kind,
            ..tiny()
        };
        let (asset, program, _) = scan(&sketch, Layout::LINEAR);
        let work = work_of(&asset, &program);
        let dense = work.dense.iter();
        let dense = dense
            .map(|d| (d.requantizer_slots, d.skip_reads))
            .collect::<Vec<_>>();
        (dense, work.channels, work.parameter_bytes())
    };
    for (index, activation) in [
        Activation::Identity,
        Activation::Relu,
        Activation::Leaky { shift: 1 },
        Activation::HardGelu {
            scale: Multiplier::power_of_two(0),
            is_clamped: true,
        },
    ]
    .into_iter()
    .enumerate()
    {
        let slots = 5 * [1, 1, 1, 3][index];
        let expected = vec![(slots, 0), (slots, 5), (1, 0)];
        // 6 inputs: 30, 25 and 5 weights; 11 rows.
        let (dense, channels, bytes) = work(Kind::Half, [activation; 2]);
        assert_eq!(
            (dense, channels, bytes),
            (expected.clone(), 1, 2 * (60 + 11))
        );
        let (dense, channels, bytes) = work(Kind::Integer(8), [activation; 2]);
        assert_eq!((dense, channels, bytes), (expected, 1, 60 + 9 * 11));
    }
    // A table: one multiplication to its index, one slot on the way out, 256 entries of a byte.
    let (dense, _, bytes) = work(Kind::Integer(8), [Activation::Table, Activation::Relu]);
    assert_eq!(dense, [(10, 0), (5, 5), (1, 0)]);
    assert_eq!(bytes, 60 + 9 * 11 + 256);
}
