//! Export: the numbers of a trained network as an asset.

use crate::choices::ActivationKind;
use crate::config::TrainConfig;
use crate::epilogue::half::Ending;
use crate::error::TrainError;
use crate::network::{Epilogue, Halves, Network, Prepared, Rescaling};
use crate::quantise::{Range, Widths};
use crate::source::Source;
use ntmu_isa::Asset;
use ntmu_isa::activation::Activation;
use ntmu_isa::asset::{Metadata, Parts};
use ntmu_isa::half::Half;
use ntmu_isa::layer::{HalfParameters, IntegerParameters, Layer, Parameters, Quantize, Skip};
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
        wave: config.wave.into(),
        padding: config.padding,
        input_bits: config.input_bits,
        snap: config.snap.into(),
        address_mode: config.address.into(),
        pyramid: config.pyramid,
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

/// The integers of a layer whose input has the zero point `input_zero`.
fn integers(
    prepared: &Prepared,
    rescaling: &Rescaling,
    range: Option<&Range>,
    input_zero: i32,
    widths: Widths,
) -> Result<IntegerParameters, TrainError> {
    let Prepared {
        shape,
        weights,
        bias,
        ..
    } = prepared;
    let columns = shape.columns();
    let mut rows = Vec::with_capacity(shape.inputs * shape.outputs);
    let mut biases = Vec::with_capacity(shape.outputs);
    let mut multipliers = Vec::with_capacity(shape.outputs);
    for o in 0..shape.outputs {
        let row = (0..shape.inputs).map(|k| weights[k * columns + o] as i32);
        let sum: i32 = row.clone().sum();
        rows.extend(row.map(|w| w as i8));
        biases.push(bias[o] as i32 - input_zero * sum);
        multipliers.push(multiplier(rescaling.scales[o])?);
    }
    Ok(IntegerParameters {
        weight_bits: widths.weight,
        weights: rows,
        bias: biases,
        scales: multipliers,
        output_bits: range.map_or(LAST_BITS, |_| widths.activation),
        zero_point: range.map_or(0, |r| r.zero_point),
        table: Vec::new(),
    })
}

/// What isa wants as the output bits of the last layer, which has formats instead.
const LAST_BITS: u8 = 8;

/// The halves of a layer.
fn halves(
    prepared: &Prepared,
    halves: &Halves,
    range: Option<&Range>,
    widths: Widths,
) -> HalfParameters {
    let Prepared {
        shape,
        weights,
        bias,
        ..
    } = prepared;
    let columns = shape.columns();
    // Every number is a half already, the weights times a power of two.
    let half = |o: usize, k: usize| Half::round(weights[k * columns + o] / halves.read);
    let quantize = match (&halves.ending, range) {
        (Ending::Quantise { .. }, Some(range)) => Some(Quantize {
            bits: widths.activation,
            // The scale is the power of two 2^−exponent.
            exponent: (127 - (range.scale.to_bits() >> 23) as i32) as i8,
            zero_point: range.zero_point,
        }),
        (Ending::Quantise { .. } | Ending::Round | Ending::Codes(_), _) => None,
    };
    HalfParameters {
        weights: (0..shape.outputs)
            .flat_map(|o| (0..shape.inputs).map(move |k| half(o, k)))
            .collect(),
        bias: bias[..shape.outputs]
            .iter()
            .map(|&b| Half::round(b))
            .collect(),
        quantize,
    }
}

fn layer(
    network: &Network,
    index: usize,
    range: Option<&Range>,
    input_zero: i32,
    widths: Widths,
) -> Result<Layer, TrainError> {
    let prepared = &network.layers[index];
    let shape = prepared.shape;
    // Halves share one scale, so theirs is one.
    let one = Multiplier::power_of_two(0);
    let (parameters, gate, skip) = match &prepared.epilogue {
        Epilogue::Real => return Err(TrainError::config("network", "reals", "integers or fp16")),
        Epilogue::Integer(r) => (
            Parameters::Integer(integers(prepared, r, range, input_zero, widths)?),
            multiplier(r.gate)?,
            shape.skip.map(|_| multiplier(r.skip)).transpose()?,
        ),
        Epilogue::Half(h) => (
            Parameters::Half(halves(prepared, h, range, widths)),
            one,
            Some(one),
        ),
    };
    let gelu = |is_clamped| Activation::HardGelu {
        scale: gate,
        is_clamped,
    };
    let activation = match network.activation {
        _ if !shape.activated => Activation::Identity,
        ActivationKind::Relu => Activation::Relu,
        ActivationKind::Leaky { shift } => Activation::Leaky { shift },
        ActivationKind::HardGelu => gelu(false),
        ActivationKind::ClampedHardGelu => gelu(true),
    };
    let skip = shape.skip.zip(skip).map(|(span, scale)| Skip {
        span: span as u8,
        scale,
    });
    Ok(Layer {
        inputs: shape.inputs as u16,
        outputs: shape.outputs as u16,
        parameters,
        activation,
        skip,
    })
}

/// The layers of a network in the numbers of the decode, as isa stores them.
pub(crate) fn layers(
    network: &Network,
    ranges: &[Range],
    config: &TrainConfig,
) -> Result<Vec<Layer>, TrainError> {
    let mut input_zero = 0;
    let mut out = Vec::with_capacity(network.layers.len());
    for index in 0..network.layers.len() {
        let range = ranges.get(index);
        let widths = Widths::of(config, index);
        out.push(layer(network, index, range, input_zero, widths)?);
        input_zero = ranges.get(index).map_or(0, |r| i32::from(r.zero_point));
    }
    Ok(out)
}

/// The asset of a network in the numbers of the decode and its grids' codes.
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
        layers,
        metadata: Metadata {
            name: source.name.clone(),
            maps: source.maps.clone(),
            record,
        },
    })?)
}
