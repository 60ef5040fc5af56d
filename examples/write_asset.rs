//! Writes an asset by hand: one channel that shows grid 1 as it is, interpolated.
//! `cargo run --example write_asset [FILE.ntx]`
#![allow(clippy::print_stdout, reason = "an example shows its result")]

use ntmu::isa::activation::Activation;
use ntmu::isa::asset::{Encoding, Map, Metadata, Parts};
use ntmu::isa::latent::LatentFormat;
use ntmu::isa::layer::{IntegerParameters, Layer, Parameters};
use ntmu::isa::layout::Layout;
use ntmu::isa::position::AddressMode;
use ntmu::isa::profile::Profile;
use ntmu::isa::rescale::Multiplier;
use ntmu::isa::shape::{GridShape, OutputFormat, Sampling, Shape};
use ntmu::isa::{Asset, Program};
use ntmu::model::exec::Decoder;
use std::error::Error;

pub(crate) fn main() -> Result<(), Box<dyn Error>> {
    let asset = asset()?;
    let program = Program::compile(&asset, Layout::LINEAR);
    println!("{}", Decoder::new(&asset, &program).mip(0));
    // As an example its first argument is a file; as a part of the tests it has none of its own.
    if let Some(path) = std::env::args()
        .nth(1)
        .filter(|path| path.ends_with(".ntx"))
    {
        std::fs::write(&path, asset.to_bytes())?;
        println!("wrote {path}");
    }
    Ok(())
}

/// One channel of 32 × 16 texels.
pub(crate) fn asset() -> Result<Asset, Box<dyn Error>> {
    let grid = |sampling| GridShape {
        channels: 1,
        // Four bits: codes 0..=15 stand for −7/16..=8/16.
        format: FOUR_BITS,
        scale_log2: 3,
        sampling,
    };
    let shape = Shape {
        mip_count: 1,
        octaves: 0,
        address_mode: AddressMode::Clamp,
        ..Shape::whole_chain(
            32,
            16,
            [grid(Sampling::Corners), grid(Sampling::Interpolated)],
            vec![OutputFormat::Unorm8],
        )
    };
    // Inputs: four corners of grid 0, one latent of grid 1, the level. Only grid 1 counts.
    let inputs = shape.input_count() as u16;
    let mut weights = vec![0; usize::from(inputs)];
    weights[4] = 1;
    let layer = Layer {
        inputs,
        outputs: 1,
        parameters: Parameters::Integer(IntegerParameters {
            weight_bits: 8,
            weights,
            // An input of −56..=64 stands for −7/16..=8/16. 56 more make it 0..=120, and times
            // 17/8 a code of 0..=255.
            bias: vec![56],
            scales: vec![Multiplier::nearest(17, -3)?],
            output_bits: 8,
            zero_point: 0,
            table: Vec::new(),
        }),
        activation: Activation::Identity,
        skip: None,
    };
    // 4 × 2 cells.
    let ramp = vec![0, 5, 10, 15, 15, 10, 5, 0];
    Ok(Asset::new(Parts {
        shape,
        profile: Profile::NORMATIVE,
        grids: [vec![7; 8], ramp],
        layers: vec![layer],
        metadata: Metadata {
            name: "ramp".to_owned(),
            maps: vec![Map {
                name: "height".to_owned(),
                first_channel: 0,
                channel_count: 1,
                encoding: Encoding::Linear,
                bit_depth: 8,
            }],
            record: Vec::new(),
        },
    })?)
}

const FOUR_BITS: LatentFormat = match LatentFormat::new(4) {
    Some(format) => format,
    None => panic!("a latent may have four bits"),
};
