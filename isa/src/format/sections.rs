//! The bodies of the sections, each written and read side by side.

use super::bits;
use super::cursor::Cursor;
use crate::activation::Activation;
use crate::asset::{Encoding, Map, Metadata};
use crate::error::AssetError;
use crate::latent::LatentFormat;
use crate::layer::{Layer, Skip};
use crate::limits;
use crate::position::{AddressMode, CornerSnap};
use crate::profile::Profile;
use crate::rescale::{Multiplier, Requantizer};
use crate::round::Rounding;
use crate::shape::{GridShape, OutputFormat, Shape};

/// The member of an enumeration with the next byte as its code.
fn choice<T>(
    cursor: &mut Cursor<'_>,
    field: &str,
    count: usize,
    from_code: fn(u8) -> Option<T>,
) -> Result<T, AssetError> {
    let code = cursor.u8()?;
    from_code(code).ok_or_else(|| AssetError::field(field, code, format!("0..={}", count - 1)))
}

fn zeros(cursor: &mut Cursor<'_>, field: &str, count: usize) -> Result<(), AssetError> {
    match cursor.take(count)?.iter().find(|&&byte| byte != 0) {
        Some(byte) => Err(AssetError::field(field, byte, 0)),
        None => Ok(()),
    }
}

/// ```text
/// u32 width, u32 height, u8 mips, u8 octaves, u8 snap, u8 address mode
/// per grid: u16 channels, u8 bits, u8 log2 of the scale
/// u16 channels, per channel: u8 output format
/// ```
pub(super) fn write_shape(shape: &Shape) -> Vec<u8> {
    let mut out = Vec::new();
    out.extend(shape.width.to_le_bytes());
    out.extend(shape.height.to_le_bytes());
    let (snap, mode) = (shape.snap.code(), shape.address_mode.code());
    out.extend([shape.mip_count, shape.octaves, snap, mode]);
    for grid in shape.grids {
        out.extend(grid.channels.to_le_bytes());
        out.extend([grid.format.bits(), grid.scale_log2]);
    }
    out.extend(shape.channel_count().to_le_bytes());
    out.extend(shape.outputs.iter().map(|o| o.code()));
    out
}

pub(super) fn read_shape(body: &[u8]) -> Result<Shape, AssetError> {
    let mut cursor = Cursor::new("shape", body);
    let (width, height) = (cursor.u32()?, cursor.u32()?);
    let (mip_count, octaves) = (cursor.u8()?, cursor.u8()?);
    let snap = choice(
        &mut cursor,
        "shape.snap",
        CornerSnap::ALL.len(),
        CornerSnap::from_code,
    )?;
    let address_mode = choice(
        &mut cursor,
        "shape.address_mode",
        AddressMode::ALL.len(),
        AddressMode::from_code,
    )?;
    let mut grid = |index: usize| -> Result<GridShape, AssetError> {
        let channels = cursor.u16()?;
        let bits = cursor.u8()?;
        let scale_log2 = cursor.u8()?;
        let format = LatentFormat::new(bits)
            .ok_or_else(|| AssetError::field(format!("shape.grid{index}.bits"), bits, "1..=8"))?;
        Ok(GridShape {
            channels,
            format,
            scale_log2,
        })
    };
    let grids = [grid(0)?, grid(1)?];
    let channels = cursor.u16()?;
    if channels > limits::MAX_CHANNELS {
        let allowed = format!("1..={}", limits::MAX_CHANNELS);
        return Err(AssetError::field("shape.channels", channels, allowed));
    }
    let outputs = (0..channels)
        .map(|_| {
            let count = OutputFormat::ALL.len();
            choice(&mut cursor, "shape.output", count, OutputFormat::from_code)
        })
        .collect::<Result<_, _>>()?;
    cursor.finish()?;
    Ok(Shape {
        width,
        height,
        mip_count,
        octaves,
        snap,
        address_mode,
        grids,
        outputs,
    })
}

/// `u8` each: input, leak, requantize, skip, output; three zeros.
pub(super) fn write_profile(profile: &Profile) -> Vec<u8> {
    let Profile {
        input,
        leak,
        requantize,
        skip,
        output,
    } = *profile;
    let codes = [
        input.code(),
        leak.code(),
        requantize.code(),
        skip.code(),
        output.code(),
    ];
    [codes.as_slice(), &[0; 3]].concat()
}

