//! Claims about layouts: orders, names, bytes and steps.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use ntmu_isa::latent::LatentFormat;
use ntmu_isa::layout::{BASE_ALIGNMENT, Inside, Layout, LayoutError, Order, Side, Storage};
use ntmu_isa::pyramid::Pyramid;
use ntmu_isa::shape::{GridShape, OutputFormat, Sampling, Shape};
use proptest::prelude::*;
use std::collections::BTreeSet;

/// A shape of these texels with two grids of channels, bits and log2 of the scale.
fn shape(width: u32, height: u32, grids: [(u16, u8, u8); 2]) -> Shape {
    Shape {
        mip_count: 1,
        ..Shape::whole_chain(
            width,
            height,
            grids.map(|(channels, bits, scale_log2)| GridShape {
                channels,
                format: LatentFormat::new(bits).unwrap(),
                scale_log2,
                sampling: Sampling::Corners,
            }),
            vec![OutputFormat::Unorm8],
        )
    }
}

fn layout(name: &str) -> Layout {
    name.parse().unwrap()
}

/// Codes that differ from cell to cell and channel to channel, with every bit set somewhere.
fn codes(shape: &Shape, grid: usize) -> Vec<u8> {
    let max = shape.grids[grid].format.max_code();
    let latents = 0..shape.grid_latents(grid);
    latents
        .map(|i| (i.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 56) as u8 & max)
        .collect()
}

/// The same shape with its whole chain and this pyramid.
fn with_pyramid(shape: Shape, pyramid: Pyramid) -> Shape {
    Shape {
        mip_count: Shape::max_mip_count(shape.width, shape.height),
        pyramid,
        ..shape
    }
}

/// Every cell of a grid as (level, x, y).
fn cells(shape: &Shape, grid: usize) -> Vec<(u8, u32, u32)> {
    let levels = 0..shape.level_count();
    let of = |level| {
        let (width, height) = shape.level_size(grid, level);
        rows(width, height)
            .into_iter()
            .map(move |(x, y)| (level, x, y))
    };
    levels.flat_map(of).collect()
}

/// Every code has bits of its own within the bytes that its cell is said to touch, and returns from
/// the image.
fn assert_lossless(layout: Layout, shape: &Shape) {
    let total = layout.total_bytes(shape);
    let mut taken = vec![0_u8; total as usize];
    for grid in 0..2 {
        let bits = u64::from(shape.grids[grid].format.bits());
        let planes = u64::from(layout.planes(shape, grid));
        let cell_bytes = layout.cell_bytes(shape, grid);
        for (level, x, y) in cells(shape, grid) {
            let address = layout.address(shape, grid, level, x, y);
            for channel in 0..usize::from(shape.grids[grid].channels) {
                let first = layout.first_bit(shape, grid, level, x, y, channel);
                let plane = if planes == 1 { 0 } else { channel as u64 };
                let start = address + plane * layout.plane_bytes(shape, grid, level);
                assert!(start + cell_bytes <= total, "{layout}");
                for bit in first..first + bits {
                    let byte = bit / 8;
                    assert!(
                        (start..start + cell_bytes).contains(&byte),
                        "{layout} {shape:?}"
                    );
                    let mask = 1 << (bit % 8);
                    assert_eq!(taken[byte as usize] & mask, 0, "{layout} {shape:?}");
                    taken[byte as usize] |= mask;
                }
            }
        }
    }
    let codes = [codes(shape, 0), codes(shape, 1)];
    let image = layout.pack(shape, [&codes[0], &codes[1]]);
    assert_eq!(image.len() as u64, total);
    assert_eq!(layout.unpack(shape, &image), codes, "{layout} {shape:?}");
    let strays = image
        .iter()
        .zip(&taken)
        .any(|(byte, taken)| byte & !taken != 0);
    assert!(!strays, "{layout}: the padding is zeros");
}

#[test]
fn every_width_and_channel_count_of_every_layout_returns_from_memory() {
    for layout in Layout::every() {
        for (channels, bits) in (1..=64).flat_map(|c| (1..=8).map(move |b| (c, b))) {
            let other = (65 - channels, 9 - bits, 3);
            assert_lossless(layout, &shape(40, 24, [(channels, bits, 3), other]));
        }
    }
}

