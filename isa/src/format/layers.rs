//! The body of the section of layers.

use super::bits;
use super::cursor::Cursor;
use super::sections::zeros;
use crate::activation::{Activation, TABLE_ENTRIES};
use crate::error::AssetError;
use crate::half::Half;
use crate::layer::{HalfParameters, IntegerParameters, Layer, Parameters, Quantize, Skip};
use crate::limits;
use crate::rescale::Multiplier;

fn write_multiplier(out: &mut Vec<u8>, scale: Multiplier) {
    out.extend(scale.mantissa().to_le_bytes());
    out.push(scale.shift());
}

fn read_multiplier(cursor: &mut Cursor<'_>, field: &str) -> Result<Multiplier, AssetError> {
    let (mantissa, shift) = (cursor.i32()?, cursor.u8()?);
    Multiplier::new(mantissa, shift).map_err(|error| {
        let allowed = "a mantissa in 2^30..2^31 and a shift in 2..=62";
        AssetError::field(
            field,
            format!("{} / 2^{}", error.mantissa, error.shift),
            allowed,
        )
    })
}

/// The multiplier that stands where there is none.
const NO_MULTIPLIER: Multiplier = Multiplier::power_of_two(0);

/// Codes of the two kinds of layer.
const INTEGER: u8 = 0;
const HALF: u8 = 1;

/// ```text
/// u16 layers, u16 zero
/// per layer: u16 inputs, u16 outputs, u8 kind (0 integer, 1 fp16), u8 activation, u8 leak shift,
///            u8 span of the skip path (0: none), multiplier of the gate, multiplier of the skip
///   integer: u8 bits of a weight, u8 bits of an output, i16 zero point
///            per row: multiplier, i32 bias
///            256 i16 of the table, if that is the activation
///            weights, two's complement, packed like latents, row by row
///   fp16:    u8 bits of an output (0: halves), i8 exponent, i16 zero point
///            per row: u16 bias
///            u16 weights, row by row
/// multiplier: i32 mantissa, u8 shift
/// activation: 0 identity, 1 relu, 2 leaky, 3 hard gelu, 4 hard gelu limited to 3, 5 table
/// ```
pub(super) fn write_layers(layers: &[Layer]) -> Vec<u8> {
    let mut out = Vec::new();
    out.extend((layers.len() as u16).to_le_bytes());
    out.extend([0; 2]);
    for layer in layers {
        out.extend(layer.inputs.to_le_bytes());
        out.extend(layer.outputs.to_le_bytes());
        let (shift, gate) = match layer.activation {
            Activation::Identity | Activation::Relu | Activation::Table => (0, NO_MULTIPLIER),
            Activation::Leaky { shift } => (shift, NO_MULTIPLIER),
            Activation::HardGelu { scale, .. } => (0, scale),
        };
        out.push(match &layer.parameters {
            Parameters::Integer(_) => INTEGER,
            Parameters::Half(_) => HALF,
        });
        out.extend([layer.activation.code(), shift]);
        out.push(layer.skip.map_or(0, |skip| skip.span));
        write_multiplier(&mut out, gate);
        let skip = layer.skip.map_or(NO_MULTIPLIER, |skip| skip.scale);
        write_multiplier(&mut out, skip);
        match &layer.parameters {
            Parameters::Integer(parameters) => write_integer(&mut out, parameters),
            Parameters::Half(parameters) => write_half(&mut out, parameters),
        }
    }
    out
}

fn write_integer(out: &mut Vec<u8>, parameters: &IntegerParameters) {
    out.extend([parameters.weight_bits, parameters.output_bits]);
    out.extend(parameters.zero_point.to_le_bytes());
    for (&scale, &bias) in parameters.scales.iter().zip(&parameters.bias) {
        write_multiplier(out, scale);
        out.extend(bias.to_le_bytes());
    }
    out.extend(
        parameters
            .table
            .iter()
            .flat_map(|entry| entry.to_le_bytes()),
    );
    let mask = ((1_u16 << parameters.weight_bits) - 1) as u8;
    let codes = parameters.weights.iter().map(|&w| w as u8 & mask);
    out.extend(bits::pack(codes, parameters.weight_bits));
}

fn write_half(out: &mut Vec<u8>, parameters: &HalfParameters) {
    let none = Quantize {
        bits: 0,
        exponent: 0,
        zero_point: 0,
    };
    let quantize = parameters.quantize.unwrap_or(none);
    out.extend([quantize.bits, quantize.exponent as u8]);
    out.extend(quantize.zero_point.to_le_bytes());
    for half in parameters.bias.iter().chain(&parameters.weights) {
        out.extend(half.bits().to_le_bytes());
    }
}

pub(super) fn read_layers(body: &[u8]) -> Result<Vec<Layer>, AssetError> {
    let mut cursor = Cursor::new("weights", body);
    let layer_count = cursor.u16()?;
    zeros(&mut cursor, "weights.reserved", 2)?;
    if layer_count > limits::MAX_LAYERS {
        let allowed = format!("1..={}", limits::MAX_LAYERS);
        return Err(AssetError::field("weights.layers", layer_count, allowed));
    }
    let layers = (0..layer_count)
        .map(|index| read_layer(&mut cursor, index))
        .collect::<Result<_, _>>()?;
    cursor.finish()?;
    Ok(layers)
}

