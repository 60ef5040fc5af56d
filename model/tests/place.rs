//! Claims about decoding between texels, outside the mip, and between mips.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
#![allow(dead_code, reason = "the fixture serves several tests")]

mod fixture;

use fixture::{Random, asset_of, half, integer, power, shape};
use ntmu_isa::activation::Activation;
use ntmu_isa::filter::FilterRule;
use ntmu_isa::layer::Layer;
use ntmu_isa::layout::Layout;
use ntmu_isa::position::{AddressMode, AxisPosition, CornerSnap};
use ntmu_isa::profile::Profile;
use ntmu_isa::pyramid::Pyramid;
use ntmu_isa::shape::{OutputFormat, Sampling, Shape};
use ntmu_isa::{Asset, Program};
use ntmu_model::exec::{Corners, Decoder, Probe};
use ntmu_model::{Place, PlaceError, Request};

/// A set of 64×32 texels and 7 mips, whose grids are as large and half as large in every direction as
/// `scales` say, with random latents and one layer that depends on every input.
fn textured(scales: [u8; 2], mode: AddressMode, snap: CornerSnap, profile: Profile) -> Asset {
    pyramid_of(Pyramid::SINGLE, scales, mode, snap, profile)
}

/// The same with a pyramid.
fn pyramid_of(
    pyramid: Pyramid,
    scales: [u8; 2],
    mode: AddressMode,
    snap: CornerSnap,
    profile: Profile,
) -> Asset {
    let mut shape = shape(4, 12, &[OutputFormat::Unorm16; 3]);
    shape.pyramid = pyramid;
    (shape.width, shape.height, shape.mip_count) = (64, 32, 7);
    (shape.octaves, shape.snap, shape.address_mode) = (3, snap, mode);
    shape.grids[1].sampling = Sampling::Corners;
    for (grid, scale) in shape.grids.iter_mut().zip(scales) {
        grid.scale_log2 = scale;
    }
    let mut random = Random(4);
    let grids = [0, 1].map(|grid| {
        let latents = 0..shape.grid_latents(grid);
        latents.map(|_| random.below(256) as u8).collect()
    });
    let inputs = shape.input_count() as usize;
    let rows: Vec<Vec<i8>> = (0..3)
        .map(|_| (0..inputs).map(|_| random.signed(8) as i8).collect())
        .collect();
    let rows: Vec<&[i8]> = rows.iter().map(Vec::as_slice).collect();
    let layer = integer(&rows, &[40_000_000; 3], power(11), Activation::Identity);
    asset_of(shape, grids, profile, vec![layer])
}

/// What a decode wrote as inputs, by stage.
#[derive(Default)]
struct Inputs {
    all: Vec<i16>,
    lerp: Vec<i16>,
    concat: Vec<i16>,
    level: Vec<i16>,
    corners: [Corners; 2],
}

impl Probe for Inputs {
    fn position(&mut self, grid: usize, corners: &Corners) {
        self.corners[grid] = *corners;
    }

    fn embedded(&mut self, stage: &'static str, _lane: u16, inputs: &[i16]) {
        self.all.extend(inputs);
        match stage {
            "lerp" => self.lerp = inputs.to_vec(),
            "concat" => self.concat = inputs.to_vec(),
            "level" => self.level = inputs.to_vec(),
            _ => {}
        }
    }
}

fn inputs(decoder: &Decoder, place: &Place) -> Inputs {
    let mut inputs = Inputs::default();
    decoder.place(place, &mut inputs);
    inputs
}

/// A place of a mip at the mip's own level.
fn at(shape: &Shape, x: i64, y: i64, bits: u8, mip: u8) -> Place {
    Place::new(shape, [x, y], bits, mip, u32::from(mip), 0).unwrap()
}

#[test]
fn the_centre_of_every_texel_decodes_as_the_texel_while_four_bits_are_exact() {
    for subtexel_bits in [4, 5, 8, 12] {
        for interpolate in FilterRule::ALL {
            let profile = Profile {
                subtexel_bits,
                interpolate,
                ..Profile::NORMATIVE
            };
            for snap in CornerSnap::ALL {
                let asset = textured([3, 2], AddressMode::Mirror, snap, profile);
                let program = Program::compile(&asset, Layout::LINEAR);
                let decoder = Decoder::new(&asset, &program);
                for request in (0..=5).flat_map(|mip| Request::blocks(&asset.shape, mip)) {
                    let texel = decoder.texel(request, &mut ());
                    assert_eq!(decoder.place(&Place::of(request), &mut ()), texel);
                    let bits = 1 + (request.x() % 12) as u8;
                    let centre = |texel| i64::from(2 * texel + 1) << (bits - 1);
                    let (x, y) = (centre(request.x()), centre(request.y()));
                    let place = at(&asset.shape, x, y, bits, request.mip());
                    assert_eq!(decoder.place(&place, &mut ()), texel);
                }
            }
        }
    }
}

