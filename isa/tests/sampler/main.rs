//! The sampler against naive definitions in floats and rationals, which the specification itself does
//! without.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod blend;
mod coordinate;
mod footprint;
mod lod;
mod number;
mod plan;
mod state;

use ntmu_isa::latent::LatentFormat;
use ntmu_isa::shape::{GridShape, OutputFormat, Sampling, Shape};

/// A chain of `mip_count` mips with these channels; its grids take no part in sampling.
pub(crate) fn shape(size: [u32; 2], mip_count: u8, outputs: &[OutputFormat]) -> Shape {
    let grid = GridShape {
        channels: 1,
        format: LatentFormat::new(4).unwrap(),
        scale_log2: 3,
        sampling: Sampling::Interpolated,
    };
    Shape {
        mip_count,
        octaves: 1,
        ..Shape::whole_chain(size[0], size[1], [grid; 2], outputs.to_vec())
    }
}