fn read_layer(cursor: &mut Cursor<'_>, index: u16) -> Result<Layer, AssetError> {
    let field = |name: &str| format!("weights.layer{index}.{name}");
    let (inputs, outputs) = (cursor.u16()?, cursor.u16()?);
    for (name, lanes) in [("inputs", inputs), ("outputs", outputs)] {
        if lanes > limits::MAX_LANES {
            let allowed = format!("1..={}", limits::MAX_LANES);
            return Err(AssetError::field(field(name), lanes, allowed));
        }
    }
    let (kind, code, shift, span) = (cursor.u8()?, cursor.u8()?, cursor.u8()?, cursor.u8()?);
    let gate = read_multiplier(cursor, &field("gate"))?;
    let scale = read_multiplier(cursor, &field("skip"))?;
    let activation = Activation::from_code(code, shift, gate)
        .ok_or_else(|| AssetError::field(field("activation"), code, "0..=5"))?;
    // What is not used must be what the writer puts there, so that reading loses nothing.
    let is_leaky = matches!(activation, Activation::Leaky { .. });
    let is_gated = matches!(activation, Activation::HardGelu { .. });
    let unused = [
        ("leak_shift", !is_leaky && shift != 0),
        ("gate", !is_gated && gate != NO_MULTIPLIER),
        ("skip", span == 0 && scale != NO_MULTIPLIER),
    ];
    refuse_unused(&unused, index)?;
    let parameters = match kind {
        INTEGER => {
            let entries = match activation {
                Activation::Table => TABLE_ENTRIES,
                Activation::Identity
                | Activation::Relu
                | Activation::Leaky { .. }
                | Activation::HardGelu { .. } => 0,
            };
            Parameters::Integer(read_integer(cursor, index, (inputs, outputs), entries)?)
        }
        HALF => Parameters::Half(read_half(cursor, index, (inputs, outputs))?),
        _ => return Err(AssetError::field(field("kind"), kind, "0..=1")),
    };
    Ok(Layer {
        inputs,
        outputs,
        parameters,
        activation,
        skip: (span != 0).then_some(Skip { span, scale }),
    })
}

fn refuse_unused(unused: &[(&str, bool)], index: u16) -> Result<(), AssetError> {
    unused
        .iter()
        .find(|(_, is_set)| *is_set)
        .map_or(Ok(()), |(name, _)| {
            Err(AssetError::field(
                format!("weights.layer{index}.{name}"),
                "a value that nothing uses",
                "its default",
            ))
        })
}

fn read_integer(
    cursor: &mut Cursor<'_>,
    index: u16,
    (inputs, outputs): (u16, u16),
    entries: usize,
) -> Result<IntegerParameters, AssetError> {
    let field = |name: &str| format!("weights.layer{index}.{name}");
    let (weight_bits, output_bits, zero_point) = (cursor.u8()?, cursor.u8()?, cursor.i16()?);
    let (low, high) = limits::WEIGHT_BITS;
    if weight_bits < low || weight_bits > high {
        let allowed = format!("{low}..={high}");
        return Err(AssetError::field(
            field("weight_bits"),
            weight_bits,
            allowed,
        ));
    }
    let mut scales = Vec::new();
    let mut bias = Vec::new();
    for _ in 0..outputs {
        scales.push(read_multiplier(cursor, &field("scale"))?);
        bias.push(cursor.i32()?);
    }
    let table = (0..entries)
        .map(|_| cursor.i16())
        .collect::<Result<_, _>>()?;
    let count = u64::from(inputs) * u64::from(outputs);
    let packed = cursor.take(bits::packed_bytes(count, weight_bits) as usize)?;
    let sign = 8 - weight_bits;
    let weights = bits::unpack("weights", packed, count, weight_bits)?
        .into_iter()
        .map(|code| ((code << sign) as i8) >> sign)
        .collect();
    Ok(IntegerParameters {
        weight_bits,
        weights,
        bias,
        scales,
        output_bits,
        zero_point,
        table,
    })
}

fn read_half(
    cursor: &mut Cursor<'_>,
    index: u16,
    (inputs, outputs): (u16, u16),
) -> Result<HalfParameters, AssetError> {
    let (bits, exponent, zero_point) = (cursor.u8()?, cursor.u8()? as i8, cursor.i16()?);
    refuse_unused(
        &[("quantize", bits == 0 && (exponent, zero_point) != (0, 0))],
        index,
    )?;
    let quantize = (bits != 0).then_some(Quantize {
        bits,
        exponent,
        zero_point,
    });
    let mut halves = |count: usize| -> Result<Vec<Half>, AssetError> {
        let bytes = cursor.take(2 * count)?;
        let pairs = bytes.chunks_exact(2);
        Ok(pairs
            .map(|pair| Half::from_bits(u16::from_le_bytes([pair[0], pair[1]])))
            .collect())
    };
    let bias = halves(usize::from(outputs))?;
    let weights = halves(usize::from(inputs) * usize::from(outputs))?;
    Ok(HalfParameters {
        weights,
        bias,
        quantize,
    })
}