#[test]
fn every_small_size_of_every_layout_returns_from_memory() {
    for layout in Layout::every() {
        for (w, h) in (1..=9).flat_map(|w| (1..=9).map(move |h| (w, h))) {
            assert_lossless(layout, &shape(8 * w, 8 * h - 5, [(3, 3, 3), (2, 5, 2)]));
        }
    }
}

proptest! {
    #[test]
    fn codes_of_any_shape_return_from_the_memory_of_any_layout(
        layout in prop::sample::select(Layout::every().collect::<Vec<_>>()),
        width in 1_u32..300,
        height in 1_u32..300,
        grids in [(1_u16..6, 1_u8..=8, 1_u8..=3), (1_u16..6, 1_u8..=8, 1_u8..=3)],
        pyramid in prop::sample::select((0..=255).filter_map(Pyramid::from_code).collect::<Vec<_>>()),
    ) {
        let shape = with_pyramid(shape(width, height, grids), pyramid);
        assert_lossless(layout, &shape);
    }
}

#[test]
fn every_pyramid_in_every_layout_returns_from_memory() {
    for layout in Layout::every() {
        for pyramid in (0..=255).filter_map(Pyramid::from_code) {
            let sizes = shape(37, 70, [(3, 3, 1), (2, 5, 2)]);
            assert_lossless(layout, &with_pyramid(sizes, pyramid));
        }
    }
}

#[test]
fn levels_start_at_lines_of_their_own_and_level_0_where_a_single_level_does() {
    let single = shape(300, 140, [(5, 3, 2), (12, 4, 2)]);
    let several = with_pyramid(single.clone(), Pyramid::NTC);
    assert_eq!(several.level_count(), 4);
    for layout in Layout::every() {
        let mut starts = Vec::new();
        for (grid, level) in [0, 1].into_iter().flat_map(|g| (0..4).map(move |l| (g, l))) {
            let base = layout.base(&several, grid, level);
            starts.push(base);
            // In a record the part of grid 1 comes after that of grid 0.
            let within = match layout.storage {
                Storage::Interleaved | Storage::Planar => 0,
                Storage::Together => base - layout.base(&several, 0, level),
            };
            assert_eq!((base - within) % BASE_ALIGNMENT, 0, "{layout}");
            if (grid, level) == (0, 0) {
                assert_eq!(base, layout.base(&single, 0, 0));
                let bytes = layout.level_bytes(&several, 0, 0);
                assert_eq!(bytes, layout.level_bytes(&single, 0, 0));
            }
            assert!(
                base + layout.level_bytes(&several, grid, level) <= layout.total_bytes(&several)
            );
        }
        let distinct: BTreeSet<u64> = starts.iter().copied().collect();
        assert_eq!(distinct.len(), starts.len(), "{layout}");
    }
}

/// The cells of a square of 2^`log2` in Morton order: its quadrants, each in Morton order.
fn quadrants(log2: u32) -> Vec<(u32, u32)> {
    match log2 {
        0 => vec![(0, 0)],
        _ => {
            let half = 1 << (log2 - 1);
            [(0, 0), (half, 0), (0, half), (half, half)]
                .into_iter()
                .flat_map(|corner| shifted(&quadrants(log2 - 1), corner))
                .collect()
        }
    }
}

fn rows(width: u32, height: u32) -> Vec<(u32, u32)> {
    (0..height)
        .flat_map(|y| (0..width).map(move |x| (x, y)))
        .collect()
}

fn shifted(cells: &[(u32, u32)], (dx, dy): (u32, u32)) -> Vec<(u32, u32)> {
    cells.iter().map(|&(x, y)| (x + dx, y + dy)).collect()
}

/// The tiles of side `side` one after the other, the cells of each in the order `tile`.
fn tiled(tiles: &[(u32, u32)], side: u32, tile: &[(u32, u32)]) -> Vec<(u32, u32)> {
    tiles
        .iter()
        .flat_map(|&(x, y)| shifted(tile, (x * side, y * side)))
        .collect()
}

