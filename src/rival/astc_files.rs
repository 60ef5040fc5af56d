//! ASTC files: an image on its way to `astcenc` and back.

use super::RivalError;
use super::packing::Pack;
use crate::texture_set::Depth;
use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image, SmallVec, WritableImage as _,
    read_first_rgba_layer_from_file,
};
use ndarray::{Array3, ArrayView3, Axis, concatenate};
use std::fmt;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

/// Bytes before the blocks in an `.astc` file.
const HEADER_BYTES: u64 = 16;

/// The files of one image on its way.
pub(super) struct Files {
    /// What is encoded.
    pub(super) source: PathBuf,
    /// The blocks.
    pub(super) blocks: PathBuf,
    /// What was decoded.
    pub(super) decoded: PathBuf,
    depth: Depth,
}

impl Files {
    pub(super) fn new(folder: &Path, pack: &Pack) -> Files {
        let depth = if pack.is_deep {
            Depth::Float
        } else {
            Depth::Eight
        };
        let extension = depth.extension();
        Files {
            source: folder.join(format!("source.{extension}")),
            blocks: folder.join("blocks.astc"),
            decoded: folder.join(format!("decoded.{extension}")),
            depth,
        }
    }

    /// Writes the source: one channel as it is, two with a third of zeros that is not read.
    pub(super) fn write(&self, image: ArrayView3<'_, f32>) -> Result<(), RivalError> {
        let (channels, height, width) = image.dim();
        // astcenc takes the channels of an EXR by the names R, G, B and A.
        let padding = match (channels, self.depth) {
            (1, Depth::Float) => 2,
            (2, _) => 1,
            (_, _) => 0,
        };
        let zeros = Array3::zeros((padding, height, width));
        let padded = concatenate(Axis(0), &[image, zeros.view()])
            .map_err(|error| self.fault(&self.source, error.to_string()))?;
        match self.depth {
            Depth::Eight | Depth::Sixteen => self.write_png(padded.view()),
            Depth::Float => self.write_exr(padded.view()),
        }
    }

    /// Without compression: the reader in `astcenc` refuses some streams that others take.
    fn write_png(&self, image: ArrayView3<'_, f32>) -> Result<(), RivalError> {
        let fault = |error: &dyn fmt::Display| self.fault(&self.source, error.to_string());
        let (channels, height, width) = image.dim();
        let file = File::create(&self.source).map_err(|error| fault(&error))?;
        let mut encoder = png::Encoder::new(BufWriter::new(file), width as u32, height as u32);
        encoder.set_color(match channels {
            1 => png::ColorType::Grayscale,
            3 => png::ColorType::Rgb,
            _ => png::ColorType::Rgba,
        });
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_compression(png::Compression::NoCompression);
        let texels = image.permuted_axes([1, 2, 0]);
        let codes: Vec<u8> = texels
            .iter()
            .map(|&v| (f64::from(v) * 255.0).round() as u8)
            .collect();
        let mut writer = encoder.write_header().map_err(|error| fault(&error))?;
        writer
            .write_image_data(&codes)
            .map_err(|error| fault(&error))?;
        writer.finish().map_err(|error| fault(&error))
    }

    /// In scan lines: what astcenc reads from tiles that the image does not fill is not the image.
    fn write_exr(&self, image: ArrayView3<'_, f32>) -> Result<(), RivalError> {
        let (_, height, width) = image.dim();
        let planes = image.outer_iter();
        let channels: SmallVec<[AnyChannel<FlatSamples>; 4]> = ["R", "G", "B", "A"]
            .into_iter()
            .zip(planes)
            .map(|(name, plane)| {
                AnyChannel::new(name, FlatSamples::F32(plane.iter().copied().collect()))
            })
            .collect();
        let channels = AnyChannels::sort(channels);
        Image::from_encoded_channels((width, height), Encoding::UNCOMPRESSED, channels)
            .write()
            .to_file(&self.source)
            .map_err(|error| self.fault(&self.source, error.to_string()))
    }

    /// Bits of the blocks in the file, which must be as many as the image needs.
    pub(super) fn bits(&self, needed: u64) -> Result<u64, RivalError> {
        let size = std::fs::metadata(&self.blocks)
            .map_err(|error| self.fault(&self.blocks, error.to_string()))?
            .len();
        let bits = 8 * size.saturating_sub(HEADER_BYTES);
        if bits == needed {
            Ok(bits)
        } else {
            let found = format!("found {bits} bits of blocks; allowed: {needed}");
            Err(self.fault(&self.blocks, found))
        }
    }

    /// Reads what was decoded: red, green, blue and alpha.
    pub(super) fn read(&self, (height, width): (usize, usize)) -> Result<Array3<f32>, RivalError> {
        let fault = |found: String| self.fault(&self.decoded, found);
        let image = match self.depth {
            Depth::Float => {
                let image = read_first_rgba_layer_from_file(
                    &self.decoded,
                    |size, _| Array3::zeros((4, size.height(), size.width())),
                    |image: &mut Array3<f32>, at, (r, g, b, a): (f32, f32, f32, f32)| {
                        for (channel, value) in [r, g, b, a].into_iter().enumerate() {
                            image[[channel, at.y(), at.x()]] = value;
                        }
                    },
                );
                image
                    .map_err(|error| fault(error.to_string()))?
                    .layer_data
                    .channel_data
                    .pixels
            }
            Depth::Eight | Depth::Sixteen => {
                let image = image::open(&self.decoded).map_err(|error| fault(error.to_string()))?;
                let image = image.into_rgba8();
                let size = (4, image.height() as usize, image.width() as usize);
                Array3::from_shape_fn(size, |(channel, y, x)| {
                    f32::from(image.get_pixel(x as u32, y as u32).0[channel]) / 255.0
                })
            }
        };
        if image.dim() == (4, height, width) {
            Ok(image)
        } else {
            let (_, rows, columns) = image.dim();
            Err(fault(format!(
                "found {columns} × {rows} texels; allowed: {width} × {height}"
            )))
        }
    }

    fn fault(&self, path: &Path, found: String) -> RivalError {
        RivalError::File {
            path: path.to_owned(),
            found,
        }
    }
}