#[test]
fn each_axis_of_a_place_is_its_position_in_each_grid() {
    for (mode, snap) in AddressMode::ALL
        .into_iter()
        .flat_map(|mode| CornerSnap::ALL.map(|snap| (mode, snap)))
    {
        // Mips 0 and 1, 2 and 3, and so on; each pair lies in its level as mips 0 and 1 in level 0.
        let pyramid = Pyramid::new(2, 2).unwrap();
        let asset = pyramid_of(pyramid, [3, 1], mode, snap, Profile::NORMATIVE);
        let program = Program::compile(&asset, Layout::LINEAR);
        let decoder = Decoder::new(&asset, &program);
        let mut random = Random(5);
        for _ in 0..500 {
            let mip = random.below(7) as u8;
            let level = mip / 2;
            let (x, y) = (random.signed(13).into(), random.signed(13).into());
            let found = inputs(&decoder, &at(&asset.shape, x, y, 6, mip)).corners;
            for (grid, found) in found.iter().enumerate() {
                let scale = asset.shape.grids[grid].scale_log2;
                let axis = |coordinate| AxisPosition::at(coordinate, 6, mip % 2, scale, snap, 8);
                let cells = |texels: u32| texels.div_ceil(1 << (scale + 2 * level));
                let (columns, rows) = (cells(64), cells(32));
                let expected = Corners {
                    level,
                    x: axis(x),
                    y: axis(y),
                    columns: axis(x).corners(columns, mode),
                    rows: axis(y).corners(rows, mode),
                };
                assert_eq!(*found, expected);
            }
        }
    }
}

#[test]
fn a_mip_and_its_blocks_are_their_texels() {
    let asset = textured(
        [3, 2],
        AddressMode::Wrap,
        CornerSnap::Cell,
        Profile::NORMATIVE,
    );
    let program = Program::compile(&asset, Layout::LINEAR);
    let decoder = Decoder::new(&asset, &program);
    for mip in 0..7 {
        let codes = decoder.mip(mip);
        for request in Request::blocks(&asset.shape, mip) {
            let (x, y) = (request.x() as usize, request.y() as usize);
            let texel = decoder.texel(request, &mut ());
            let of_mip: Vec<i32> = (0..3).map(|channel| codes[[channel, y, x]]).collect();
            assert_eq!(of_mip, texel);
            let block = decoder
                .block(request.x() / 4, request.y() / 4, mip)
                .unwrap();
            let of_block: Vec<i32> = (0..3)
                .map(|channel| block[[channel, y % 4, x % 4]])
                .collect();
            assert_eq!(of_block, texel);
        }
    }
}

#[test]
fn a_finer_phase_differs_where_four_bits_are_not_enough() {
    let phases = |subtexel_bits| {
        let profile = Profile {
            subtexel_bits,
            ..Profile::NORMATIVE
        };
        let asset = textured([1, 1], AddressMode::Wrap, CornerSnap::Stride, profile);
        let program = Program::compile(&asset, Layout::LINEAR);
        let request = Request::new(&asset.shape, 0, 0, 5).unwrap();
        let found = inputs(&Decoder::new(&asset, &program), &Place::of(request));
        (found.corners[0].x.phase, found.corners[0].x.phase_bits)
    };
    // (½·32/2 − ½) of a stride of 16 is 15/32.
    assert_eq!([4, 5, 8].map(phases), [(7, 4), (15, 5), (120, 8)]);
}