pub(super) fn read_profile(body: &[u8]) -> Result<Profile, AssetError> {
    let mut cursor = Cursor::new("profile", body);
    let mut rounding =
        |field: &str| choice(&mut cursor, field, Rounding::ALL.len(), Rounding::from_code);
    let (input, leak) = (rounding("profile.input")?, rounding("profile.leak")?);
    let mut requantizer = |field: &str| {
        choice(
            &mut cursor,
            field,
            Requantizer::ALL.len(),
            Requantizer::from_code,
        )
    };
    let profile = Profile {
        input,
        leak,
        requantize: requantizer("profile.requantize")?,
        skip: requantizer("profile.skip")?,
        output: requantizer("profile.output")?,
    };
    zeros(&mut cursor, "profile.reserved", 3)?;
    cursor.finish()?;
    Ok(profile)
}

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

/// ```text
/// u16 layers, u8 bits of a weight, u8 zero
/// per layer: u16 inputs, u16 outputs, i16 zero point,
///            u8 activation (0 identity, 1 relu, 2 leaky, 3 hard gelu), u8 leak shift,
///            multiplier of the gate, u8 span of the skip path (0: none), multiplier of the skip
///            per row: multiplier, i32 bias
///            weights, two's complement, packed like latents, row by row
/// multiplier: i32 mantissa, u8 shift
/// ```
pub(super) fn write_layers(weight_bits: u8, layers: &[Layer]) -> Vec<u8> {
    let mut out = Vec::new();
    out.extend((layers.len() as u16).to_le_bytes());
    out.extend([weight_bits, 0]);
    let mask = ((1_u16 << weight_bits) - 1) as u8;
    for layer in layers {
        out.extend(layer.inputs.to_le_bytes());
        out.extend(layer.outputs.to_le_bytes());
        out.extend(layer.zero_point.to_le_bytes());
        let (kind, shift, gate) = match layer.activation {
            Activation::Identity => (0, 0, NO_MULTIPLIER),
            Activation::Relu => (1, 0, NO_MULTIPLIER),
            Activation::Leaky { shift } => (2, shift, NO_MULTIPLIER),
            Activation::HardGelu { scale } => (3, 0, scale),
        };
        out.extend([kind, shift]);
        write_multiplier(&mut out, gate);
        out.push(layer.skip.map_or(0, |skip| skip.span));
        write_multiplier(
            &mut out,
            layer.skip.map_or(NO_MULTIPLIER, |skip| skip.scale),
        );
        for (&scale, &bias) in layer.scales.iter().zip(&layer.bias) {
            write_multiplier(&mut out, scale);
            out.extend(bias.to_le_bytes());
        }
        out.extend(bits::pack(
            layer.weights.iter().map(|&w| w as u8 & mask),
            weight_bits,
        ));
    }
    out
}

pub(super) fn read_layers(body: &[u8]) -> Result<(u8, Vec<Layer>), AssetError> {
    let mut cursor = Cursor::new("weights", body);
    let layer_count = cursor.u16()?;
    let weight_bits = cursor.u8()?;
    zeros(&mut cursor, "weights.reserved", 1)?;
    let (low, high) = limits::WEIGHT_BITS;
    if weight_bits < low || weight_bits > high {
        return Err(AssetError::field(
            "weights.bits",
            weight_bits,
            format!("{low}..={high}"),
        ));
    }
    if layer_count > limits::MAX_LAYERS {
        let allowed = format!("1..={}", limits::MAX_LAYERS);
        return Err(AssetError::field("weights.layers", layer_count, allowed));
    }
    let layers = (0..layer_count)
        .map(|index| read_layer(&mut cursor, index, weight_bits))
        .collect::<Result<_, _>>()?;
    cursor.finish()?;
    Ok((weight_bits, layers))
}

