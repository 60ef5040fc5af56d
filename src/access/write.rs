//! A stream as a trace file.

use super::columns::{Column, Kind};
use super::error::AccessError;
use crate::beside;
use crate::isa::sampler::Detail;
use crate::model::stream::{DetailKind, Scene, Stream, TexelDemands};
use crate::model::{Demand, Demands as _};
use std::io::{BufWriter, Error, Write};
use std::path::Path;

/// Writes a stream as CSV, beside its place and renamed; gives the rows.
///
/// A texel scan becomes texels, a scene the samples of its pixels: read with the same materials, the
/// file gives the stream's demands.
///
/// # Errors
/// When the file cannot be written.
pub fn write_csv(stream: &Stream<'_>, path: &Path) -> Result<u64, AccessError> {
    let written = || {
        let mut file = beside::file_for(path)?;
        let mut out = BufWriter::new(file.as_file_mut());
        let rows = match stream {
            Stream::Texels(texels) => write_texels(texels.part(0..texels.tiles()), &mut out),
            Stream::Scene(scene) => write_samples(scene, &mut out),
        }?;
        out.flush()?;
        drop(out);
        file.as_file().sync_all()?;
        file.persist(path)?;
        Ok(rows)
    };
    written().map_err(|source| AccessError::Io {
        path: path.to_owned(),
        source,
    })
}

fn write_header(kind: Kind, out: &mut impl Write) -> Result<(), Error> {
    let before = [Column::PixelX, Column::PixelY, Column::Material];
    let columns = before.iter().chain(kind.columns());
    let names: Vec<&str> = columns.map(|column| column.name()).collect();
    writeln!(out, "{}", names.join(","))
}

fn write_texels(mut demands: TexelDemands<'_>, out: &mut impl Write) -> Result<u64, Error> {
    write_header(Kind::Texels, out)?;
    let (mut demand, mut rows) = (Demand::default(), 0);
    loop {
        let Ok(is_there) = demands.advance(&mut demand);
        if !is_there {
            return Ok(rows);
        }
        let [column, row] = demand.pixel;
        for place in &demand.places {
            // The centre of texel n is at 2n + 1 half texels.
            let (x, y) = (place.x() / 2, place.y() / 2);
            let (material, mip) = (demand.material, place.mip());
            writeln!(out, "{column},{row},{material},{x},{y},{mip}")?;
            rows += 1;
        }
    }
}

fn write_samples(scene: &Scene<'_>, out: &mut impl Write) -> Result<u64, Error> {
    write_header(kind_of(scene.detail()), out)?;
    let mut rows = 0;
    for sample in scene.samples(0..scene.tiles()) {
        let [column, row] = sample.pixel;
        write!(out, "{column},{row},{}", sample.material)?;
        let [u, v] = sample.request.place;
        match sample.request.detail {
            Detail::Lod(lod) => write_numbers(&[u, v, lod], out)?,
            Detail::Gradients { x, y } => write_numbers(&[u, v, x[0], x[1], y[0], y[1]], out)?,
            Detail::Footprint(_) => return Err(Error::other("a footprint has no columns")),
        }
        rows += 1;
    }
    Ok(rows)
}

const fn kind_of(detail: DetailKind) -> Kind {
    match detail {
        DetailKind::Lod => Kind::Lods,
        DetailKind::Gradients => Kind::Gradients,
    }
}

/// Each as the shortest text that is read as the same number.
fn write_numbers(numbers: &[u32], out: &mut impl Write) -> Result<(), Error> {
    for &bits in numbers {
        write!(out, ",{:?}", f32::from_bits(bits))?;
    }
    writeln!(out)
}
