//! The bodies of the sections, each written and read side by side; the layers have a file of their own.

use super::cursor::Cursor;
use crate::accumulate::{Accumulator, Overflow};
use crate::asset::{Encoding, Map, Metadata};
use crate::embed::Wave;
use crate::error::AssetError;
use crate::filter::FilterRule;
use crate::half::SumOrder;
use crate::latent::LatentFormat;
use crate::limits;
use crate::position::{AddressMode, CornerSnap};
use crate::profile::{PointSnap, Profile};
use crate::pyramid::Pyramid;
use crate::rescale::Requantizer;
use crate::round::Rounding;
use crate::shape::{GridShape, OutputFormat, Sampling, Shape};

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

pub(super) fn zeros(cursor: &mut Cursor<'_>, field: &str, count: usize) -> Result<(), AssetError> {
    match cursor.take(count)?.iter().find(|&&byte| byte != 0) {
        Some(byte) => Err(AssetError::field(field, byte, 0)),
        None => Ok(()),
    }
}

/// ```text
/// u32 width, u32 height, u8 mips, u8 octaves, u8 wave, u8 padding,
/// u8 bits of an input, u8 snap, u8 address mode, u8 pyramid
/// per grid: u16 channels, u8 bits, u8 log2 of the scale, u8 sampling, u8 zero
/// u16 channels, per channel: u8 output format
/// ```
pub(super) fn write_shape(shape: &Shape) -> Vec<u8> {
    let mut out = Vec::new();
    out.extend(shape.width.to_le_bytes());
    out.extend(shape.height.to_le_bytes());
    out.extend([shape.mip_count, shape.octaves]);
    out.extend([shape.wave.code(), shape.padding]);
    out.extend([shape.input_bits, shape.snap.code()]);
    out.extend([shape.address_mode.code(), shape.pyramid.code()]);
    for grid in shape.grids {
        out.extend(grid.channels.to_le_bytes());
        out.extend([grid.format.bits(), grid.scale_log2]);
        out.extend([grid.sampling.code(), 0]);
    }
    out.extend(shape.channel_count().to_le_bytes());
    out.extend(shape.outputs.iter().map(|o| o.code()));
    out
}

pub(super) fn read_shape(body: &[u8]) -> Result<Shape, AssetError> {
    let mut cursor = Cursor::new("shape", body);
    let (width, height) = (cursor.u32()?, cursor.u32()?);
    let (mip_count, octaves) = (cursor.u8()?, cursor.u8()?);
    let waves = Wave::ALL.len();
    let wave = choice(&mut cursor, "shape.wave", waves, Wave::from_code)?;
    let (padding, input_bits) = (cursor.u8()?, cursor.u8()?);
    let snaps = CornerSnap::ALL.len();
    let snap = choice(&mut cursor, "shape.snap", snaps, CornerSnap::from_code)?;
    let address_mode = choice(
        &mut cursor,
        "shape.address_mode",
        AddressMode::ALL.len(),
        AddressMode::from_code,
    )?;
    let code = cursor.u8()?;
    let pyramid = Pyramid::from_code(code).ok_or_else(|| {
        let allowed = "0, or 16·first + each with 1 ≤ each ≤ first ≤ 15";
        AssetError::field("shape.pyramid", code, allowed)
    })?;
    let mut grid = |index: usize| -> Result<GridShape, AssetError> {
        let field = |name: &str| format!("shape.grid{index}.{name}");
        let channels = cursor.u16()?;
        // Before anything is computed from it.
        if channels > limits::MAX_GRID_CHANNELS {
            let allowed = format!("1..={}", limits::MAX_GRID_CHANNELS);
            return Err(AssetError::field(field("channels"), channels, allowed));
        }
        let bits = cursor.u8()?;
        let format = LatentFormat::new(bits)
            .ok_or_else(|| AssetError::field(field("bits"), bits, "1..=8"))?;
        let scale_log2 = cursor.u8()?;
        let sampling = choice(
            &mut cursor,
            &field("sampling"),
            Sampling::ALL.len(),
            Sampling::from_code,
        )?;
        zeros(&mut cursor, &field("reserved"), 1)?;
        Ok(GridShape {
            channels,
            format,
            scale_log2,
            sampling,
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
        wave,
        padding,
        input_bits,
        snap,
        address_mode,
        pyramid,
        grids,
        outputs,
    })
}

/// See [`Profile::to_bytes`]: one byte a choice, then zeros.
pub(super) fn read_profile(body: &[u8]) -> Result<Profile, AssetError> {
    let mut cursor = Cursor::new("profile", body);
    let c = &mut cursor;
    let (roundings, requantizers) = (Rounding::ALL.len(), Requantizer::ALL.len());
    let rules = FilterRule::ALL.len();
    let rounding = |c: &mut Cursor<'_>, field| choice(c, field, roundings, Rounding::from_code);
    let requantizer =
        |c: &mut Cursor<'_>, field| choice(c, field, requantizers, Requantizer::from_code);
    let rule = |c: &mut Cursor<'_>, field| choice(c, field, rules, FilterRule::from_code);
    let profile = Profile {
        subtexel_bits: c.u8()?,
        lod_bits: c.u8()?,
        coordinate: rounding(c, "profile.coordinate")?,
        point_snap: choice(
            c,
            "profile.point_snap",
            PointSnap::ALL.len(),
            PointSnap::from_code,
        )?,
        filter: rule(c, "profile.filter")?,
        filter_rounding: rounding(c, "profile.filter_rounding")?,
        interpolate: rule(c, "profile.interpolate")?,
        input: rounding(c, "profile.input")?,
        accumulator: Accumulator {
            bits: c.u8()?,
            overflow: choice(
                c,
                "profile.accumulator.overflow",
                Overflow::ALL.len(),
                Overflow::from_code,
            )?,
        },
        bias_bits: c.u8()?,
        leak: rounding(c, "profile.leak")?,
        requantize: requantizer(c, "profile.requantize")?,
        skip: requantizer(c, "profile.skip")?,
        residual_bits: c.u8()?,
        output: requantizer(c, "profile.output")?,
        sum: choice(c, "profile.sum", SumOrder::ALL.len(), SumOrder::from_code)?,
        convert: rounding(c, "profile.convert")?,
    };
    // What is left is zeros: the choices take fewer bytes than the section has.
    zeros(c, "profile.reserved", 6)?;
    cursor.finish()?;
    Ok(profile)
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
