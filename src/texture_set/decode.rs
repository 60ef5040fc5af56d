//! One image file to planes of stored codes.

use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::Path;

use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};
use ndarray::{Array3, ArrayView3};

use super::{MAX_SIZE, TextureSetError, exr_file};

/// A decoded file.
#[derive(Debug)]
pub(super) struct Planes {
    /// `[component, row, column]`, stored code / largest code.
    pub(super) values: Array3<f32>,
    /// Whether the last component is alpha.
    pub(super) alpha: bool,
    /// 8, 16, or 32 for floating point.
    pub(super) bit_depth: u8,
}

/// Whether files with this extension (any case, no dot) are read.
pub(super) fn is_image(extension: &str) -> bool {
    const READ: [&str; 7] = ["png", "jpg", "jpeg", "tga", "tif", "tiff", "exr"];
    READ.iter()
        .any(|known| extension.eq_ignore_ascii_case(known))
}

/// Width and height in texels as the header tells them, checked against [`MAX_SIZE`]. No texel is
/// read and nothing of the image's size is allocated.
pub(super) fn size(path: &Path) -> Result<(u32, u32), TextureSetError> {
    if is_exr(path)? {
        return exr_file::size(path);
    }
    let (width, height) = open(path)?
        .into_decoder()
        .map_err(|e| fault(path, &e))?
        .dimensions();
    checked_size(path, u64::from(width), u64::from(height))
}

/// Decodes the whole file.
pub(super) fn decode(path: &Path) -> Result<Planes, TextureSetError> {
    let planes = if is_exr(path)? {
        exr_file::decode(path)?
    } else {
        decode_codes(path)?
    };
    if planes.bit_depth == 32 {
        check_range(path, planes.values.view())?;
    }
    Ok(planes)
}

/// `width` × `height` as the sizes of a map, or the error that says what is allowed.
pub(super) fn checked_size(
    path: &Path,
    width: u64,
    height: u64,
) -> Result<(u32, u32), TextureSetError> {
    let side = |size: u64| {
        u32::try_from(size)
            .ok()
            .filter(|side| (1..=MAX_SIZE).contains(side))
    };
    side(width)
        .zip(side(height))
        .ok_or_else(|| TextureSetError::Size {
            path: path.to_owned(),
            width,
            height,
        })
}

fn decode_codes(path: &Path) -> Result<Planes, TextureSetError> {
    let reader = open(path)?;
    let jpeg = reader.format() == Some(ImageFormat::Jpeg);
    let mut decoder = reader.into_decoder().map_err(|e| fault(path, &e))?;
    let (width, height) = decoder.dimensions();
    let (width, height) = checked_size(path, u64::from(width), u64::from(height))?;
    let mut limits = Limits::no_limits();
    limits.max_image_width = Some(MAX_SIZE);
    limits.max_image_height = Some(MAX_SIZE);
    // The texels themselves, once more as scratch, and room for tables.
    limits.max_alloc = Some(
        decoder
            .total_bytes()
            .saturating_mul(2)
            .saturating_add(64 << 20),
    );
    decoder.set_limits(limits).map_err(|e| fault(path, &e))?;
    let image = DynamicImage::from_decoder(decoder).map_err(|e| fault(path, &e))?;
    if jpeg {
        check_jpeg_end(path)?;
    }
    let size = (height as usize, width as usize);
    let planes = |values, alpha, bit_depth| Planes {
        values,
        alpha,
        bit_depth,
    };
    Ok(match image {
        DynamicImage::ImageLuma8(i) => planes(planar(i.as_raw(), 1, size, eight), false, 8),
        DynamicImage::ImageLumaA8(i) => planes(planar(i.as_raw(), 2, size, eight), true, 8),
        DynamicImage::ImageRgb8(i) => planes(planar(i.as_raw(), 3, size, eight), false, 8),
        DynamicImage::ImageRgba8(i) => planes(planar(i.as_raw(), 4, size, eight), true, 8),
        DynamicImage::ImageLuma16(i) => planes(planar(i.as_raw(), 1, size, sixteen), false, 16),
        DynamicImage::ImageLumaA16(i) => planes(planar(i.as_raw(), 2, size, sixteen), true, 16),
        DynamicImage::ImageRgb16(i) => planes(planar(i.as_raw(), 3, size, sixteen), false, 16),
        DynamicImage::ImageRgba16(i) => planes(planar(i.as_raw(), 4, size, sixteen), true, 16),
        DynamicImage::ImageRgb32F(i) => planes(planar(i.as_raw(), 3, size, |v| v), false, 32),
        DynamicImage::ImageRgba32F(i) => planes(planar(i.as_raw(), 4, size, |v| v), true, 32),
        other => {
            return Err(TextureSetError::Decode {
                path: path.to_owned(),
                found: format!("texels of kind {:?}", other.color()),
            });
        }
    })
}

