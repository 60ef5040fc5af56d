//! One map at one mip to an image file.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use ndarray::{Array3, ArrayView3, Axis, Slice};
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
/// See [`MapWriter`], of which this is the use with all rows at once.
///
/// # Errors
///
/// As [`MapWriter`]'s.
pub fn write_map(
    path: &Path,
    values: &ArrayView3<'_, f32>,
    depth: Depth,
) -> Result<(), WriteMapError> {
    let mut writer = MapWriter::create(path, values.dim(), depth)?;
    writer.rows(values)?;
    writer.finish()
}

/// One map on its way to a file, rows from the top.
///
/// One channel is written as grey, two as grey and alpha, three as RGB, four as RGBA. The image is
/// written beside its path and renamed by [`MapWriter::finish`], so the path never holds half a file.
/// A PNG needs memory for some rows; an EXR is held until it is finished.
pub struct MapWriter {
    path: PathBuf,
    file: NamedTempFile,
    /// Channels, rows, columns.
    shape: (usize, usize, usize),
    rows: usize,
    sink: Sink,
}

enum Sink {
    Eight(PngRows),
    Sixteen(PngRows),
    Float(Array3<f32>),
}

type PngRows = png::StreamWriter<'static, BufWriter<File>>;

impl MapWriter {
    /// Begins a file for `shape` (channels, rows, columns).
    ///
    /// # Errors
    ///
    /// [`WriteMapError`]: more than 4 channels or no texel, an extension that does not go with
    /// `depth`, or a failure to write.
    pub fn create(
        path: &Path,
        shape: (usize, usize, usize),
        depth: Depth,
    ) -> Result<MapWriter, WriteMapError> {
        let (channels, height, width) = shape;
        let small = u32::try_from(width).ok().zip(u32::try_from(height).ok());
        let (Some(size), 1..=4) = (small.filter(|&(w, h)| w > 0 && h > 0), channels) else {
            return Err(WriteMapError::Shape {
                path: path.to_owned(),
                channels,
                width,
                height,
            });
        };
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
        let failed = |found: String| failed(path, found);
        let file = beside::file_for(path).map_err(|e| failed(e.to_string()))?;
        let png = |bits| png_rows(&file, size, channels, bits).map_err(failed);
        let sink = match depth {
            Depth::Eight => Sink::Eight(png(png::BitDepth::Eight)?),
            Depth::Sixteen => Sink::Sixteen(png(png::BitDepth::Sixteen)?),
            Depth::Float => Sink::Float(Array3::zeros(shape)),
        };
        Ok(MapWriter {
            path: path.to_owned(),
            file,
            shape,
            rows: 0,
            sink,
        })
    }

    /// Writes the next rows (`[channel, row, column]`, 0..=1).
    ///
    /// # Errors
    ///
    /// [`WriteMapError`]: a value outside 0..=1, rows of another shape or beyond the last, or a
    /// failure to write.
    pub fn rows(&mut self, values: &ArrayView3<'_, f32>) -> Result<(), WriteMapError> {
        let (channels, rows, width) = values.dim();
        let rows_after = self.rows + rows;
        if (channels, width) != (self.shape.0, self.shape.2) || rows_after > self.shape.1 {
            return Err(WriteMapError::Shape {
                path: self.path.clone(),
                channels,
                width,
                height: rows_after,
            });
        }
        if let Some(((channel, row, column), &found)) = values
            .indexed_iter()
            .find(|(_, v)| !(0.0..=1.0).contains(*v))
        {
            return Err(WriteMapError::Range {
                path: self.path.clone(),
                channel,
                row: self.rows + row,
                column,
                found,
            });
        }
        let written = match &mut self.sink {
            Sink::Eight(out) => {
                let codes = interleaved(values).map(|v| (v * 255.0).round() as u8);
                out.write_all(&codes.collect::<Vec<u8>>())
            }
            Sink::Sixteen(out) => {
                let codes = interleaved(values).map(|v| (v * 65535.0).round() as u16);
                out.write_all(&codes.flat_map(u16::to_be_bytes).collect::<Vec<u8>>())
            }
            Sink::Float(held) => {
                held.slice_axis_mut(Axis(1), Slice::from(self.rows..rows_after))
                    .assign(values);
                Ok(())
            }
        };
        self.rows = rows_after;
        written.map_err(|e| failed(&self.path, e.to_string()))
    }

    /// Completes the file and puts it in its place.
    ///
    /// # Errors
    ///
    /// [`WriteMapError`]: rows are missing, or a failure to write.
    pub fn finish(mut self) -> Result<(), WriteMapError> {
        let failed = |found: String| failed(&self.path, found);
        if self.rows != self.shape.1 {
            return Err(failed(format!("{} of {} rows", self.rows, self.shape.1)));
        }
        match self.sink {
            Sink::Eight(out) | Sink::Sixteen(out) => {
                out.finish().map_err(|e| failed(e.to_string()))?;
            }
            Sink::Float(held) => {
                exr_file::write(&mut self.file, held.view()).map_err(|e| failed(e.to_string()))?;
            }
        }
        self.file
            .persist(&self.path)
            .map_err(|e| failed(e.error.to_string()))?;
        Ok(())
    }
}

fn failed(path: &Path, found: String) -> WriteMapError {
    WriteMapError::Failed {
        path: path.to_owned(),
        found,
    }
}

fn png_rows(
    file: &NamedTempFile,
    (width, height): (u32, u32),
    channels: usize,
    depth: png::BitDepth,
) -> Result<PngRows, String> {
    let out = BufWriter::new(file.reopen().map_err(|e| e.to_string())?);
    let mut encoder = png::Encoder::new(out, width, height);
    encoder.set_color(
        [
            png::ColorType::Grayscale,
            png::ColorType::GrayscaleAlpha,
            png::ColorType::Rgb,
            png::ColorType::Rgba,
        ][channels - 1],
    );
    encoder.set_depth(depth);
    encoder.set_compression(png::Compression::Balanced);
    let writer = encoder.write_header().map_err(|e| e.to_string())?;
    writer.into_stream_writer().map_err(|e| e.to_string())
}

/// Values in the order of an image file: rows, columns, channels. In f64, so that the product
/// with the largest code does not move a value across a rounding boundary.
fn interleaved<'a>(values: &ArrayView3<'a, f32>) -> impl Iterator<Item = f64> + use<'a> {
    values
        .permuted_axes([1, 2, 0])
        .into_iter()
        .map(|&v| f64::from(v))
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