/// The cells of a padded grid in their order, by walking it.
fn walk(order: Order, width: u32, height: u32) -> Vec<(u32, u32)> {
    let tile = |side: Side, inside| match inside {
        Inside::Morton => quadrants(side.log2()),
        Inside::Rows => rows(side.cells(), side.cells()),
    };
    let spread = |side: u32, tile: &[(u32, u32)]| {
        let tiles = rows(width.div_ceil(side), height.div_ceil(side));
        tiled(&tiles, side, tile)
    };
    match order {
        Order::Linear => rows(width, height),
        Order::Tiles { side, inside } => spread(side.cells(), &tile(side, inside)),
        Order::Morton => {
            let side = width.min(height).next_power_of_two();
            spread(side, &quadrants(side.ilog2()))
        }
        Order::Super { side, inside } => {
            let block = tiled(&quadrants(3), side.cells(), &tile(side, inside));
            spread(8 * side.cells(), &block)
        }
    }
}

#[test]
fn every_order_is_that_of_a_walk_through_the_grid() {
    let sizes = [
        (1, 1),
        (1, 40),
        (40, 1),
        (7, 3),
        (33, 20),
        (64, 64),
        (16, 150),
    ];
    for order in Order::every() {
        for (width, height) in sizes {
            let cells = walk(order, width, height);
            assert_eq!(cells.len() as u64, order.cells(width, height), "{order}");
            for (index, (x, y)) in (0..).zip(cells) {
                if x < width && y < height {
                    assert_eq!(order.index(width, height, x, y), index, "{order} {x},{y}");
                }
            }
        }
    }
}

#[test]
fn no_two_named_layouts_put_the_same_codes_in_the_same_places() {
    // Three of the largest super-blocks along x: of two by two the rows would be Morton order again.
    let shape = shape(8 * 260, 8 * 150, [(2, 3, 3), (3, 5, 3)]);
    let codes = [codes(&shape, 0), codes(&shape, 1)];
    let images = Layout::named().into_iter().map(|layout| {
        layout.check(&shape).unwrap();
        layout.pack(&shape, [&codes[0], &codes[1]])
    });
    let images: BTreeSet<Vec<u8>> = images.collect();
    assert_eq!(images.len(), Layout::named().len());
    // Only what a second name for the same order would add is left out.
    let orders = |order: fn(&Order) -> bool| Order::every().filter(order).count();
    assert_eq!(
        (orders(|o| o.is_alias()), orders(|o| !o.is_alias())),
        (3, 15)
    );
    assert_eq!(Layout::named().len(), 15 * Storage::ALL.len());
    assert_eq!(Layout::every().count(), 18 * Storage::ALL.len());
}

#[test]
fn tiles_of_four_lie_where_they_always_did() {
    let shape = shape(100, 52, [(5, 3, 3), (12, 4, 3)]);
    // 13×7 cells become 4×2 tiles of 16 cells of 2 bytes, then to a multiple of 256.
    assert_eq!(Layout::TILED.base(&shape, 1, 0), 256);
    assert_eq!(Layout::TILED.total_bytes(&shape), 256 + 4 * 2 * 16 * 6);
    // Tile (2, 1) is the seventh; cell (1, 2) in it the tenth.
    assert_eq!(Layout::TILED.address(&shape, 0, 0, 9, 6), (6 * 16 + 9) * 2);
    assert_eq!(
        Layout::LINEAR.address(&shape, 1, 0, 9, 6),
        256 + (6 * 13 + 9) * 6
    );
}

#[test]
fn every_layout_returns_from_its_name_and_its_code() {
    let mut names = BTreeSet::new();
    let mut known = BTreeSet::new();
    for layout in Layout::every() {
        assert_eq!(layout.to_string().parse(), Ok(layout));
        assert_eq!(Layout::from_code(layout.code()), Some(layout));
        assert!(names.insert(layout.to_string()), "{layout}");
        assert!(known.insert(layout.code()), "{layout}");
    }
    for code in 0..=u16::MAX {
        assert_eq!(
            Layout::from_code(code).is_some(),
            known.contains(&code),
            "{code}"
        );
    }
    assert_eq!(Layout::LINEAR.code(), 0);
    assert_eq!(
        (Layout::LINEAR.to_string(), Layout::TILED.to_string()),
        ("linear".to_owned(), "tiles-4".to_owned())
    );
}

