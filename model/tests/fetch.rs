//! Claims about what a fetch reads: the bytes that it names hold the codes that it gives.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
#![allow(dead_code, reason = "the fixture serves several tests")]

mod fixture;

use fixture::{Random, asset_of, integer, power, shape};
use ntmu_isa::activation::Activation;
use ntmu_isa::latent::LatentFormat;
use ntmu_isa::layout::Layout;
use ntmu_isa::position::AddressMode;
use ntmu_isa::profile::Profile;
use ntmu_isa::shape::OutputFormat;
use ntmu_isa::{Asset, Program};
use ntmu_model::Request;
use ntmu_model::exec::Decoder;

/// A set of 44×20 texels and 5 mips with random latents of 3 and 5 bits.
fn asset(scales: [u8; 2]) -> Asset {
    let mut shape = shape(8, 9, &[OutputFormat::Unorm8]);
    (shape.width, shape.height, shape.mip_count) = (44, 20, 5);
    shape.address_mode = AddressMode::Wrap;
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
    for asset in [asset([3, 3]), asset([3, 2])] {
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
                        layout.cell(shape, &touched, (grid, x, y), &mut read);
                        stored.extend(asset.cell(grid, x, y));
                    }
                    assert_eq!(tap.codes, stored, "{layout}: what the machine fetched");
                    assert_eq!(read, stored, "{layout}: what lies in the bytes it named");
                }
            }
        }
    }
}
