//! What holds of every experiment, on small scenes.

use super::divergence::{BINS, MATERIALS};
use super::fifo::{DEPTHS, ENOUGH};
use super::{Lab, Sizes, TimingRow, rows};
use ntmu_isa::Asset;
use std::sync::LazyLock;
use std::sync::atomic::{AtomicU64, Ordering};

static ASSET: LazyLock<Asset> = LazyLock::new(|| crate::built_in::asset().unwrap());

/// The rows, and the most that was said to be done.
static ROWS: LazyLock<(Vec<TimingRow>, u64)> = LazyLock::new(|| {
    let most = AtomicU64::new(0);
    let rows = rows::rows(&ASSET, &Sizes::QUICK, |done| {
        most.fetch_max(done, Ordering::Relaxed);
    });
    (rows.unwrap(), most.into_inner())
});

/// The experiments, and the most that was said to be done.
static LAB: LazyLock<(Lab, u64)> = LazyLock::new(|| {
    let most = AtomicU64::new(0);
    let lab = Lab::run(&ASSET, &Sizes::QUICK, |done| {
        most.fetch_max(done, Ordering::Relaxed);
    });
    (lab.unwrap(), most.into_inner())
});

#[test]
fn as_many_runs_are_reported_as_were_announced() {
    assert_eq!(ROWS.1, rows::row_count(&ASSET));
    assert_eq!(ROWS.0.len() as u64, rows::row_count(&ASSET));
    assert_eq!(LAB.1, Lab::runs(&ASSET));
}

#[test]
fn results_can_be_read_back_and_hold_no_number_that_is_none() {
    let value = serde_json::to_value(&LAB.0).unwrap();
    // serde_json writes a number that is not finite as null; a depth that is never enough is the only
    // other one.
    let text = value.to_string();
    let never = LAB.0.fifo.curves.iter();
    let never = never.filter(|curve| curve.enough_texels.is_none()).count();
    assert_eq!(text.matches("null").count(), never);
    assert_eq!(serde_json::from_value::<Lab>(value).unwrap(), LAB.0);

    let value = serde_json::to_value(&ROWS.0).unwrap();
    assert!(!value.to_string().contains("null"));
    let read: Vec<TimingRow> = serde_json::from_value(value).unwrap();
    assert_eq!(read, ROWS.0);
}

#[test]
fn every_ledger_adds_up_and_no_run_beats_its_bounds() {
    for row in &ROWS.0 {
        let charged: u64 = row.ledger.iter().map(|charge| charge.cycles).sum();
        assert_eq!(charged, row.cycles, "{} {}", row.identity, row.layout);
        assert!(row.closed_form_per_block <= row.cycles_per_block);
        assert!(row.critical_path_per_block <= row.closed_form_per_block);
        assert!((0.0..=1.0).contains(&row.hit_rate));
        assert!((0.0..=1.0).contains(&row.mac_utilisation));
    }
}

#[test]
fn bytes_lie_between_those_with_an_infinite_cache_and_those_without_one() {
    for row in &ROWS.0 {
        let what = format!("{} {} {}", row.identity, row.layout, row.scene);
        assert!(
            row.bytes_per_block_infinite_cache <= row.bytes_per_block,
            "{what}"
        );
        assert!(
            row.bytes_per_block <= row.bytes_per_block_without_cache,
            "{what}"
        );
    }
}

#[test]
fn cycles_lie_between_those_with_an_infinite_cache_and_those_without_one() {
    for row in &ROWS.0 {
        let what = format!("{} {} {}", row.identity, row.layout, row.scene);
        assert!(
            row.infinite_cache_per_block <= row.cycles_per_block,
            "{what}"
        );
        assert!(
            row.cycles_per_block <= row.without_cache_per_block,
            "{what}"
        );
    }
}

#[test]
fn a_deeper_fifo_is_never_slower_and_no_latency_is_never_beaten() {
    for curve in &LAB.0.fifo.curves {
        let what = format!("{} {}", curve.subject, curve.latency_cycles);
        assert!(curve.cycles.windows(2).all(|c| c[1] <= c[0]), "{what}");
        assert!(curve.relative.iter().all(|&share| share <= 1.0), "{what}");
        let enough = curve.relative.iter().position(|&share| share >= ENOUGH);
        assert_eq!(curve.enough_texels, enough.map(|index| DEPTHS[index]));
    }
}