#[test]
fn between_two_cells_the_input_is_the_nearest_to_the_line() {
    // Two cells of 8 texels: their centres are at 4 and 12.
    let (left, right) = (-93, 117);
    let mut shape = shape(2, 12, &[OutputFormat::Float16]);
    shape.width = 16;
    shape.address_mode = AddressMode::Clamp;
    let code = |value: i32| shape.grids[0].format.code(value);
    let cells = vec![code(left), code(right)];
    let layer: Layer = half(&[&[1.0, 0.0, 0.0]], &[0.0], Activation::Identity);
    let asset = asset_of(
        shape,
        [cells.clone(), cells],
        Profile::NORMATIVE,
        vec![layer],
    );
    let program = Program::compile(&asset, Layout::LINEAR);
    let decoder = Decoder::new(&asset, &program);
    for x in -(4 << 8)..=20 << 8 {
        let found = inputs(&decoder, &at(&asset.shape, x, 9 << 7, 8, 0));
        // How far from the left centre, in 1/2^8 of a cell: rounded down, within the grid.
        let fraction = ((x - (4 << 8)) >> 3).clamp(0, 256);
        let sum = i64::from(left) * (256 - fraction) + i64::from(right) * fraction;
        // 1/2^16 to 1/2^11, ties up.
        let expected = (sum + (1 << 4)) >> 5;
        assert_eq!(found.lerp.len(), 1);
        // The second grid is sampled like the first and has the same cells.
        assert_eq!(i64::from(found.lerp[0]), expected, "x {x}");
    }
}

#[test]
fn a_wrapped_grid_repeats_with_the_mip_and_so_do_its_waves() {
    let asset = textured(
        [3, 2],
        AddressMode::Wrap,
        CornerSnap::Stride,
        Profile::NORMATIVE,
    );
    let program = Program::compile(&asset, Layout::TILED);
    let decoder = Decoder::new(&asset, &program);
    for (bits, mip) in [(1, 0), (4, 0), (8, 1), (12, 2), (3, 3)] {
        let (width, height) = asset.shape.mip_size(mip);
        let [width, height] = [width, height].map(|size| i64::from(size) << bits);
        for step in 0..60 {
            let (x, y) = (step * 37 % width, step * 101 % height);
            let here = decoder.place(&at(&asset.shape, x, y, bits, mip), &mut ());
            for (dx, dy) in [(1, 0), (0, 1), (-1, -1), (3, -5), (-100, 100)] {
                let there = at(&asset.shape, x + dx * width, y + dy * height, bits, mip);
                assert_eq!(decoder.place(&there, &mut ()), here);
            }
        }
    }
}

#[test]
fn a_mirrored_grid_is_reflected_at_its_edges_and_a_clamped_one_ends_there() {
    let mirrored = textured(
        [3, 3],
        AddressMode::Mirror,
        CornerSnap::Cell,
        Profile::NORMATIVE,
    );
    let program = Program::compile(&mirrored, Layout::LINEAR);
    let decoder = Decoder::new(&mirrored, &program);
    // In 1/2^5 texels a fraction of a cell of 8 texels is exact in 8 bits, on both sides.
    for x in 0..64 << 5 {
        let y = (x * 7) % (32 << 5);
        let lerp = |x, y| inputs(&decoder, &at(&mirrored.shape, x, y, 5, 0)).lerp;
        assert_eq!(lerp(-x, y), lerp(x, y));
        assert_eq!(lerp((128 << 5) - x, y), lerp(x, y));
        assert_eq!(lerp(x, -y), lerp(x, y));
    }
    let clamped = textured(
        [3, 3],
        AddressMode::Clamp,
        CornerSnap::Cell,
        Profile::NORMATIVE,
    );
    let program = Program::compile(&clamped, Layout::LINEAR);
    let decoder = Decoder::new(&clamped, &program);
    let lerp = |x, y| inputs(&decoder, &at(&clamped.shape, x, y, 5, 0)).lerp;
    for step in 0..200 {
        // Half a cell from the edge is the last cell's centre.
        assert_eq!(lerp(-step * 1000, 77), lerp(4 << 5, 77));
        assert_eq!(lerp((60 << 5) + step * 1000, 77), lerp(60 << 5, 77));
        assert_eq!(lerp(77, -step * 1000), lerp(77, 4 << 5));
        assert_eq!(lerp(77, (28 << 5) + step * 1000), lerp(77, 28 << 5));
    }
}

