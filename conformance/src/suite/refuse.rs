//! The refuse suite: bytes that are no asset, and two that are.

use super::SuiteError;
use super::container::{Container, seal};
use crate::emit::Builder;
use crate::flag::{self, Flag};
use crate::synthetic::{self, Spec, grid};
use crate::vector::{Answer, OpenQuery, Query, VectorFile};
use ntmu_isa::Asset;
use ntmu_isa::layer::Layer;

/// Every so many bytes, one bit is flipped; prime, so that all bit positions occur.
const FLIP_STEP: usize = 11;

/// The suite.
///
/// # Errors
/// Never: the spec is within the limits of an asset.
pub fn suite() -> Result<VectorFile, SuiteError> {
    let about = "files that a reader must refuse, and a few that it must accept";
    let mut builder = Builder::new("refuse", about);
    let mut spec = Spec::small(8, 8);
    spec.shape.grids = [grid(1, 3, 3), grid(1, 4, 3)];
    (spec.hidden, spec.block_span, spec.weight_bits) = (vec![2], 1, 7);
    let asset = synthetic::asset(&spec, 1).map_err(|error| SuiteError::Asset {
        name: "refuse".to_owned(),
        error,
    })?;
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
    Ok(builder.build())
}

fn accepted(builder: &mut Builder, comment: &str, ntx: Vec<u8>) {
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
    for (at, comment) in [(8, "a newer major version"), (10, "a newer minor version")] {
        let mut newer = file.to_vec();
        newer[at] += 1;
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
    change("snap 2", range, "SHAP", 10, &[2]);
    change("address mode 3", range, "SHAP", 11, &[3]);
    change("grid 0 without channels", range, "SHAP", 12, &[0, 0]);
    change("grid 0 with 65535 channels", range, "SHAP", 12, &[255, 255]);
    change("grid 0 of 0 bits", range, "SHAP", 14, &[0]);
    change("grid 0 of 9 bits", range, "SHAP", 14, &[9]);
    change("grid 0 at full resolution", range, "SHAP", 15, &[0]);
    change("grid 1 at 1/16", range, "SHAP", 19, &[4]);
    change("no channels", range, "SHAP", 20, &[0, 0]);
    change("17 channels", range, "SHAP", 20, &[17, 0]);
    change("output format 3", range, "SHAP", 22, &[3]);
    for (at, name, count) in [
        (0, "input", 4),
        (1, "leak", 4),
        (2, "requantize", 5),
        (3, "skip", 5),
        (4, "output", 5),
    ] {
        change(
            &format!("profile {name} {count}"),
            range,
            "PROF",
            at,
            &[count],
        );
    }
    change("a reserved bit of the profile", reserved, "PROF", 7, &[1]);
    // One cell of one latent of 3 bits: five bits of the byte are filling.
    let codes = container.body("GRD0")[0];
    change(
        "a set bit in the filling of grid 0",
        reserved,
        "GRD0",
        0,
        &[codes | 8],
    );
    change("no layers", range, "WGTS", 0, &[0, 0]);
    change("65 layers", range, "WGTS", 0, &[65, 0]);
    change("a layer fewer than there are", clash, "WGTS", 0, &[2, 0]);
    change("weights of one bit", range, "WGTS", 2, &[1]);
    change("weights of nine bits", range, "WGTS", 2, &[9]);
    change("a reserved bit of the weights", reserved, "WGTS", 3, &[1]);
    change(
        "an input more than there are",
        clash,
        "WGTS",
        4,
        &[asset.layers[0].inputs as u8 + 1],
    );
    change("1025 outputs", range, "WGTS", 6, &[1, 4]);
    change("a zero point of 128", range, "WGTS", 8, &[128, 0]);
    change("a zero point of -129", range, "WGTS", 8, &[127, 255]);
    change("activation 4", range, "WGTS", 10, &[4]);
    change("a leak of 2^-8", range, "WGTS", 10, &[2, 8]);
    change("a leak of 2^0", range, "WGTS", 10, &[2, 0]);
    change("a leak where nothing leaks", reserved, "WGTS", 11, &[1]);
    change(
        "a gate's scale where there is no gate",
        reserved,
        "WGTS",
        12,
        &[1],
    );
    change("a skip path into the first layer", clash, "WGTS", 17, &[1]);
    change(
        "a mantissa of 2^30 - 1",
        range,
        "WGTS",
        23,
        &[255, 255, 255, 63],
    );
    change("a negative mantissa", range, "WGTS", 26, &[128]);
    change("a shift of 1", range, "WGTS", 27, &[1]);
    change("a shift of 63", range, "WGTS", 27, &[63]);
    change("a bias of 2^30", range, "WGTS", 28, &[0, 0, 0, 64]);
    change("a bias of -2^30", range, "WGTS", 28, &[0, 0, 0, 192]);
    let second = 4 + layer_bytes(&asset.layers[0], asset.weight_bits);
    change(
        "a skip path of four layers",
        range,
        "WGTS",
        second + 13,
        &[4],
    );
    change(
        "a skip path from before the first layer",
        clash,
        "WGTS",
        second + 13,
        &[2],
    );
    let last = second + layer_bytes(&asset.layers[1], asset.weight_bits);
    change(
        "a zero point in the last layer",
        range,
        "WGTS",
        last + 4,
        &[1],
    );
    change("a ReLU in the last layer", range, "WGTS", last + 6, &[1]);
    change(
        "a skip path into the last layer",
        range,
        "WGTS",
        last + 13,
        &[1],
    );
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

/// Bytes of a layer in the section of weights.
fn layer_bytes(layer: &Layer, weight_bits: u8) -> usize {
    let weights = usize::from(layer.inputs) * usize::from(layer.outputs);
    19 + 9 * usize::from(layer.outputs) + (weights * usize::from(weight_bits)).div_ceil(8)
}
