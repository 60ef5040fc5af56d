//! The refuse suite: bytes that are no asset, and a few that are.

use super::SuiteError;
use super::container::{Container, seal};
use super::refuse_layers::{half_fields, layer_fields};
use super::refuse_pyramid::pyramid_fields;
use crate::emit::Builder;
use crate::flag::{self, Flag};
use crate::synthetic::{self, Spec, corners, interpolated};
use crate::vector::{Answer, OpenQuery, Query, VectorFile};
use ntmu_isa::Asset;
use ntmu_isa::format::VERSION;

/// Every so many bytes, one bit is flipped; prime, so that all bit positions occur.
const FLIP_STEP: usize = 11;

/// The suite.
///
/// # Errors
/// Never: the spec is within the limits of an asset.
pub fn suite() -> Result<VectorFile, SuiteError> {
    let about = "files that a reader must refuse, and a few that it must accept";
    let mut builder = Builder::new("refuse", about);
    let asset = asset(Spec::small(8, 8).with_bits(7, 8))?;
    let file = asset.to_bytes();
    let Some(container) = Container::parse(&file) else {
        return Ok(builder.build());
    };
    accepted(
        &mut builder,
        "the asset that the others are made from",
        file.clone(),
    );
    let mut with_note = container.clone();
    with_note
        .sections
        .push((*b"note", b"to be skipped".to_vec()));
    accepted(
        &mut builder,
        "an unknown section that may be skipped",
        with_note.to_bytes(),
    );
    damaged(&mut builder, &file);
    table(&mut builder, &container);
    fields(&mut builder, &container, &asset);
    let halves = asset_of_halves()?;
    if let Some(container) = Container::parse(&halves.to_bytes()) {
        accepted(
            &mut builder,
            "an asset of fp16 layers",
            container.to_bytes(),
        );
        half_fields(&mut builder, &container, &halves);
    }
    pyramid_fields(&mut builder, &container)?;
    Ok(builder.build())
}

/// A small asset: three layers, the second with a skip path.
pub(super) fn asset(mut spec: Spec) -> Result<Asset, SuiteError> {
    spec.shape.grids = [corners(1, 3, 3), interpolated(1, 4, 3)];
    (spec.hidden, spec.block_span) = (vec![2], 1);
    synthetic::asset(&spec, 1).map_err(|error| SuiteError::Asset {
        name: "refuse".to_owned(),
        error,
    })
}

fn asset_of_halves() -> Result<Asset, SuiteError> {
    asset(Spec::small(8, 8).with_halves())
}

pub(super) fn accepted(builder: &mut Builder, comment: &str, ntx: Vec<u8>) {
    let request = Query::Open(OpenQuery { ntx });
    builder.exact(comment, &[flag::CONTROL], request, Answer::Accepted(true));
}

/// Files that were damaged on the way.
fn damaged(builder: &mut Builder, file: &[u8]) {
    let length = file.len();
    for end in [
        0,
        1,
        7,
        8,
        12,
        63,
        64,
        65,
        255,
        256,
        257,
        length / 2,
        length - 8,
        length - 1,
    ] {
        let comment = format!("the first {end} of {length} bytes");
        builder.refused(&comment, &[flag::TRUNCATED], file[..end].to_vec());
    }
    for (comment, more) in [
        ("one zero", vec![0]),
        ("eight zeros", vec![0; 8]),
        ("itself", file.to_vec()),
    ] {
        let comment = format!("followed by {comment}");
        builder.refused(&comment, &[flag::OVERLONG], [file, &more].concat());
    }
    let mut stated = [file, &[0; 8]].concat();
    stated[16..24].copy_from_slice(&(length as u64 + 8).to_le_bytes());
    seal(&mut stated);
    builder.refused(
        "eight zeros at the end that the header counts",
        &[flag::OVERLONG],
        stated,
    );
    for (at, byte, comment) in [
        (0, 0x09, "the eighth bit lost"),
        (4, 0x0a, "CR LF as LF LF"),
        (6, 0x00, "the DOS end of file as a zero"),
        (1, b'n', "a lower-case letter"),
    ] {
        let mut foreign = file.to_vec();
        foreign[at] = byte;
        seal(&mut foreign);
        builder.refused(comment, &[flag::MAGIC], foreign);
    }
    let (major, minor) = VERSION;
    for (at, version, comment) in [
        (8, major, "a newer major version"),
        (10, minor, "a newer minor version"),
    ] {
        let mut newer = file.to_vec();
        newer[at..at + 2].copy_from_slice(&(version + 1).to_le_bytes());
        seal(&mut newer);
        builder.refused(comment, &[flag::VERSION], newer);
    }
    for at in (0..length).step_by(FLIP_STEP) {
        let mut flipped = file.to_vec();
        let bit = at % 8;
        flipped[at] ^= 1 << bit;
        builder.refused(
            &format!("bit {bit} of byte {at} flipped"),
            &[flag::BIT_FLIP],
            flipped,
        );
    }
}

