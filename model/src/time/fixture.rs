//! What the tests run: small assets, their traces, and units.

use super::Unit;
use crate::request::Request;
use crate::trace::{Fetch, Trace};
use ntmu_isa::activation::Activation;
use ntmu_isa::asset::{Encoding, Map, Metadata, Parts};
use ntmu_isa::latent::LatentFormat;
use ntmu_isa::layer::{Layer, Skip};
use ntmu_isa::layout::Layout;
use ntmu_isa::position::{AddressMode, AxisPosition, CornerSnap};
use ntmu_isa::profile::Profile;
use ntmu_isa::rescale::Multiplier;
use ntmu_isa::shape::{GridShape, OutputFormat, Shape};
use ntmu_isa::{Asset, Program};

/// What a test says about an asset; the rest follows.
#[derive(Clone, Debug)]
pub(super) struct Sketch {
    pub(super) size: u32,
    pub(super) mip_count: u8,
    pub(super) grid_channels: [u16; 2],
    pub(super) octaves: u8,
    /// Outputs and activation of each hidden layer, and whether the layer before it is added.
    pub(super) hidden: Vec<(u16, Activation, bool)>,
    pub(super) channels: u16,
}

pub(super) fn asset(sketch: &Sketch) -> Asset {
    let scale = Multiplier::power_of_two(8);
    let grid = |channels| GridShape {
        channels,
        format: LatentFormat::new(4).unwrap(),
        scale_log2: 3,
    };
    let shape = Shape {
        width: sketch.size,
        height: sketch.size,
        mip_count: sketch.mip_count,
        octaves: sketch.octaves,
        snap: CornerSnap::Cell,
        address_mode: AddressMode::Wrap,
        grids: sketch.grid_channels.map(grid),
        outputs: vec![OutputFormat::Unorm8; usize::from(sketch.channels)],
    };
    let mut inputs = shape.input_count() as u16;
    let last = (sketch.channels, Activation::Identity, false);
    let mut layers = Vec::new();
    for &(outputs, activation, adds) in sketch.hidden.iter().chain([&last]) {
        layers.push(Layer {
            inputs,
            outputs,
            weights: vec![1; usize::from(inputs) * usize::from(outputs)],
            bias: vec![0; usize::from(outputs)],
            scales: vec![scale; usize::from(outputs)],
            zero_point: 0,
            activation,
            skip: adds.then_some(Skip { span: 1, scale }),
        });
        inputs = outputs;
    }
    let map = Map {
        name: "all".to_owned(),
        first_channel: 0,
        channel_count: sketch.channels,
        encoding: Encoding::Linear,
        bit_depth: 8,
    };
    let grids = [0, 1].map(|grid| vec![0; shape.grid_latents(grid) as usize]);
    let metadata = Metadata {
        maps: vec![map],
        ..Metadata::default()
    };
    Asset::new(Parts {
        shape,
        profile: Profile::NORMATIVE,
        grids,
        weight_bits: 8,
        layers,
        metadata,
    })
    .unwrap()
}

/// The fetches that the program of `layout` makes for these requests, from the specification.
pub(super) fn trace_of(
    asset: &Asset,
    layout: Layout,
    requests: impl Iterator<Item = Request>,
) -> Trace {
    let shape = &asset.shape;
    let mut trace = Trace::new();
    for request in requests {
        for (index, grid) in shape.grids.iter().enumerate() {
            let corners = |texel, size| {
                AxisPosition::of(texel, request.mip(), grid.scale_log2, shape.snap)
                    .corners(size, shape.address_mode)
            };
            let (width, height) = shape.grid_size(index);
            let (x, y) = (corners(request.x(), width), corners(request.y(), height));
            let cells = [(x[0], y[0]), (x[1], y[0]), (x[0], y[1]), (x[1], y[1])];
            trace.fetch(Fetch {
                grid: index as u8,
                addresses: cells.map(|(x, y)| layout.address(shape, index, x, y)),
                cell_bytes: Layout::cell_bytes(shape, index) as u32,
            });
        }
        trace.end_texel();
    }
    trace
}

/// Everything a run needs, for the blocks of a mip.
pub(super) fn scan(sketch: &Sketch, layout: Layout) -> (Asset, Program, Trace) {
    let asset = asset(sketch);
    let program = Program::compile(&asset, layout);
    let trace = trace_of(&asset, layout, Request::blocks(&asset.shape, 0));
    (asset, program, trace)
}

/// The preset `mobile` with some fields changed.
pub(super) fn unit(changes: &[(&str, u32)]) -> Unit {
    let mut configuration = *Unit::mobile().configuration();
    for &(name, value) in changes {
        configuration.set(name, value).unwrap();
    }
    Unit::new("test", configuration).unwrap()
}

pub(super) fn tiny() -> Sketch {
    Sketch {
        size: 8,
        mip_count: 1,
        grid_channels: [1, 1],
        octaves: 0,
        hidden: Vec::new(),
        channels: 1,
    }
}

/// A synthesizer so small that the front end decides.
pub(super) fn thin() -> Sketch {
    Sketch {
        size: 256,
        grid_channels: [8, 8],
        ..tiny()
    }
}

pub(super) fn hardware_sized() -> Sketch {
    let relu = (64, Activation::Relu, false);
    let skip = (64, Activation::Leaky { shift: 3 }, true);
    Sketch {
        size: 64,
        mip_count: 3,
        grid_channels: [8, 16],
        octaves: 3,
        hidden: vec![relu, relu, skip],
        channels: 9,
    }
}

/// A trace of single cells of one byte at these addresses, one fetch a texel.
pub(super) fn addresses(addresses: &[[u64; 4]]) -> Trace {
    let mut trace = Trace::new();
    for &addresses in addresses {
        trace.fetch(Fetch {
            grid: 0,
            addresses,
            cell_bytes: 1,
        });
        trace.end_texel();
    }
    trace
}
