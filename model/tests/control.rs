//! Controls: where plain textures lie, held to the definition at every texel of small sizes.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use ntmu_isa::layout::BASE_ALIGNMENT;
use ntmu_isa::position::AddressMode;
use ntmu_isa::preset::Preset;
use ntmu_isa::shape::Shape;
use ntmu_model::control::{Bc7, ControlError, MAX_SIDE, Order, Plain};
use ntmu_model::trace::{Addresses, Fetch};
use ntmu_model::{Place, Request};
use std::collections::BTreeMap;

fn shape(width: u32, height: u32) -> Shape {
    let mip_count = Shape::max_mip_count(width, height);
    Preset::ALL[0].shape(width, height, mip_count, Vec::new())
}

const ORDERS: [Order; 6] = [
    Order::Rows,
    Order::Blocked { side: 2 },
    Order::Blocked { side: 8 },
    Order::Morton { side: 2 },
    Order::Morton { side: 4 },
    Order::Morton { side: MAX_SIDE },
];

/// A control, texels along the side of its elements, and their bytes.
fn controls(shape: &Shape, maps: u16, order: Order) -> [(Box<dyn Addresses>, u32, u32); 2] {
    [
        (Box::new(Bc7::new(shape, maps, order).unwrap()), 4, 16),
        (Box::new(Plain::new(shape, maps, order).unwrap()), 1, 4),
    ]
}

fn fetches(control: &dyn Addresses, place: &Place) -> Vec<Fetch> {
    let mut fetches = Vec::new();
    control.fetches(place, &mut fetches);
    fetches
}

/// The address of the texel in the first map.
fn address(control: &dyn Addresses, shape: &Shape, x: u32, y: u32, mip: u8) -> u64 {
    let request = Request::new(shape, x, y, mip).unwrap();
    fetches(control, &Place::of(request))[0].addresses[0]
}

fn texels(shape: &Shape) -> impl Iterator<Item = Request> {
    (0..shape.mip_count).flat_map(|mip| Request::blocks(shape, mip))
}

/// Small sizes, most of them not square and no powers of two.
fn sizes() -> impl Iterator<Item = (u32, u32)> {
    let sides = [1, 2, 3, 4, 5, 8, 11, 16, 17, 37];
    sides
        .into_iter()
        .flat_map(move |w| sides.into_iter().map(move |h| (w, h)))
}

#[test]
fn every_element_of_every_map_has_bytes_of_its_own_within_the_total_and_its_texels_share_them() {
    for ((width, height), order) in sizes().flat_map(|size| ORDERS.map(|order| (size, order))) {
        let shape = shape(width, height);
        for (control, side, bytes) in controls(&shape, 3, order) {
            // By address: the map, the mip and the element there.
            let mut taken = BTreeMap::new();
            for request in texels(&shape) {
                let fetches = fetches(control.as_ref(), &Place::of(request));
                assert_eq!(fetches.len(), 3);
                for (map, fetch) in fetches.iter().enumerate() {
                    let [address, ..] = fetch.addresses;
                    assert_eq!(fetch.addresses, [address; 4]);
                    assert_eq!((fetch.cell_bytes, fetch.planes), (bytes, 1));
                    let (x, y) = (request.x() / side, request.y() / side);
                    let element = (map, request.mip(), x, y);
                    assert_eq!(*taken.entry(address).or_insert(element), element);
                }
            }
            let elements: u32 = (0..shape.mip_count)
                .map(|mip| shape.mip_size(mip))
                .map(|(w, h)| w.div_ceil(side) * h.div_ceil(side))
                .sum();
            assert_eq!(taken.len(), 3 * elements as usize, "{width}x{height}");
            let starts: Vec<u64> = taken.into_keys().collect();
            let size = u64::from(bytes);
            assert!(starts.windows(2).all(|pair| pair[0] + size <= pair[1]));
            assert!(starts.last().unwrap() + size <= control.bytes());
        }
    }
}

#[test]
fn maps_and_mips_share_no_line_of_any_cache() {
    for (width, height) in sizes() {
        let shape = shape(width, height);
        for (control, ..) in controls(&shape, 3, Order::Rows) {
            let mut owners = BTreeMap::new();
            for request in texels(&shape) {
                let fetches = fetches(control.as_ref(), &Place::of(request));
                for (map, fetch) in fetches.iter().enumerate() {
                    let owner = (map, request.mip());
                    let line = fetch.addresses[0] / BASE_ALIGNMENT;
                    assert_eq!(*owners.entry(line).or_insert(owner), owner);
                }
            }
        }
    }
}

#[test]
fn the_total_is_that_of_the_formats() {
    // Blocks of 16 bytes: 64, 16, 4, 1 of them, the last two mips again one; all but the first two
    // mips fill part of 256 bytes.
    let set = shape(32, 32);
    let bc7 = |maps, order| Bc7::new(&set, maps, order).unwrap().bytes();
    assert_eq!(bc7(1, Order::Rows), 1024 + 256 + 3 * 256 + 16);
    assert_eq!(
        bc7(3, Order::Rows),
        2 * (1024 + 5 * 256) + 1024 + 4 * 256 + 16
    );
    // Tiles of 4 × 4 blocks, 256 bytes.
    assert_eq!(bc7(1, Order::Morton { side: 4 }), 1024 + 5 * 256);
    // Texels of 4 bytes: 1024, 256, 64, 16, 4, 1.
    let plain = |order| Plain::new(&set, 1, order).unwrap().bytes();
    assert_eq!(plain(Order::Rows), 4096 + 1024 + 256 + 256 + 256 + 4);
    assert_eq!(
        plain(Order::Blocked { side: 4 }),
        4096 + 1024 + 256 + 256 + 256 + 64
    );
}

