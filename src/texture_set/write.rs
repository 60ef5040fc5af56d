//! One map at one mip to an image file.

use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use ndarray::ArrayView3;
use tempfile::NamedTempFile;

use super::exr_file;
use crate::beside;

/// Depth of the codes written, which decides the file format.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Depth {
    /// PNG with 8-bit codes, round(255·v).
    Eight,
    /// PNG with 16-bit codes, round(65535·v).
    Sixteen,
    /// EXR with the values as f32.
    Float,
}

impl Depth {
    /// Extension of the file, without the dot: `png` or `exr`.
    #[must_use]
    pub fn extension(self) -> &'static str {
        match self {
            Depth::Eight | Depth::Sixteen => "png",
            Depth::Float => "exr",
        }
    }
}

/// Why a map was not written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WriteMapError {
    /// The array is no image.
    #[error(
        "{}: found {channels} channels of {width} x {height} texels, allowed are 1 to 4 channels \
         of at least 1 x 1",
        path.display()
    )]
    Shape {
        /// The file that was to be written.
        path: PathBuf,
        /// Channels found.
        channels: usize,
        /// Columns found.
        width: usize,
        /// Rows found.
        height: usize,
    },
    /// A value has no code.
    #[error(
        "{}: found {found} at channel {channel}, row {row}, column {column}, allowed is 0 to 1",
        path.display()
    )]
    Range {
        /// The file that was to be written.
        path: PathBuf,
        /// Channel within the map, from 0.
        channel: usize,
        /// Row from the top, from 0.
        row: usize,
        /// Column from the left, from 0.
        column: usize,
        /// The value.
        found: f32,
    },
    /// The name promises another format than the depth.
    #[error("{}: found another extension, allowed is .{allowed} for this depth", path.display())]
    Extension {
        /// The file that was to be written.
        path: PathBuf,
        /// Extension that goes with the depth.
        allowed: &'static str,
    },
    /// The file system or the encoder said no; the file at `path` is as it was before.
    #[error("{}: cannot be written: {found}", path.display())]
    Failed {
        /// The file that was to be written.
        path: PathBuf,
        /// The system's or the encoder's words.
        found: String,
    },
}

/// Writes `values` (`[channel, row, column]`, 1 to 4 channels, 0..=1) to `path`.
///
/// One channel is written as grey, two as grey and alpha, three as RGB, four as RGBA. The image is
/// written beside `path` and renamed when complete, so `path` never holds half a file.
///
/// # Errors
///
/// [`WriteMapError`]: more than 4 channels or no texel, a value outside 0..=1, an extension that
/// does not go with `depth`, or a failure to write.
pub fn write_map(
    path: &Path,
    values: &ArrayView3<'_, f32>,
    depth: Depth,
) -> Result<(), WriteMapError> {
    let (channels, height, width) = values.dim();
    let small = u32::try_from(width).ok().zip(u32::try_from(height).ok());
    let (Some(size), 1..=4) = (small.filter(|&(w, h)| w > 0 && h > 0), channels) else {
        return Err(WriteMapError::Shape {
            path: path.to_owned(),
            channels,
            width,
            height,
        });
    };
    if let Some(((channel, row, column), &found)) = values
        .indexed_iter()
        .find(|(_, v)| !(0.0..=1.0).contains(*v))
    {
        return Err(WriteMapError::Range {
            path: path.to_owned(),
            channel,
            row,
            column,
            found,
        });
    }
    let allowed = depth.extension();
    if !path
        .extension()
        .is_some_and(|found| found.eq_ignore_ascii_case(allowed))
    {
        return Err(WriteMapError::Extension {
            path: path.to_owned(),
            allowed,
        });
    }
    let failed = |found: String| WriteMapError::Failed {
        path: path.to_owned(),
        found,
    };
    let mut file = beside::file_for(path).map_err(|e| failed(e.to_string()))?;
    match depth {
        Depth::Eight => {
            let codes: Vec<u8> = interleaved(values)
                .map(|v| (v * 255.0).round() as u8)
                .collect();
            write_png(
                &mut file,
                &codes,
                size,
                [
                    ExtendedColorType::L8,
                    ExtendedColorType::La8,
                    ExtendedColorType::Rgb8,
                    ExtendedColorType::Rgba8,
                ][channels - 1],
            )
            .map_err(failed)?;
        }
        Depth::Sixteen => {
            let codes: Vec<u8> = interleaved(values)
                .flat_map(|v| ((v * 65535.0).round() as u16).to_ne_bytes())
                .collect();
            write_png(
                &mut file,
                &codes,
                size,
                [
                    ExtendedColorType::L16,
                    ExtendedColorType::La16,
                    ExtendedColorType::Rgb16,
                    ExtendedColorType::Rgba16,
                ][channels - 1],
            )
            .map_err(failed)?;
        }
        Depth::Float => {
            exr_file::write(&mut file, values.view()).map_err(|e| failed(e.to_string()))?;
        }
    }
    file.persist(path)
        .map_err(|e| failed(e.error.to_string()))?;
    Ok(())
}

