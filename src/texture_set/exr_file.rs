//! OpenEXR files, read and written channel by channel: maps in them are often a single `Y`.

use std::io::{Seek, Write};
use std::path::Path;

use exr::prelude::{
    AnyChannel, AnyChannels, FlatSamples, Image, MetaData, ReadChannels, ReadLayers, SmallVec,
    WritableImage, read,
};
use ndarray::{Array3, ArrayView3};

use super::TextureSetError;
use super::decode::{Planes, checked_size};

/// Width and height of the data window, from the header.
pub(super) fn size(path: &Path) -> Result<(u32, u32), TextureSetError> {
    let meta = MetaData::read_from_file(path, false).map_err(|e| fault(path, e.to_string()))?;
    let [header] = meta.headers.as_slice() else {
        return Err(fault(
            path,
            format!("found {} layers, allowed is 1", meta.headers.len()),
        ));
    };
    if header.deep {
        return Err(fault(
            path,
            "found deep data, allowed are flat samples".to_owned(),
        ));
    }
    if header
        .channels
        .list
        .iter()
        .any(|channel| channel.sampling.area() != 1)
    {
        return Err(fault(
            path,
            "found subsampled channels, allowed is full size".to_owned(),
        ));
    }
    checked_size(
        path,
        header.layer_size.width() as u64,
        header.layer_size.height() as u64,
    )
}

/// Decodes the file: `R G B`, `R G B A`, `Y A`, or any single channel.
pub(super) fn decode(path: &Path) -> Result<Planes, TextureSetError> {
    let (width, height) = size(path)?;
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_file(path)
        .map_err(|e| fault(path, e.to_string()))?;
    let list = image.layer_data.channel_data.list;
    let names: Vec<String> = list
        .iter()
        .map(|channel| channel.name.to_string())
        .collect();
    let find = |name: &str| names.iter().position(|found| found == name);
    let order: Vec<usize> = match (names.len(), find("R"), find("G"), find("B"), find("A")) {
        (1, ..) => vec![0],
        (2, None, None, None, Some(a)) => vec![1 - a, a],
        (3, Some(r), Some(g), Some(b), None) => vec![r, g, b],
        (4, Some(r), Some(g), Some(b), Some(a)) => vec![r, g, b, a],
        _ => {
            return Err(fault(
                path,
                format!(
                    "found channels {}, allowed are R G B, R G B A, one channel, or one and A",
                    names.join(" ")
                ),
            ));
        }
    };
    let shape = (order.len(), height as usize, width as usize);
    let mut samples = Vec::with_capacity(shape.0 * shape.1 * shape.2);
    for &index in &order {
        samples.extend(list[index].sample_data.values_as_f32());
    }
    let values = Array3::from_shape_vec(shape, samples).map_err(|e| fault(path, e.to_string()))?;
    Ok(Planes {
        values,
        alpha: matches!(order.len(), 2 | 4),
        bit_depth: 32,
    })
}

/// Writes `values` (`[channel, row, column]`, 1 to 4 channels) as f32 channels `Y`, `Y A`,
/// `R G B` or `R G B A`.
pub(super) fn write(
    out: &mut (impl Write + Seek),
    values: ArrayView3<'_, f32>,
) -> exr::error::UnitResult {
    let (channels, height, width) = values.dim();
    let names: &[&str] = match channels {
        1 => &["Y"],
        2 => &["Y", "A"],
        3 => &["R", "G", "B"],
        _ => &["R", "G", "B", "A"],
    };
    let channels: SmallVec<[AnyChannel<FlatSamples>; 4]> = names
        .iter()
        .zip(values.outer_iter())
        .map(|(name, plane)| {
            AnyChannel::new(*name, FlatSamples::F32(plane.iter().copied().collect()))
        })
        .collect();
    Image::from_channels((width, height), AnyChannels::sort(channels))
        .write()
        .to_unbuffered(out)
}

fn fault(path: &Path, found: String) -> TextureSetError {
    TextureSetError::Decode {
        path: path.to_owned(),
        found,
    }
}