#[test]
fn a_name_that_is_nearly_one_is_refused_with_those_there_are() {
    for name in [
        "",
        "Linear",
        "linear ",
        "linear+",
        "+planar",
        "tiles",
        "tiles-04",
        "tiles-32",
        "tiles-4-morton",
        "morton-rows",
        "super-4+planar+together",
        "linear+together+planar",
    ] {
        let refusal = name.parse::<Layout>().unwrap_err();
        let found = name.to_owned();
        assert_eq!(refusal, LayoutError::Name { found });
        assert_eq!(
            refusal.to_string(),
            format!(
                "layout: found {name:?}; allowed: linear, tiles-2, tiles-2-rows, tiles-4, tiles-4-rows, \
                 tiles-8, tiles-8-rows, tiles-16, tiles-16-rows, morton, super-2, super-2-rows, super-4, \
                 super-4-rows, super-8, super-8-rows, super-16, super-16-rows; each alone or with one of \
                 +planar, +together"
            )
        );
    }
}

#[test]
fn only_grids_of_one_size_are_stored_together() {
    let same = shape(100, 52, [(5, 3, 3), (12, 4, 3)]);
    let other = shape(100, 52, [(5, 3, 3), (12, 4, 2)]);
    for layout in Layout::every() {
        assert_eq!(layout.check(&same), Ok(()));
        let is_apart = layout.storage != Storage::Together;
        assert_eq!(layout.check(&other).is_ok(), is_apart, "{layout}");
    }
    assert_eq!(
        layout("tiles-4+together")
            .check(&other)
            .unwrap_err()
            .to_string(),
        "layout tiles-4+together: found grids of 13x7 and 25x13 cells; allowed: grids of one size, or `tiles-4`"
    );
}

#[test]
fn a_record_holds_the_cell_of_grid_0_and_then_that_of_grid_1() {
    let shape = shape(100, 52, [(5, 3, 3), (12, 4, 3)]);
    for layout in Layout::named() {
        if layout.storage != Storage::Together {
            continue;
        }
        for (x, y) in rows(13, 7) {
            let [first, second] = [0, 1].map(|grid| layout.address(&shape, grid, 0, x, y));
            assert_eq!(second, first + layout.cell_bytes(&shape, 0));
            assert_eq!(first % 8, 0, "records of 2 and 6 bytes");
        }
        assert_eq!(layout.total_bytes(&shape), 8 * layout.order.cells(13, 7));
    }
}

#[test]
fn planes_start_at_lines_and_no_code_straddles_bytes() {
    for (layout, bits) in Layout::named()
        .into_iter()
        .filter(|layout| layout.storage == Storage::Planar)
        .flat_map(|layout| (1..=8).map(move |bits| (layout, bits)))
    {
        let shape = shape(100, 52, [(5, bits, 3), (12, bits, 2)]);
        for (grid, channels) in [(0, 5), (1, 12)] {
            assert_eq!(layout.base(&shape, grid, 0) % BASE_ALIGNMENT, 0);
            assert_eq!(layout.plane_bytes(&shape, grid, 0) % BASE_ALIGNMENT, 0);
            assert_eq!(layout.planes(&shape, grid), channels);
            assert_eq!(layout.cell_bytes(&shape, grid), 1);
            let (width, height) = shape.grid_size(grid);
            for (x, y) in rows(width, height) {
                let first = layout.first_bit(&shape, grid, 0, x, y, 4);
                assert!(first % 8 + u64::from(bits) <= 8, "{layout}");
            }
        }
    }
}

#[test]
fn steps_are_one_for_rows_of_tiles_one_for_the_base_and_one_for_each_further_plane() {
    let wide = shape(800, 400, [(5, 3, 3), (12, 4, 3)]);
    let steps =
        |name: &str, shape: &Shape| [0, 1].map(|grid| layout(name).address_steps(shape, grid));
    assert_eq!(steps("linear", &wide), [2, 2]);
    assert_eq!(steps("tiles-4-rows", &wide), [2, 2]);
    assert_eq!(steps("super-4", &wide), [2, 2]);
    assert_eq!(steps("morton", &wide), [1, 1]);
    assert_eq!(steps("tiles-4+together", &wide), [2, 2]);
    assert_eq!(steps("tiles-4+planar", &wide), [1 + 5, 1 + 12]);
    assert_eq!(steps("morton+planar", &wide), [5, 12]);
    assert_eq!(steps("super-16-rows+planar", &wide), [1 + 5, 1 + 12]);
    // The generator is the same for a grid of a single cell.
    let cell = shape(8, 8, [(5, 3, 3), (12, 4, 3)]);
    for layout in Layout::every() {
        for grid in 0..2 {
            let found = layout.address_steps(&cell, grid);
            assert_eq!(found, layout.address_steps(&wide, grid), "{layout}");
        }
    }
}
