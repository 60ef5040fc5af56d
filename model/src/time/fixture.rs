//! What the tests run: small assets, their traces, and units.

use super::Unit;
use crate::request::Request;
use crate::trace::{Fetch, Trace};
use ntmu_isa::activation::{Activation, TABLE_ENTRIES};
use ntmu_isa::asset::{Encoding, Map, Metadata, Parts};
use ntmu_isa::embed::Wave;
use ntmu_isa::half::Half;
use ntmu_isa::latent::LatentFormat;
use ntmu_isa::layer::{HalfParameters, IntegerParameters, Layer, Parameters, Quantize, Skip};
use ntmu_isa::layout::Layout;
use ntmu_isa::position::{AddressMode, AxisPosition, CornerSnap};
use ntmu_isa::profile::Profile;
use ntmu_isa::rescale::Multiplier;
use ntmu_isa::shape::{GridShape, OutputFormat, Sampling, Shape};
use ntmu_isa::{Asset, Program};

/// The arithmetic of a hidden layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// Integers whose outputs have so many bits.
    Integer(u8),
    /// Halves.
    Half,
}

/// A hidden layer.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hidden {
    pub(super) kind: Kind,
    pub(super) outputs: u16,
    pub(super) activation: Activation,
    /// Whether the layer before it is added. It has as many outputs, and a kind that allows it.
    pub(super) adds: bool,
}

impl Hidden {
    /// A layer of bytes.
    pub(super) fn bytes(outputs: u16, activation: Activation, adds: bool) -> Hidden {
        Hidden {
            kind: Kind::Integer(8),
            outputs,
            activation,
            adds,
        }
    }
}

/// What a test says about an asset; the rest follows.
#[derive(Clone, Debug)]
pub(super) struct Sketch {
    pub(super) size: u32,
    pub(super) mip_count: u8,
    pub(super) grid_channels: [u16; 2],
    pub(super) octaves: u8,
    pub(super) hidden: Vec<Hidden>,
    /// The arithmetic of the last layer; an integer one has 8 bits.
    pub(super) last: Kind,
    pub(super) channels: u16,
}

/// Numbers of a layer; `next` reads its output, `None` behind the last.
fn parameters(
    kind: Kind,
    next: Option<Kind>,
    inputs: u16,
    outputs: u16,
    table: bool,
) -> Parameters {
    let (macs, rows) = (
        usize::from(inputs) * usize::from(outputs),
        usize::from(outputs),
    );
    match kind {
        Kind::Integer(output_bits) => Parameters::Integer(IntegerParameters {
            weight_bits: 8,
            weights: vec![1; macs],
            bias: vec![0; rows],
            scales: vec![Multiplier::power_of_two(8); rows],
            output_bits,
            zero_point: 0,
            table: vec![0; if table { TABLE_ENTRIES } else { 0 }],
        }),
        Kind::Half => Parameters::Half(HalfParameters {
            weights: vec![Half::ONE; macs],
            bias: vec![Half::ZERO; rows],
            quantize: match next {
                Some(Kind::Integer(_)) => Some(Quantize {
                    bits: 8,
                    exponent: 4,
                    zero_point: 0,
                }),
                Some(Kind::Half) | None => None,
            },
        }),
    }
}

pub(super) fn asset(sketch: &Sketch) -> Asset {
    let grid = |channels, sampling| GridShape {
        channels,
        format: LatentFormat::new(4).unwrap(),
        scale_log2: 3,
        sampling,
    };
    let [first, second] = sketch.grid_channels;
    let shape = Shape {
        width: sketch.size,
        height: sketch.size,
        mip_count: sketch.mip_count,
        octaves: sketch.octaves,
        wave: Wave::Triangle,
        padding: 0,
        input_bits: 8,
        snap: CornerSnap::Cell,
        address_mode: AddressMode::Wrap,
        grids: [
            grid(first, Sampling::Corners),
            grid(second, Sampling::Interpolated),
        ],
        outputs: vec![OutputFormat::Unorm8; usize::from(sketch.channels)],
    };
    let last = Hidden {
        kind: sketch.last,
        outputs: sketch.channels,
        activation: Activation::Identity,
        adds: false,
    };
    let hidden: Vec<Hidden> = sketch.hidden.iter().copied().chain([last]).collect();
    let mut inputs = shape.input_count() as u16;
    let mut layers = Vec::new();
    for (index, layer) in hidden.iter().enumerate() {
        let next = hidden.get(index + 1).map(|layer| layer.kind);
        let has_table = layer.activation == Activation::Table;
        let scale = match layer.kind {
            Kind::Integer(_) => Multiplier::power_of_two(8),
            Kind::Half => Multiplier::power_of_two(0),
        };
        layers.push(Layer {
            inputs,
            outputs: layer.outputs,
            parameters: parameters(layer.kind, next, inputs, layer.outputs, has_table),
            activation: layer.activation,
            skip: layer.adds.then_some(Skip { span: 1, scale }),
        });
        inputs = layer.outputs;
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
                planes: 1,
                plane_bytes: 0,
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

/// The preset `mobile` with some fields changed. A quad is as small as a job that is smaller.
pub(super) fn unit(changes: &[(&str, u32)]) -> Unit {
    let mut configuration = *Unit::mobile().configuration();
    for &(name, value) in changes {
        configuration.set(name, value).unwrap();
    }
    configuration.quad_pixels = configuration.quad_pixels.min(configuration.job_texels());
    Unit::new("test", configuration).unwrap()
}

pub(super) fn tiny() -> Sketch {
    Sketch {
        size: 8,
        mip_count: 1,
        grid_channels: [1, 1],
        octaves: 0,
        hidden: Vec::new(),
        last: Kind::Integer(8),
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
    let relu = Hidden::bytes(64, Activation::Relu, false);
    let skip = Hidden::bytes(64, Activation::Leaky { shift: 3 }, true);
    Sketch {
        size: 64,
        mip_count: 3,
        grid_channels: [8, 16],
        octaves: 3,
        hidden: vec![relu, relu, skip],
        last: Kind::Integer(8),
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
            planes: 1,
            plane_bytes: 0,
        });
        trace.end_texel();
    }
    trace
}