#[test]
fn a_longer_latency_is_never_faster_at_any_depth() {
    let curves = &LAB.0.fifo.curves;
    for pair in curves.windows(2).filter(|p| p[0].subject == p[1].subject) {
        let depths = pair[0].cycles.iter().zip(&pair[1].cycles);
        assert!(depths.into_iter().all(|(short, long)| short <= long));
    }
}

#[test]
fn a_larger_cache_of_one_set_never_fetches_more() {
    // Least recently used and fully associative: a stack algorithm (Mattson and others 1970). Beyond
    // 256 ways there are sets, and it need not hold.
    for panel in &LAB.0.working_set.panels {
        for curve in &panel.curves {
            let one_set = &curve.bytes_per_pixel[..6];
            assert!(
                one_set.windows(2).all(|bytes| bytes[1] <= bytes[0]),
                "{} {}",
                panel.scene,
                curve.subject
            );
        }
    }
}

#[test]
fn one_material_comes_in_once_and_is_the_same_in_every_interleave() {
    let divergence = &LAB.0.divergence;
    assert_eq!(divergence.curves.len(), 2 * 3 * BINS.len());
    for curve in &divergence.curves {
        assert_eq!(curve.points.len(), MATERIALS.len());
        assert_eq!(curve.points[0].weight_fills, 1);
        let of_same_unit = divergence.curves.iter().filter(|other| {
            other.bins == curve.bins && other.weight_sram_bytes == curve.weight_sram_bytes
        });
        for other in of_same_unit {
            assert_eq!(other.points[0], curve.points[0]);
        }
        for (point, &materials) in curve.points.iter().zip(&divergence.materials) {
            // In larger tiles, not all of them are on so small a screen.
            if curve.interleave == "quads" {
                assert!(point.weight_fills >= materials as u64);
            }
        }
    }
}

#[test]
fn no_point_lies_above_its_roof() {
    let roofline = &LAB.0.roofline;
    for point in &roofline.points {
        let mut roofs = roofline.roofs.iter();
        let roof = roofs.find(|r| r.unit == point.unit && r.numbers == point.numbers);
        let roof = roof.unwrap();
        // A quotient and a product are rounded once each.
        let rounded = 1.0 + 4.0 * f64::EPSILON;
        assert!(point.macs_per_cycle <= roof.macs_per_cycle * rounded);
        let memory = roof.memory_bytes_per_cycle * point.macs_per_memory_byte;
        assert!(point.macs_per_cycle <= memory * rounded, "{point:?}");
        let cache = roof.cache_bytes_per_cycle * point.macs_per_cache_byte;
        assert!(point.macs_per_cycle <= cache * rounded, "{point:?}");
    }
}

#[test]
fn every_bar_has_every_part_of_the_energy_and_some_energy() {
    let energy = &LAB.0.energy;
    for bar in &energy.bars {
        assert_eq!(bar.picojoules_per_block.len(), energy.parts.len());
        assert!(bar.picojoules_per_block.iter().all(|&part| part >= 0.0));
        assert!(bar.picojoules_per_block.iter().sum::<f64>() > 0.0);
        assert!(bar.decodes_per_pixel > 0.0);
    }
}

#[test]
fn every_cell_of_the_grid_stands_there_once() {
    let study = &LAB.0.line_size;
    for grid in &study.grids {
        let mut names: Vec<String> = grid
            .cells
            .iter()
            .map(|cell| format!("{}{} {}", cell.order, cell.storage, cell.line_bytes))
            .collect();
        let count = names.len();
        names.sort();
        names.dedup();
        assert_eq!(names.len(), count);
        assert!(count > 0 && count.is_multiple_of(study.lines.len()));
    }
}

#[test]
fn the_map_of_misses_has_lookups_where_the_floor_is_and_none_in_the_sky() {
    let map = &LAB.0.miss_map;
    assert_eq!(map.lookups.len(), map.columns as usize * map.rows as usize);
    assert!(map.lookups.iter().zip(&map.misses).all(|(l, m)| m <= l));
    assert_eq!(map.lookups[0], 0, "the upper left corner is sky");
    assert!(map.lookups[map.lookups.len() - 1] > 0);
    assert!(map.misses.iter().sum::<u64>() > 0);
}