/// Values in the order of an image file: rows, columns, channels. In f64, so that the product
/// with the largest code does not move a value across a rounding boundary.
fn interleaved<'a>(values: &ArrayView3<'a, f32>) -> impl Iterator<Item = f64> + use<'a> {
    values
        .permuted_axes([1, 2, 0])
        .into_iter()
        .map(|&v| f64::from(v))
}

fn write_png(
    file: &mut NamedTempFile,
    codes: &[u8],
    (width, height): (u32, u32),
    color: ExtendedColorType,
) -> Result<(), String> {
    let mut out = BufWriter::new(file);
    PngEncoder::new_with_quality(&mut out, CompressionType::Default, FilterType::Adaptive)
        .write_image(codes, width, height, color)
        .map_err(|e| e.to_string())?;
    out.flush().map_err(|e| e.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::texture_set::decode::decode;
    use ndarray::Array3;

    /// Every 8-bit code, spread over `channels` channels of 16 × 16 texels.
    fn codes(channels: usize, max: f32) -> Array3<f32> {
        Array3::from_shape_fn((channels, 16, 16), |(c, y, x)| {
            ((16 * y + x + 37 * c) % 256) as f32 / max
        })
    }

    #[test]
    fn every_depth_and_channel_count_is_read_back_exactly() {
        let folder = tempfile::tempdir().unwrap();
        for channels in 1..=4 {
            for (depth, max, bits) in [
                (Depth::Eight, 255.0, 8),
                (Depth::Sixteen, 65535.0, 16),
                (Depth::Float, 300.0, 32),
            ] {
                let path = folder.path().join(format!("x.{}", depth.extension()));
                let values = codes(channels, max);
                write_map(&path, &values.view(), depth).unwrap();
                let planes = decode(&path).unwrap();
                assert_eq!(planes.values, values, "{channels} {depth:?}");
                assert_eq!(planes.bit_depth, bits);
                assert_eq!(planes.alpha, channels % 2 == 0);
            }
        }
    }

    #[test]
    fn every_sixteen_bit_code_survives() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.png");
        let values =
            Array3::from_shape_fn((1, 256, 256), |(_, y, x)| (256 * y + x) as f32 / 65535.0);
        write_map(&path, &values.view(), Depth::Sixteen).unwrap();
        assert_eq!(decode(&path).unwrap().values, values);
    }

    #[test]
    fn values_round_to_the_nearest_code() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.png");
        let values = ndarray::array![[[0.49 / 255.0, 0.51 / 255.0, 1.0]]];
        write_map(&path, &values.view(), Depth::Eight).unwrap();
        let read = decode(&path).unwrap().values;
        assert_eq!(read, ndarray::array![[[0.0, 1.0 / 255.0, 1.0]]]);
    }

    #[test]
    fn a_refused_map_leaves_the_old_file_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.png");
        write_map(&path, &codes(1, 255.0).view(), Depth::Eight).unwrap();
        let before = std::fs::read(&path).unwrap();
        let five = Array3::zeros((5, 2, 2));
        let mut nan = Array3::zeros((1, 2, 2));
        nan[[0, 1, 0]] = f32::NAN;
        for (bad, depth) in [
            (&five, Depth::Eight),
            (&nan, Depth::Eight),
            (&nan, Depth::Float),
        ] {
            write_map(&path, &bad.view(), depth).unwrap_err();
        }
        write_map(&path, &codes(1, 255.0).view(), Depth::Float).unwrap_err();
        write_map(
            &folder.path().join("no/x.png"),
            &codes(1, 255.0).view(),
            Depth::Eight,
        )
        .unwrap_err();
        assert_eq!(std::fs::read(&path).unwrap(), before);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