fn read_layer(cursor: &mut Cursor<'_>, index: u16, weight_bits: u8) -> Result<Layer, AssetError> {
    let field = |name: &str| format!("weights.layer{index}.{name}");
    let (inputs, outputs, zero_point) = (cursor.u16()?, cursor.u16()?, cursor.i16()?);
    for (name, lanes) in [("inputs", inputs), ("outputs", outputs)] {
        if lanes > limits::MAX_LANES {
            let allowed = format!("1..={}", limits::MAX_LANES);
            return Err(AssetError::field(field(name), lanes, allowed));
        }
    }
    let (kind, shift) = (cursor.u8()?, cursor.u8()?);
    let gate = read_multiplier(cursor, &field("gate"))?;
    let activation = match kind {
        0 => Activation::Identity,
        1 => Activation::Relu,
        2 => Activation::Leaky { shift },
        3 => Activation::HardGelu { scale: gate },
        _ => return Err(AssetError::field(field("activation"), kind, "0..=3")),
    };
    let span = cursor.u8()?;
    let scale = read_multiplier(cursor, &field("skip"))?;
    let skip = (span != 0).then_some(Skip { span, scale });
    // What is not used must be what the writer puts there, so that reading loses nothing.
    let unused = [
        ("leak_shift", kind != 2 && shift != 0),
        ("gate", kind != 3 && gate != NO_MULTIPLIER),
        ("skip", span == 0 && scale != NO_MULTIPLIER),
    ];
    if let Some((name, _)) = unused.iter().find(|(_, is_set)| *is_set) {
        return Err(AssetError::field(
            field(name),
            "a value that nothing uses",
            "its default",
        ));
    }
    let mut scales = Vec::new();
    let mut bias = Vec::new();
    for _ in 0..outputs {
        scales.push(read_multiplier(cursor, &field("scale"))?);
        bias.push(cursor.i32()?);
    }
    let count = u64::from(inputs) * u64::from(outputs);
    let packed = cursor.take(bits::packed_bytes(count, weight_bits) as usize)?;
    let sign = 8 - weight_bits;
    let weights = bits::unpack("weights", packed, count, weight_bits)?
        .into_iter()
        .map(|code| ((code << sign) as i8) >> sign)
        .collect();
    Ok(Layer {
        inputs,
        outputs,
        weights,
        bias,
        scales,
        zero_point,
        activation,
        skip,
    })
}

fn write_text(out: &mut Vec<u8>, text: &str) {
    out.extend((text.len() as u32).to_le_bytes());
    out.extend(text.as_bytes());
}

fn read_text(cursor: &mut Cursor<'_>, field: &str) -> Result<String, AssetError> {
    let length = cursor.u32()?;
    if length > limits::MAX_TEXT {
        return Err(AssetError::field(
            field,
            format!("{length} bytes"),
            limits::MAX_TEXT,
        ));
    }
    let bytes = cursor.take(length as usize)?.to_vec();
    String::from_utf8(bytes).map_err(|e| AssetError::field(field, e.utf8_error(), "UTF-8"))
}

/// ```text
/// text name
/// u16 maps, per map: text name, u16 first channel, u16 channels, u8 encoding, u8 bit depth
/// u16 entries of the training record, per entry: text key, text value
/// text: u32 bytes, UTF-8
/// ```
pub(super) fn write_metadata(metadata: &Metadata) -> Vec<u8> {
    let mut out = Vec::new();
    write_text(&mut out, &metadata.name);
    out.extend((metadata.maps.len() as u16).to_le_bytes());
    for map in &metadata.maps {
        write_text(&mut out, &map.name);
        out.extend(map.first_channel.to_le_bytes());
        out.extend(map.channel_count.to_le_bytes());
        out.extend([map.encoding.code(), map.bit_depth]);
    }
    out.extend((metadata.record.len() as u16).to_le_bytes());
    for (key, value) in &metadata.record {
        write_text(&mut out, key);
        write_text(&mut out, value);
    }
    out
}

pub(super) fn read_metadata(body: &[u8]) -> Result<Metadata, AssetError> {
    let mut cursor = Cursor::new("metadata", body);
    let name = read_text(&mut cursor, "metadata.name")?;
    let map_count = cursor.u16()?;
    let maps = (0..map_count)
        .map(|_| {
            Ok(Map {
                name: read_text(&mut cursor, "metadata.map")?,
                first_channel: cursor.u16()?,
                channel_count: cursor.u16()?,
                encoding: {
                    let count = Encoding::ALL.len();
                    choice(&mut cursor, "metadata.encoding", count, Encoding::from_code)?
                },
                bit_depth: cursor.u8()?,
            })
        })
        .collect::<Result<_, _>>()?;
    let entry_count = cursor.u16()?;
    let record = (0..entry_count)
        .map(|_| {
            let key = read_text(&mut cursor, "metadata.key")?;
            Ok((key, read_text(&mut cursor, "metadata.value")?))
        })
        .collect::<Result<_, _>>()?;
    cursor.finish()?;
    Ok(Metadata { name, maps, record })
}
