//! What the tests run: small assets, their traces, and units.

use super::{Timing, Unit, work_of};
use crate::demand::Demand;
use crate::material::Material;
use crate::place::Place;
use crate::request::Request;
use crate::trace::{Addresses, Fetch};
use ntmu_isa::activation::{Activation, TABLE_ENTRIES};
use ntmu_isa::asset::{Encoding, Map, Metadata, Parts};
use ntmu_isa::half::Half;
use ntmu_isa::latent::LatentFormat;
use ntmu_isa::layer::{HalfParameters, IntegerParameters, Layer, Parameters, Quantize, Skip};
use ntmu_isa::layout::Layout;
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
        mip_count: sketch.mip_count,
        octaves: sketch.octaves,
        ..Shape::whole_chain(
            sketch.size,
            sketch.size,
            [
                grid(first, Sampling::Corners),
                grid(second, Sampling::Interpolated),
            ],
            vec![OutputFormat::Unorm8; usize::from(sketch.channels)],
        )
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

/// The same asset with integer weights of so many bits.
pub(super) fn with_weight_bits(asset: Asset, bits: u8) -> Asset {
    let mut parts = asset.into_parts();
    for layer in &mut parts.layers {
        if let Parameters::Integer(numbers) = &mut layer.parameters {
            numbers.weight_bits = bits;
        }
    }
    Asset::new(parts).unwrap()
}

/// What is asked of an asset's program.
#[derive(Clone, Debug)]
pub(super) enum Asked {
    /// Texels, a pixel each.
    Texels(Vec<Request>),
    /// Decodes that touch these fetches, a pixel each.
    Fetches(Vec<Fetch>),
}

impl Asked {
    pub(super) fn count(&self) -> usize {
        match self {
            Asked::Texels(requests) => requests.len(),
            Asked::Fetches(fetches) => fetches.len(),
        }
    }

    /// A pixel for each.
    pub(super) fn demands(&self) -> impl Iterator<Item = Demand> {
        let texel = |n: usize| match self {
            Asked::Texels(requests) => requests[n],
            Asked::Fetches(_) => Request::within(n as u32, 0, 0),
        };
        (0..self.count()).map(move |n| demand(0, &[texel(n)]))
    }

    /// The material that they are asked of.
    pub(super) fn material<'a>(&self, asset: &'a Asset, program: &'a Program) -> Material<'a> {
        match self {
            Asked::Texels(_) => Material::new("asset", asset, program),
            Asked::Fetches(fetches) => {
                let work = work_of(asset, program);
                Material::with_addresses("fetches", work, Listed(fetches.clone()))
            }
        }
    }
}

/// A pixel that needs these texels of a material.
pub(super) fn demand(material: u16, texels: &[Request]) -> Demand {
    Demand {
        pixel: [0, 0],
        material,
        places: texels.iter().map(|&texel| Place::of(texel)).collect(),
        weights: texels.len() as u32,
    }
}

/// One fetch for the texel of each column.
struct Listed(Vec<Fetch>);

impl Addresses for Listed {
    fn fetches(&self, place: &Place, fetches: &mut Vec<Fetch>) {
        fetches.push(self.0[(place.x() >> place.bits()) as usize]);
    }

    fn bytes(&self) -> u64 {
        1 << 20
    }

    fn mip_size(&self, _mip: u8) -> (u32, u32) {
        (self.0.len() as u32, 1)
    }
}

/// The run of a unit for what is asked of one asset.
pub(super) fn simulate(unit: &Unit, asset: &Asset, program: &Program, asked: &Asked) -> Timing {
    simulate_with_stride(unit, asset, program, asked, u64::MAX)
}

pub(super) fn simulate_with_stride(
    unit: &Unit,
    asset: &Asset,
    program: &Program,
    asked: &Asked,
    stride: u64,
) -> Timing {
    let materials = [asked.material(asset, program)];
    let run = super::run(unit, &materials, &mut asked.demands(), &mut (), 0, stride);
    run.unwrap_or_else(|never| match never {})
}

/// Everything a run needs, for the blocks of a mip.
pub(super) fn scan(sketch: &Sketch, layout: Layout) -> (Asset, Program, Asked) {
    let asset = asset(sketch);
    let program = Program::compile(&asset, layout);
    let asked = Asked::Texels(Request::blocks(&asset.shape, 0).collect());
    (asset, program, asked)
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

/// Single cells of one byte at these addresses, one fetch a texel.
pub(super) fn addresses(addresses: &[[u64; 4]]) -> Asked {
    let fetch = |&addresses| Fetch {
        grid: 0,
        addresses,
        cell_bytes: 1,
        planes: 1,
        plane_bytes: 0,
    };
    Asked::Fetches(addresses.iter().map(fetch).collect())
}