/// Files whose table of sections is wrong, with every CRC-32 right.
fn table(builder: &mut Builder, container: &Container) {
    let flags = &[flag::TABLE];
    for (index, (letters, _)) in container.sections.iter().enumerate() {
        let name = String::from_utf8_lossy(letters).into_owned();
        let mut missing = container.clone();
        missing.sections.remove(index);
        builder.refused(&format!("no section {name}"), flags, missing.to_bytes());
        let mut twice = container.clone();
        twice.sections.push(container.sections[index].clone());
        builder.refused(&format!("two sections {name}"), flags, twice.to_bytes());
    }
    let mut unknown = container.clone();
    unknown.sections.push((*b"Note", Vec::new()));
    builder.refused(
        "an unknown section that may not be skipped",
        flags,
        unknown.to_bytes(),
    );
    let file = container.to_bytes();
    let mut patch = |comment: &str, flags: &[Flag], at: usize, byte: u8| {
        let mut patched = file.clone();
        patched[at] = patched[at].wrapping_add(byte);
        seal(&mut patched);
        builder.refused(comment, flags, patched);
    };
    patch("one section fewer than there are", flags, 12, 255);
    patch("one section more than there are", flags, 12, 1);
    patch("2^24 sections", flags, 15, 1);
    patch("a section eight bytes later", flags, 64 + 8, 8);
    patch("a section of 2^56 bytes more", flags, 64 + 23, 1);
    patch("a section at 2^63", flags, 64 + 15, 128);
    patch("a section one byte longer", flags, 64 + 16, 1);
    patch("a reserved bit of the table", &[flag::RESERVED], 64 + 24, 1);
    patch("a reserved bit of the header", &[flag::RESERVED], 40, 1);
    patch("a file of 2^56 bytes more", flags, 23, 1);
}

