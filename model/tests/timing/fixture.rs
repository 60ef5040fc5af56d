//! What the claims are about: small assets, materials of every kind, and the demands on them.

use ntmu_isa::activation::{Activation, TABLE_ENTRIES};
use ntmu_isa::asset::{Encoding, Map, Metadata, Parts};
use ntmu_isa::half::Half;
use ntmu_isa::latent::LatentFormat;
use ntmu_isa::layer::{HalfParameters, IntegerParameters, Layer, Parameters, Quantize, Skip};
use ntmu_isa::layout::Layout;
use ntmu_isa::profile::Profile;
use ntmu_isa::pyramid::Pyramid;
use ntmu_isa::rescale::Multiplier;
use ntmu_isa::shape::{GridShape, OutputFormat, Sampling, Shape};
use ntmu_isa::{Asset, Program};
use ntmu_model::Material;
use ntmu_model::control::{Bc7, Order, Plain};

/// The arithmetic of a layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Weights and outputs of so many bits.
    Integer { weight_bits: u8, output_bits: u8 },
    /// Halves.
    Half,
}

/// Bytes.
pub(crate) const BYTES: Kind = Kind::Integer {
    weight_bits: 8,
    output_bits: 8,
};

/// A hidden layer.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hidden {
    pub(crate) kind: Kind,
    pub(crate) outputs: u16,
    pub(crate) activation: Activation,
    /// Whether the layer before it is added. It has as many outputs, and a kind that allows it.
    pub(crate) adds: bool,
}

/// What a test says about an asset; the rest follows.
#[derive(Clone, Debug)]
pub(crate) struct Sketch {
    pub(crate) size: u32,
    pub(crate) grid_channels: [u16; 2],
    pub(crate) pyramid: Pyramid,
    pub(crate) octaves: u8,
    pub(crate) hidden: Vec<Hidden>,
    pub(crate) last: Kind,
    pub(crate) channels: u16,
}

impl Sketch {
    /// Hidden layers of bytes, `widths` wide, after grids of so many channels.
    pub(crate) fn plain(size: u32, grid_channels: [u16; 2], widths: &[u16]) -> Sketch {
        let hidden = |&outputs: &u16| Hidden {
            kind: BYTES,
            outputs,
            activation: Activation::Relu,
            adds: false,
        };
        Sketch {
            size,
            grid_channels,
            pyramid: Pyramid::SINGLE,
            octaves: 3,
            hidden: widths.iter().map(hidden).collect(),
            last: BYTES,
            channels: 9,
        }
    }

    /// CNTC-16: 64 wide, four residual blocks of two square layers.
    pub(crate) fn cntc_16(size: u32) -> Sketch {
        let mut sketch = Sketch::plain(size, [8, 16], &[64; 9]);
        for layer in sketch.hidden.iter_mut().skip(2).step_by(2) {
            layer.adds = true;
        }
        sketch
    }
}

/// The shape of a set of `size` × `size` texels with its whole chain.
pub(crate) fn shape(size: u32, grid_channels: [u16; 2], octaves: u8, channels: u16) -> Shape {
    let grid = |channels, sampling| GridShape {
        channels,
        format: LatentFormat::new(4).unwrap(),
        scale_log2: 3,
        sampling,
    };
    let [first, second] = grid_channels;
    Shape {
        octaves,
        ..Shape::whole_chain(
            size,
            size,
            [
                grid(first, Sampling::Corners),
                grid(second, Sampling::Interpolated),
            ],
            vec![OutputFormat::Unorm8; usize::from(channels)],
        )
    }
}

fn scale(kind: Kind) -> Multiplier {
    match kind {
        Kind::Integer { .. } => Multiplier::power_of_two(8),
        Kind::Half => Multiplier::power_of_two(0),
    }
}

/// Numbers of a layer; `next` reads its output, `None` behind the last.
fn parameters(layer: &Hidden, next: Option<Kind>, inputs: u16) -> Parameters {
    let rows = usize::from(layer.outputs);
    let macs = usize::from(inputs) * rows;
    let has_table = layer.activation == Activation::Table;
    match layer.kind {
        Kind::Integer {
            weight_bits,
            output_bits,
        } => Parameters::Integer(IntegerParameters {
            weight_bits,
            weights: vec![1; macs],
            bias: vec![0; rows],
            scales: vec![scale(layer.kind); rows],
            output_bits,
            zero_point: 0,
            table: vec![0; if has_table { TABLE_ENTRIES } else { 0 }],
        }),
        Kind::Half => Parameters::Half(HalfParameters {
            weights: vec![Half::ONE; macs],
            bias: vec![Half::ZERO; rows],
            quantize: match next {
                Some(Kind::Integer { .. }) => Some(Quantize {
                    bits: 8,
                    exponent: 4,
                    zero_point: 0,
                }),
                Some(Kind::Half) | None => None,
            },
        }),
    }
}

pub(crate) fn asset(sketch: &Sketch) -> Asset {
    let shape = Shape {
        pyramid: sketch.pyramid,
        ..shape(
            sketch.size,
            sketch.grid_channels,
            sketch.octaves,
            sketch.channels,
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
        let skip = Skip {
            span: 1,
            scale: scale(layer.kind),
        };
        layers.push(Layer {
            inputs,
            outputs: layer.outputs,
            parameters: parameters(layer, next, inputs),
            activation: layer.activation,
            skip: layer.adds.then_some(skip),
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

/// What a material is before it is built.
#[derive(Clone, Debug)]
pub(crate) enum Recipe {
    /// A neural set in a layout.
    Neural(Sketch, Layout),
    /// So many maps of RGBA8 of a size.
    Plain(u32, u16, Order),
    /// So many maps of BC7 of a size.
    Bc7(u32, u16, Order),
}

/// A recipe with what a [`Material`] borrows.
#[derive(Debug)]
pub(crate) enum Built {
    /// An asset behind its program.
    Neural(Box<(Asset, Program)>),
    /// Plain maps.
    Plain(Shape, Plain),
    /// Compressed maps.
    Bc7(Shape, Bc7),
}

impl Recipe {
    pub(crate) fn build(&self) -> Built {
        let square = |size| shape(size, [1, 1], 0, 4);
        match self {
            Recipe::Neural(sketch, layout) => {
                let asset = asset(sketch);
                layout.check(&asset.shape).unwrap();
                let program = Program::compile(&asset, *layout);
                Built::Neural(Box::new((asset, program)))
            }
            Recipe::Plain(size, maps, order) => {
                let shape = square(*size);
                let plain = Plain::new(&shape, *maps, *order).unwrap();
                Built::Plain(shape, plain)
            }
            Recipe::Bc7(size, maps, order) => {
                let shape = square(*size);
                let bc7 = Bc7::new(&shape, *maps, *order).unwrap();
                Built::Bc7(shape, bc7)
            }
        }
    }
}

impl Built {
    pub(crate) fn shape(&self) -> &Shape {
        match self {
            Built::Neural(both) => &both.0.shape,
            Built::Plain(shape, _) | Built::Bc7(shape, _) => shape,
        }
    }

    pub(crate) fn material(&self) -> Material<'_> {
        match self {
            Built::Neural(both) => Material::new("neural", &both.0, &both.1),
            Built::Plain(_, plain) => {
                Material::with_addresses("plain", plain.work(), plain.clone())
            }
            Built::Bc7(_, bc7) => Material::with_addresses("bc7", bc7.work(), bc7.clone()),
        }
    }
}

pub(crate) fn materials(built: &[Built]) -> Vec<Material<'_>> {
    built.iter().map(Built::material).collect()
}