/// The texels of mip 0 that share a line of `bytes` with texel (0, 0).
fn line(control: &dyn Addresses, shape: &Shape, bytes: u64) -> Vec<(u32, u32)> {
    let all = (0..shape.height).flat_map(|y| (0..shape.width).map(move |x| (x, y)));
    all.filter(|&(x, y)| address(control, shape, x, y, 0) / bytes == 0)
        .collect()
}

fn rectangle(width: u32, height: u32) -> Vec<(u32, u32)> {
    let rows = 0..height;
    rows.flat_map(|y| (0..width).map(move |x| (x, y))).collect()
}

#[test]
fn a_line_is_the_rectangle_of_texels_that_the_order_says() {
    let set = shape(40, 24);
    let plain = |order, bytes| line(&Plain::new(&set, 1, order).unwrap(), &set, bytes);
    assert_eq!(plain(Order::Rows, 64), rectangle(16, 1));
    assert_eq!(plain(Order::Blocked { side: 4 }, 64), rectangle(4, 4));
    assert_eq!(plain(Order::Blocked { side: 8 }, 64), rectangle(8, 2));
    assert_eq!(plain(Order::Blocked { side: 8 }, 256), rectangle(8, 8));
    assert_eq!(plain(Order::Morton { side: 8 }, 64), rectangle(4, 4));
    assert_eq!(plain(Order::Morton { side: 8 }, 128), rectangle(8, 4));
    let bc7 = |order, bytes| line(&Bc7::new(&set, 1, order).unwrap(), &set, bytes);
    assert_eq!(bc7(Order::Rows, 64), rectangle(16, 4));
    assert_eq!(bc7(Order::Morton { side: 4 }, 64), rectangle(8, 8));
    assert_eq!(bc7(Order::Blocked { side: 4 }, 256), rectangle(16, 16));
}

#[test]
fn elements_are_stored_as_the_order_defines() {
    // Seven columns of texels, padded to eight: a step of each kind.
    let set = shape(7, 9);
    let at = |order, x, y| address(&Plain::new(&set, 1, order).unwrap(), &set, x, y, 0) / 4;
    for (y, x) in (0..9).flat_map(|y| (0..7).map(move |x| (y, x))) {
        assert_eq!(at(Order::Rows, x, y), u64::from(7 * y + x));
        let tile = u64::from(y / 4 * 2 + x / 4) * 16;
        let blocked = u64::from(y % 4 * 4 + x % 4);
        assert_eq!(at(Order::Blocked { side: 4 }, x, y), tile + blocked);
        let morton = (x & 1) + 2 * (y & 1) + 4 * (x >> 1 & 1) + 8 * (y >> 1 & 1);
        assert_eq!(
            at(Order::Morton { side: 4 }, x, y),
            tile + u64::from(morton)
        );
    }
}

#[test]
fn a_place_anywhere_in_a_texel_fetches_it_and_one_outside_what_the_address_mode_says() {
    for mode in AddressMode::ALL {
        let set = Shape {
            address_mode: mode,
            ..shape(6, 5)
        };
        let plain = Plain::new(&set, 1, Order::Rows).unwrap();
        for (mip, bits) in (0..set.mip_count).flat_map(|mip| [1, 2, 5].map(|bits| (mip, bits))) {
            let (width, height) = set.mip_size(mip);
            for (x, y) in (-20_i64..26).flat_map(|x| [-7_i64, 0, 4, 9].map(|y| (x, y))) {
                let inside = [
                    mode.resolve(x as i32, width),
                    mode.resolve(y as i32, height),
                ];
                let expected = address(&plain, &set, inside[0], inside[1], mip);
                for part in 0..1 << bits {
                    let coordinates = [(x << bits) + part, (y << bits) + part];
                    let place = Place::new(&set, coordinates, bits, mip, 0, 0).unwrap();
                    assert_eq!(fetches(&plain, &place)[0].addresses, [expected; 4]);
                }
            }
        }
    }
}

#[test]
fn what_is_out_of_range_is_refused_by_name() {
    let refused = |change: &dyn Fn(&mut Shape), maps, order| {
        let mut shape = shape(8, 8);
        change(&mut shape);
        let error = Bc7::new(&shape, maps, order).unwrap_err();
        assert_eq!(Plain::new(&shape, maps, order).unwrap_err(), error);
        error
    };
    let as_is = |_: &mut Shape| ();
    assert_eq!(
        refused(&|s| s.width = 0, 1, Order::Rows).to_string(),
        "control.width: found 0; allowed: 1..=16384"
    );
    assert_eq!(
        refused(&|s| s.height = 16_385, 1, Order::Rows).to_string(),
        "control.height: found 16385; allowed: 1..=16384"
    );
    for found in [0, 5] {
        let error = refused(&|s| s.mip_count = found, 1, Order::Rows);
        assert_eq!(error, ControlError::Mips { found, limit: 4 });
    }
    for found in [0, 17] {
        let error = refused(&as_is, found, Order::Rows);
        assert_eq!(error, ControlError::Maps { found, limit: 16 });
    }
    for side in [0, 1, 3, 12, MAX_SIDE * 2] {
        for order in [Order::Blocked { side }, Order::Morton { side }] {
            let (found, limit) = (side, MAX_SIDE);
            assert_eq!(
                refused(&as_is, 1, order),
                ControlError::Side { found, limit }
            );
        }
    }
}
