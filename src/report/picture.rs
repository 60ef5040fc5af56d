//! Pictures of maps: source, reconstruction and their difference, as PNG inside data URIs.

use super::{MapPicture, ReportError};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use ndarray::{Array3, ArrayView3, Axis, Slice};
use std::ops::Range;

/// Texels along an axis beyond which a picture is reduced.
pub(super) const LARGEST_SIDE: usize = 512;

/// Differences are multiplied by this, then clipped at full scale.
pub(super) const AMPLIFICATION: f32 = 8.0;

/// The pictures of one map.
pub(super) struct Pictures {
    /// Texels per row and rows of mip 0.
    pub(super) size: (usize, usize),
    /// One pixel of a picture is the mean of this many texels squared.
    pub(super) factor: usize,
    /// Largest |source − reconstruction| of mip 0, 1 being full scale; `None` without a source.
    pub(super) largest_difference: Option<f32>,
    /// One strip for each group of at most three channels.
    pub(super) strips: Vec<Strip>,
}

/// Up to three channels of a map in one picture.
pub(super) struct Strip {
    /// The channels, counted within the map.
    pub(super) channels: Range<usize>,
    /// Pixels per row.
    pub(super) width: usize,
    /// Pixel rows.
    pub(super) height: usize,
    /// Data URIs of source and difference; `None` without a source.
    pub(super) compared: Option<Compared>,
    /// Data URI of the reconstruction.
    pub(super) decoded: String,
}

/// What only a map with a source has.
pub(super) struct Compared {
    /// Data URI of the source.
    pub(super) source: String,
    /// Data URI of the amplified difference.
    pub(super) difference: String,
}

impl Pictures {
    /// Draws a map: 1 channel as grey, 2 in two colours, 3 as RGB, more in groups of three.
    ///
    /// # Errors
    /// When the map is empty, the shapes differ, or PNG encoding fails.
    pub(super) fn draw(map: &MapPicture<'_>) -> Result<Pictures, ReportError> {
        let (channels, rows, columns) = map.decoded.dim();
        if map.decoded.is_empty() {
            return Err(ReportError::Empty {
                map: map.map.to_owned(),
                found: map.decoded.dim(),
            });
        }
        if let Some(source) = map.source
            && source.dim() != map.decoded.dim()
        {
            return Err(ReportError::Shape {
                map: map.map.to_owned(),
                found: source.dim(),
                allowed: map.decoded.dim(),
            });
        }
        let factor = rows.max(columns).div_ceil(LARGEST_SIDE);
        let difference = map.source.map(|source| {
            let mut difference = &source - &map.decoded;
            difference.mapv_inplace(f32::abs);
            difference
        });
        let mut strips = Vec::new();
        for first in (0..channels).step_by(3) {
            let group = first..channels.min(first + 3);
            let uri = |texels: ArrayView3<'_, f32>, gain: f32| {
                let part = texels.slice_axis_move(Axis(0), Slice::from(group.clone()));
                data_uri(&(reduced(part, factor) * gain)).map_err(|error| ReportError::Png {
                    map: map.map.to_owned(),
                    source: error,
                })
            };
            let compared = match (map.source, &difference) {
                (Some(source), Some(difference)) => Some(Compared {
                    source: uri(source, 1.0)?,
                    difference: uri(difference.view(), AMPLIFICATION)?,
                }),
                (None, _) | (_, None) => None,
            };
            let decoded = uri(map.decoded, 1.0)?;
            let (width, height) = (columns.div_ceil(factor), rows.div_ceil(factor));
            strips.push(Strip {
                channels: group,
                width,
                height,
                compared,
                decoded,
            });
        }
        Ok(Pictures {
            size: (columns, rows),
            factor,
            largest_difference: difference.map(|all| all.iter().copied().fold(0.0, f32::max)),
            strips,
        })
    }
}

/// Means over boxes of `factor` × `factor` texels; those at the right and lower edge may be cut.
pub(super) fn reduced(texels: ArrayView3<'_, f32>, factor: usize) -> Array3<f32> {
    if factor == 1 {
        return texels.to_owned();
    }
    let (channels, rows, columns) = texels.dim();
    let shape = (channels, rows.div_ceil(factor), columns.div_ceil(factor));
    Array3::from_shape_fn(shape, |(channel, row, column)| {
        let (top, left) = (row * factor, column * factor);
        let (bottom, right) = (rows.min(top + factor), columns.min(left + factor));
        let mut sum = 0.0;
        for y in top..bottom {
            for x in left..right {
                sum += texels[[channel, y, x]];
            }
        }
        sum / ((bottom - top) * (right - left)) as f32
    })
}

/// \[1 to 3 channels, row, column\] as a PNG; values outside 0..=1 are clipped.
fn data_uri(texels: &Array3<f32>) -> Result<String, image::ImageError> {
    let (channels, rows, columns) = texels.dim();
    // A cast to u8 saturates, and takes NaN to 0.
    let code = |value: f32| (value * 255.0).round() as u8;
    let mut codes = Vec::with_capacity(rows * columns * 3);
    for row in 0..rows {
        for column in 0..columns {
            let texel = |channel: usize| texels[[channel, row, column]];
            match channels {
                1 => codes.push(code(texel(0))),
                // First channel red, second blue, their mean green: equal values are grey, and
                // no hue is red against green.
                2 => codes.extend([texel(0), (texel(0) + texel(1)) / 2.0, texel(1)].map(code)),
                _ => codes.extend([texel(0), texel(1), texel(2)].map(code)),
            }
        }
    }
    let colour = if channels == 1 {
        ExtendedColorType::L8
    } else {
        ExtendedColorType::Rgb8
    };
    uri(&codes, columns as u32, rows as u32, colour)
}

/// Codes, row after row, as a PNG inside a data URI.
///
/// # Errors
/// When PNG encoding fails.
pub(super) fn uri(
    codes: &[u8],
    width: u32,
    height: u32,
    colour: ExtendedColorType,
) -> Result<String, image::ImageError> {
    let mut file = Vec::new();
    PngEncoder::new_with_quality(&mut file, CompressionType::Default, FilterType::Adaptive)
        .write_image(codes, width, height, colour)?;
    Ok(format!("data:image/png;base64,{}", STANDARD.encode(file)))
}