#[test]
fn the_level_is_the_place_s_and_not_the_mip_s() {
    let asset = textured(
        [3, 3],
        AddressMode::Clamp,
        CornerSnap::Cell,
        Profile::NORMATIVE,
    );
    let program = Program::compile(&asset, Layout::LINEAR);
    let decoder = Decoder::new(&asset, &program);
    for (mip, lod) in (0..7).flat_map(|mip| (0..=6 << 8).map(move |lod| (mip, lod))) {
        let place = Place::new(&asset.shape, [5, 9], 3, mip, lod, 8).unwrap();
        // 2047·lod / (6·256), ties up.
        let expected = (2 * 2047 * lod + 1536) / (2 * 1536);
        assert_eq!(inputs(&decoder, &place).level, [expected as i16]);
    }
    let with = |lod, lod_bits| {
        let place = Place::new(&asset.shape, [5, 9], 3, 2, lod, lod_bits).unwrap();
        inputs(&decoder, &place).all
    };
    assert_eq!(with(2, 0), with(512, 8));
    let corners_of = |lod| {
        let place = Place::new(&asset.shape, [5, 9], 3, 2, lod, 8).unwrap();
        inputs(&decoder, &place).concat
    };
    assert_eq!(corners_of(0), corners_of(1536));
}

#[test]
fn what_no_place_can_be_is_refused_with_what_is_allowed() {
    let asset = textured(
        [3, 3],
        AddressMode::Clamp,
        CornerSnap::Cell,
        Profile::NORMATIVE,
    );
    let refused = |xy, bits, mip, lod, lod_bits| {
        Place::new(&asset.shape, xy, bits, mip, lod, lod_bits)
            .unwrap_err()
            .to_string()
    };
    assert_eq!(
        refused([0, 0], 8, 7, 0, 8),
        "mip 7: the chain has mips 0..=6"
    );
    assert_eq!(
        refused([0, 0], 0, 0, 0, 8),
        "place.bits: found 0; allowed: 1..=12"
    );
    assert_eq!(
        refused([0, 0], 13, 0, 0, 8),
        "place.bits: found 13; allowed: 1..=12"
    );
    assert_eq!(
        refused([0, 0], 8, 0, 0, 9),
        "place.lod_bits: found 9; allowed: 0..=8"
    );
    assert_eq!(
        refused([0, -16_777_217], 8, 0, 0, 8),
        "place.coordinate: found -16777217; allowed: -16777216..=16777216"
    );
    assert_eq!(
        refused([0, 0], 8, 0, 1537, 8),
        "place.lod: found 1537; allowed: 0..=1536"
    );
    assert_eq!(
        Place::new(&asset.shape, [i64::MIN, 0], 1, 0, 0, 0),
        Err(PlaceError::Coordinate {
            found: i64::MIN,
            limit: 1 << 17
        })
    );
}

#[test]
fn places_at_the_ends_of_the_range_decode_to_channel_codes() {
    for (mode, snap) in AddressMode::ALL
        .into_iter()
        .flat_map(|mode| CornerSnap::ALL.map(|snap| (mode, snap)))
    {
        let asset = textured([1, 3], mode, snap, Profile::NORMATIVE);
        let program = Program::compile(&asset, Layout::TILED);
        let decoder = Decoder::new(&asset, &program);
        for (bits, mip) in (1..=12).flat_map(|bits| (0..7).map(move |mip| (bits, mip))) {
            let limit = 1_i64 << (16 + bits);
            for (x, y) in [
                (limit, -limit),
                (-limit, limit),
                (limit - 1, 1 - limit),
                (0, 0),
            ] {
                let codes = decoder.place(&at(&asset.shape, x, y, bits, mip), &mut ());
                assert!(codes.iter().all(|code| (0..=65_535).contains(code)));
            }
        }
    }
}

#[test]
fn the_trace_of_texels_is_that_of_their_centres_and_places_touch_their_own_cells() {
    let asset = textured(
        [3, 2],
        AddressMode::Wrap,
        CornerSnap::Cell,
        Profile::NORMATIVE,
    );
    let program = Program::compile(&asset, Layout::TILED);
    let decoder = Decoder::new(&asset, &program);
    let requests = || (0..7).flat_map(|mip| Request::blocks(&asset.shape, mip));
    let texels = decoder.trace(requests());
    assert_eq!(decoder.trace_places(requests().map(Place::of)), texels);
    let place = at(&asset.shape, -9, 1000, 4, 1);
    let trace = decoder.trace_places([place]);
    let corners = inputs(&decoder, &place).corners;
    for (fetch, corners) in trace.texel(0).iter().zip(corners) {
        let grid = usize::from(fetch.grid);
        let address = |(x, y)| Layout::TILED.address(&asset.shape, grid, 0, x, y);
        assert_eq!(fetch.addresses, corners.cells().map(address));
    }
}