fn eight(code: u8) -> f32 {
    f32::from(code) / 255.0
}

fn sixteen(code: u16) -> f32 {
    f32::from(code) / 65535.0
}

fn planar<T: Copy>(
    codes: &[T],
    components: usize,
    (height, width): (usize, usize),
    value: impl Fn(T) -> f32,
) -> Array3<f32> {
    let mut values = Array3::zeros((components, height, width));
    for (component, mut plane) in values.outer_iter_mut().enumerate() {
        let codes = codes.iter().skip(component).step_by(components);
        for (texel, &code) in plane.iter_mut().zip(codes) {
            *texel = value(code);
        }
    }
    values
}

fn check_range(path: &Path, values: ArrayView3<'_, f32>) -> Result<(), TextureSetError> {
    let outside = values
        .indexed_iter()
        .find(|(_, v)| !(0.0..=1.0).contains(*v));
    outside.map_or(Ok(()), |((component, row, column), &found)| {
        Err(TextureSetError::Range {
            path: path.to_owned(),
            component,
            row,
            column,
            found,
        })
    })
}

/// The JPEG decoder fills what a truncated file lacks with grey. A whole file has an end marker.
fn check_jpeg_end(path: &Path) -> Result<(), TextureSetError> {
    const END_OF_IMAGE: [u8; 2] = [0xff, 0xd9];
    // Padding and trailing metadata after the marker are common and harmless.
    const TAIL: u64 = 64 << 10;
    let io = |source| TextureSetError::Io {
        path: path.to_owned(),
        source,
    };
    let mut file = File::open(path).map_err(io)?;
    let length = file.metadata().map_err(io)?.len();
    file.seek(SeekFrom::Start(length.saturating_sub(TAIL)))
        .map_err(io)?;
    let mut tail = Vec::new();
    file.read_to_end(&mut tail).map_err(io)?;
    if tail.windows(2).any(|pair| pair == END_OF_IMAGE) {
        return Ok(());
    }
    Err(TextureSetError::Decode {
        path: path.to_owned(),
        found: "the file ends before the image does".to_owned(),
    })
}

fn open(path: &Path) -> Result<ImageReader<BufReader<File>>, TextureSetError> {
    let io = |source| TextureSetError::Io {
        path: path.to_owned(),
        source,
    };
    let mut reader = ImageReader::open(path)
        .map_err(io)?
        .with_guessed_format()
        .map_err(io)?;
    // Sizes are checked by the caller, whose message names what is allowed.
    reader.limits(Limits::no_limits());
    Ok(reader)
}

fn is_exr(path: &Path) -> Result<bool, TextureSetError> {
    const MAGIC: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];
    let io = |source| TextureSetError::Io {
        path: path.to_owned(),
        source,
    };
    let mut first = Vec::new();
    File::open(path)
        .map_err(io)?
        .take(4)
        .read_to_end(&mut first)
        .map_err(io)?;
    let named = path
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("exr"));
    Ok(first == MAGIC || named)
}

fn fault(path: &Path, error: &image::ImageError) -> TextureSetError {
    TextureSetError::Decode {
        path: path.to_owned(),
        found: error.to_string(),
    }
}
