//! Export: the integers of a trained network as an asset.

use crate::config::{ActivationKind, TrainConfig};
use crate::error::TrainError;
use crate::integer::Range;
use crate::network::{Epilogue, Network, Prepared, Rescaling};
use crate::source::Source;
use ntmu_isa::Asset;
use ntmu_isa::activation::Activation;
use ntmu_isa::asset::{Metadata, Parts};
use ntmu_isa::layer::{Layer, Skip};
use ntmu_isa::profile::Profile;
use ntmu_isa::rescale::Multiplier;
use ntmu_isa::shape::Shape;

/// The sizes of a set's asset.
pub(crate) fn shape_of(config: &TrainConfig, source: &Source) -> Result<Shape, TrainError> {
    let (_, height, width) = source.mips.first().map_or((0, 0, 0), |m| m.dim());
    Ok(Shape {
        width: width as u32,
        height: height as u32,
        mip_count: source.mips.len() as u8,
        octaves: config.octaves,
        snap: config.snap.into(),
        address_mode: config.address.into(),
        grids: [config.grid_shape(0)?, config.grid_shape(1)?],
        outputs: source.outputs.clone(),
    })
}

/// The isa multiplier of a scale with at most 24 significant bits.
fn multiplier(scale: f64) -> Result<Multiplier, TrainError> {
    let narrow = scale as f32;
    let bits = narrow.to_bits();
    let (exponent, fraction) = ((bits >> 23) as i32, u64::from(bits & 0x7f_ffff));
    // Every scale is positive and far from the subnormal floats.
    Multiplier::nearest(fraction | 1 << 23, exponent - 150)
        .map_err(|error| TrainError::config("scale", scale, error.to_string()))
}

fn layer(
    network: &Network,
    index: usize,
    range: Option<&Range>,
    input_zero: i32,
) -> Result<Layer, TrainError> {
    let Prepared {
        shape,
        weights,
        bias,
        epilogue,
        ..
    } = &network.layers[index];
    let Epilogue::Integer(Rescaling {
        scales, gate, skip, ..
    }) = epilogue
    else {
        return Err(TrainError::config("network", "reals", "integers"));
    };
    let columns = shape.columns();
    let mut rows = Vec::with_capacity(shape.inputs * shape.outputs);
    let mut biases = Vec::with_capacity(shape.outputs);
    let mut multipliers = Vec::with_capacity(shape.outputs);
    for o in 0..shape.outputs {
        let row = (0..shape.inputs).map(|k| weights[k * columns + o] as i32);
        let sum: i32 = row.clone().sum();
        rows.extend(row.map(|w| w as i8));
        biases.push(bias[o] as i32 - input_zero * sum);
        multipliers.push(multiplier(scales[o])?);
    }
    let activation = match network.activation {
        _ if !shape.activated => Activation::Identity,
        ActivationKind::Relu => Activation::Relu,
        ActivationKind::Leaky { shift } => Activation::Leaky { shift },
        ActivationKind::HardGelu => Activation::HardGelu {
            scale: multiplier(*gate)?,
        },
    };
    let skip = match shape.skip {
        Some(span) => Some(Skip {
            span: span as u8,
            scale: multiplier(*skip)?,
        }),
        None => None,
    };
    Ok(Layer {
        inputs: shape.inputs as u16,
        outputs: shape.outputs as u16,
        weights: rows,
        bias: biases,
        scales: multipliers,
        zero_point: range.map_or(0, |r| r.zero_point),
        activation,
        skip,
    })
}

/// The layers of an integer network as isa stores them.
pub(crate) fn layers(network: &Network, ranges: &[Range]) -> Result<Vec<Layer>, TrainError> {
    let mut input_zero = 0;
    let mut out = Vec::with_capacity(network.layers.len());
    for index in 0..network.layers.len() {
        out.push(layer(network, index, ranges.get(index), input_zero)?);
        input_zero = ranges.get(index).map_or(0, |r| i32::from(r.zero_point));
    }
    Ok(out)
}

/// The asset of an integer network and its grids' codes.
pub(crate) fn asset(
    config: &TrainConfig,
    source: &Source,
    layers: Vec<Layer>,
    grids: [Vec<u8>; 2],
    record: Vec<(String, String)>,
) -> Result<Asset, TrainError> {
    Ok(Asset::new(Parts {
        shape: shape_of(config, source)?,
        profile: Profile::NORMATIVE,
        grids,
        weight_bits: config.weight_bits,
        layers,
        metadata: Metadata {
            name: source.name.clone(),
            maps: source.maps.clone(),
            record,
        },
    })?)
}
