//! Claims about what a fetch reads: the bytes that it names hold the codes that it gives.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
#![allow(dead_code, reason = "the fixture serves several tests")]

mod fixture;

use fixture::{Random, asset_of, integer, power, shape};
use ntmu_isa::activation::Activation;
use ntmu_isa::latent::LatentFormat;
use ntmu_isa::layout::{Layout, Storage};
use ntmu_isa::position::AddressMode;
use ntmu_isa::profile::Profile;
use ntmu_isa::pyramid::Pyramid;
use ntmu_isa::shape::OutputFormat;
use ntmu_isa::{Asset, Program};
use ntmu_model::Request;
use ntmu_model::exec::Decoder;

/// A level for every mip but the first two.
const FINE: Pyramid = match Pyramid::new(2, 1) {
    Some(pyramid) => pyramid,
    None => panic!("1 ≤ each ≤ first"),
};

/// A set of 44×20 texels and 5 mips with random latents of 3 and 5 bits.
fn asset(scales: [u8; 2], pyramid: Pyramid) -> Asset {
    let mut shape = shape(8, 9, &[OutputFormat::Unorm8]);
    (shape.width, shape.height, shape.mip_count) = (44, 20, 5);
    shape.address_mode = AddressMode::Wrap;
    shape.pyramid = pyramid;
    let mut random = Random(7);
    for ((grid, scale), (channels, bits)) in
        shape.grids.iter_mut().zip(scales).zip([(3, 3), (5, 5)])
    {
        (grid.scale_log2, grid.channels) = (scale, channels);
        grid.format = LatentFormat::new(bits).unwrap();
    }
    let grids = [0, 1].map(|grid| {
        let codes = i64::from(shape.grids[grid].format.max_code()) + 1;
        let latents = 0..shape.grid_latents(grid);
        latents.map(|_| random.below(codes as u64) as u8).collect()
    });
    let row = vec![1; shape.input_count() as usize];
    let layer = integer(&[&row], &[0], power(4), Activation::Identity);
    asset_of(shape, grids, Profile::NORMATIVE, vec![layer])
}

#[test]
fn the_bytes_that_a_fetch_names_hold_the_codes_of_its_corners() {
    let sets = [Pyramid::SINGLE, Pyramid::NTC, Pyramid::EVERY_MIP, FINE]
        .into_iter()
        .flat_map(|pyramid| [[3, 3], [3, 2]].map(|scales| asset(scales, pyramid)));
    for asset in sets {
        let (shape, [grid0, grid1]) = (&asset.shape, &asset.grids);
        for layout in Layout::every() {
            let program = Program::compile(&asset, layout);
            let decoder = Decoder::new(&asset, &program);
            let image = layout.pack(shape, [grid0, grid1]);
            for request in (0..5).flat_map(|mip| Request::blocks(shape, mip).step_by(11)) {
                for tap in decoder.taps(request).grids {
                    let fetch = tap.fetch.unwrap();
                    let grid = usize::from(fetch.grid);
                    let mut touched = vec![0; image.len()];
                    for (address, plane) in fetch
                        .addresses
                        .into_iter()
                        .flat_map(|a| (0..u64::from(fetch.planes)).map(move |p| (a, p)))
                    {
                        let start = (address + plane * fetch.plane_bytes) as usize;
                        let part = start..start + fetch.cell_bytes as usize;
                        touched[part.clone()].copy_from_slice(&image[part]);
                    }
                    let mut read = Vec::new();
                    let mut stored = Vec::new();
                    for (x, y) in tap.corners.cells() {
                        let level = tap.corners.level;
                        layout.cell(shape, &touched, grid, (level, x, y), &mut read);
                        stored.extend(asset.cell(grid, level, x, y));
                    }
                    assert_eq!(tap.codes, stored, "{layout}: what the machine fetched");
                    assert_eq!(read, stored, "{layout}: what lies in the bytes it named");
                }
            }
        }
    }
}

#[test]
fn a_mip_reads_the_bytes_of_its_level_and_no_others() {
    for (pyramid, scales) in [Pyramid::SINGLE, Pyramid::NTC, Pyramid::EVERY_MIP, FINE]
        .into_iter()
        .flat_map(|pyramid| [[3, 3], [2, 3]].map(|scales| (pyramid, scales)))
    {
        let asset = asset(scales, pyramid);
        let shape = &asset.shape;
        for layout in [Layout::LINEAR, Layout::TILED, PLANAR] {
            let program = Program::compile(&asset, layout);
            let decoder = Decoder::new(&asset, &program);
            for mip in 0..shape.mip_count {
                let level = pyramid.level_of(mip);
                let trace = decoder.trace(Request::blocks(shape, mip));
                for fetch in trace.texels().flatten() {
                    let grid = usize::from(fetch.grid);
                    let start = layout.base(shape, grid, level);
                    let end = start + layout.level_bytes(shape, grid, level);
                    let last_plane = u64::from(fetch.planes - 1) * fetch.plane_bytes;
                    for first in fetch.addresses {
                        let last = first + last_plane + u64::from(fetch.cell_bytes);
                        assert!(start <= first && last <= end, "{layout}, mip {mip}");
                    }
                }
            }
        }
    }
}

/// Planes of tiles.
const PLANAR: Layout = Layout::TILED.with(Storage::Planar);