/// Files whose sections hold what they must not, with every CRC-32 right.
fn fields(builder: &mut Builder, container: &Container, asset: &Asset) {
    let mut change = |comment: &str, flag: Flag, section: &str, at: usize, bytes: &[u8]| {
        let changed = container.with(section, at, bytes).to_bytes();
        builder.refused(comment, &[flag], changed);
    };
    let (range, clash, reserved) = (flag::FIELD_RANGE, flag::CONTRADICTION, flag::RESERVED);
    change("a width of 0", range, "SHAP", 0, &[0; 4]);
    change("a width of 2^32 − 1", range, "SHAP", 0, &[255; 4]);
    change("a height of 16385", range, "SHAP", 4, &[1, 64, 0, 0]);
    change(
        "a width that the grids do not fit",
        clash,
        "SHAP",
        0,
        &[33, 0, 0, 0],
    );
    change("no mips", range, "SHAP", 8, &[0]);
    change("more mips than the size has", range, "SHAP", 8, &[5]);
    change("four octaves", range, "SHAP", 9, &[4]);
    change(
        "two octaves where the layer has inputs for one",
        clash,
        "SHAP",
        9,
        &[2],
    );
    for (at, name, codes) in [(10, "wave", 2), (13, "snap", 2), (14, "address mode", 3)] {
        change(&format!("{name} {codes}"), range, "SHAP", at, &[codes]);
    }
    change("sixteen zeros of padding", range, "SHAP", 11, &[16]);
    change(
        "padding where the layer has no inputs for it",
        clash,
        "SHAP",
        11,
        &[1],
    );
    change("inputs of three bits", range, "SHAP", 12, &[3]);
    change("inputs of 17 bits", range, "SHAP", 12, &[17]);
    change("a reserved bit of the shape", reserved, "SHAP", 15, &[1]);
    change("grid 0 without channels", range, "SHAP", 16, &[0, 0]);
    change("grid 0 with 65535 channels", range, "SHAP", 16, &[255, 255]);
    change("grid 0 of 0 bits", range, "SHAP", 18, &[0]);
    change("grid 0 of 9 bits", range, "SHAP", 18, &[9]);
    change("grid 0 at full resolution", range, "SHAP", 19, &[0]);
    change("sampling 2 of grid 0", range, "SHAP", 20, &[2]);
    change("a reserved bit of grid 0", reserved, "SHAP", 21, &[1]);
    change("grid 1 at 1/16", range, "SHAP", 25, &[4]);
    change(
        "grid 1 by its corners where the layer has inputs for one",
        clash,
        "SHAP",
        26,
        &[0],
    );
    change("no channels", range, "SHAP", 28, &[0, 0]);
    change("17 channels", range, "SHAP", 28, &[17, 0]);
    change("output format 4", range, "SHAP", 30, &[4]);
    for (at, name, codes) in [
        (2, "coordinate", 4),
        (3, "point snap", 2),
        (4, "filter", 4),
        (5, "filter rounding", 4),
        (6, "interpolate", 4),
        (7, "input", 4),
        (9, "overflow", 2),
        (11, "leak", 4),
        (12, "requantize", 5),
        (13, "skip", 5),
        (15, "output", 5),
        (16, "sum", 4),
        (17, "convert", 4),
    ] {
        change(
            &format!("profile {name} {codes}"),
            range,
            "PROF",
            at,
            &[codes],
        );
    }
    for (at, name, low, high) in [
        (0, "subtexel bits", 4, 12),
        (1, "lod bits", 4, 8),
        (8, "accumulator bits", 16, 32),
        (10, "bias bits", 8, 32),
        (14, "residual bits", 8, 32),
    ] {
        for found in [low - 1, high + 1] {
            change(
                &format!("profile {name} {found}"),
                range,
                "PROF",
                at,
                &[found],
            );
        }
    }
    change("biases beyond the profile's bits", clash, "PROF", 10, &[8]);
    change("a reserved bit of the profile", reserved, "PROF", 18, &[1]);
    // One cell of one latent of 3 bits: five bits of the byte are filling.
    let codes = container.body("GRD0")[0];
    change(
        "a set bit in the filling of grid 0",
        reserved,
        "GRD0",
        0,
        &[codes | 8],
    );
    layer_fields(&mut change, asset);
    let name = asset.metadata.name.len();
    change("a name that is not UTF-8", range, "META", 4, &[255]);
    change("a name of 2^24 bytes more", range, "META", 3, &[1]);
    change("no map", clash, "META", 4 + name, &[0, 0]);
    // Behind the count comes the map: length and text of its name, "all", then its channels.
    let map = 4 + name + 2;
    change("a map's name with a slash", range, "META", map + 4, b"/");
    change(
        "a map that starts at channel 1",
        clash,
        "META",
        map + 7,
        &[1],
    );
    change("a map of no channels", clash, "META", map + 9, &[0]);
    change(
        "a map of more channels than there are",
        clash,
        "META",
        map + 9,
        &[3],
    );
    change("encoding 4", range, "META", map + 11, &[4]);
    change("a bit depth of 9", range, "META", map + 12, &[9]);
}
