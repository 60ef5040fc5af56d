//! The map of misses.

use crate::run::{Seen, run, units};
use ntmu::model::time::Watch as _;
use ntmu::timing::heat::{HeatCell, HeatValue, MissMap};
use proptest::prelude::*;
use std::collections::BTreeMap;

/// Cells by pixel, added up in the plainest way.
fn expected(lookups: &[([u32; 2], u32, u32)], side: u32) -> BTreeMap<(u64, u64), (u64, u64)> {
    let mut cells: BTreeMap<(u64, u64), (u64, u64)> = BTreeMap::new();
    for &([x, y], lines, misses) in lookups.iter().filter(|lookup| lookup.1 > 0) {
        let [x, y] = [x, y].map(|along| u64::from(along / side * side));
        let cell = cells.entry((y, x)).or_default();
        cell.0 += u64::from(lines);
        cell.1 += u64::from(misses);
    }
    cells
}

fn found(map: &MissMap) -> BTreeMap<(u64, u64), (u64, u64)> {
    let cell = |cell: HeatCell| ((cell.pixel_y, cell.pixel_x), (cell.lookups, cell.misses));
    map.cells().map(cell).collect()
}

#[test]
fn all_cells_add_up_to_the_run() {
    for unit in units() {
        let (seen, _) = Seen::of(&unit);
        for side in [1, 2, 8] {
            let mut map = MissMap::new(side);
            let timing = run(&unit, &mut map);
            let summary = map.summary();
            assert_eq!(summary.cell_pixels, side);
            let sums = (summary.lookups, summary.misses);
            assert_eq!(sums, (timing.lookups, timing.misses));
            assert_eq!(found(&map), expected(&seen.lookups, side));
        }
    }
}

proptest! {
    #[test]
    fn a_larger_screen_makes_larger_cells_and_loses_nothing(
        lookups in prop::collection::vec(
            ((0..32_u32).prop_flat_map(|bits| [0..=u32::MAX >> bits, 0..=u32::MAX >> bits]), 1..9_u32, 0..9_u32),
            1..20,
        ),
    ) {
        let mut map = MissMap::new(1);
        for &(pixel, lines, misses) in &lookups {
            map.lookup(pixel, lines, misses);
        }
        let side = map.summary().cell_pixels;
        let far = lookups.iter().flat_map(|lookup| lookup.0).max().unwrap();
        prop_assert!(far / side < 1024);
        prop_assert!(side == 1 || far / (side / 2) >= 1024);
        prop_assert_eq!(found(&map), expected(&lookups, side));
    }
}

#[test]
fn text_and_json_have_every_cell() {
    let [unit, ..] = units();
    let mut map = MissMap::default();
    run(&unit, &mut map);
    let cells: Vec<HeatCell> = map.cells().collect();
    let (mut text, mut json) = (Vec::new(), Vec::new());
    map.write_csv(&mut text).unwrap();
    map.write_json(&mut json).unwrap();
    let mut reader = csv::Reader::from_reader(text.as_slice());
    let header = ["pixel_x", "pixel_y", "lookups", "misses"];
    assert_eq!(
        reader.headers().unwrap(),
        &csv::StringRecord::from(&header[..])
    );
    let rows: Vec<[u64; 4]> = reader.deserialize().map(Result::unwrap).collect();
    let numbers = |cell: &HeatCell| [cell.pixel_x, cell.pixel_y, cell.lookups, cell.misses];
    assert_eq!(rows, cells.iter().map(numbers).collect::<Vec<_>>());
    let json: serde_json::Value = serde_json::from_slice(&json).unwrap();
    assert_eq!(json["map"], serde_json::to_value(&cells).unwrap());
    assert_eq!(json["misses"], map.summary().misses);
}

#[test]
fn a_picture_has_a_square_for_each_cell_and_a_legend() {
    let mut map = MissMap::new(1);
    map.lookup([0, 0], 4, 0);
    map.lookup([1, 0], 4, 1);
    map.lookup([1, 1], 4, 4);
    map.lookup([3, 1], 8, 2);
    for (value, colours) in [
        (HeatValue::Misses, [0.0, 0.25, 1.0, 0.5]),
        (HeatValue::Lookups, [0.5, 0.5, 0.5, 1.0]),
        (HeatValue::MissRate, [0.0, 0.25, 1.0, 0.25]),
    ] {
        let mut file = Vec::new();
        map.write_png(&mut file, value).unwrap();
        let picture = image::load_from_memory(&file).unwrap().to_rgb8();
        // 4 by 2 cells of 16 pixels, and a strip of 256 colours below.
        assert_eq!(picture.width(), 256);
        let cell = |x: u32, y: u32| *picture.get_pixel(16 * x + 7, 16 * y + 7);
        let strip = |share: f64| *picture.get_pixel((share * 255.0).round() as u32, 40);
        let near = |a: image::Rgb<u8>, b: image::Rgb<u8>| {
            (0..3).all(|channel| a.0[channel].abs_diff(b.0[channel]) <= 1)
        };
        let cells = [cell(0, 0), cell(1, 0), cell(1, 1), cell(3, 1)];
        for (cell, share) in cells.into_iter().zip(colours) {
            assert!(near(cell, strip(share)), "{value:?} {share}: {cell:?}");
        }
        // Nothing was looked up there.
        assert_eq!(cell(2, 0), image::Rgb([221; 3]));
        // Black digits at both ends.
        let black = |mut columns: std::ops::Range<u32>| {
            columns.any(|x| {
                (46..66).any(|y| y < picture.height() && picture.get_pixel(x, y).0 == [0; 3])
            })
        };
        assert!(black(0..8) && black(240..256));
    }
}

#[test]
fn an_empty_map_is_a_legend() {
    let map = MissMap::default();
    let mut file = Vec::new();
    map.write_png(&mut file, HeatValue::MissRate).unwrap();
    assert!(image::load_from_memory(&file).is_ok());
    assert_eq!(map.cells().count(), 0);
}
