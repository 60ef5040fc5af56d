//! Decodes a texel block (4×4) of the built-in asset and shows what its texels share: the cells they
//! fetch, and the range of every layer's sums. `cargo run --example decode_block [COLUMN ROW MIP]`
#![allow(clippy::print_stdout, reason = "an example shows its result")]

use ntmu::isa::Program;
use ntmu::isa::layout::Layout;
use ntmu::model::Request;
use ntmu::model::exec::{Decoder, Taps};
use std::collections::BTreeSet;
use std::error::Error;

pub(crate) fn main() -> Result<(), Box<dyn Error>> {
    let numbers: Result<Vec<u32>, _> = std::env::args().skip(1).map(|a| a.parse()).collect();
    let (column, row, mip) = match numbers.as_deref() {
        Ok(&[column, row, mip]) => (column, row, u8::try_from(mip)?),
        _ => (3, 5, 0),
    };
    let asset = ntmu::built_in::asset()?;
    let program = Program::compile(&asset, Layout::TILED);
    let decoder = Decoder::new(&asset, &program);

    // All codes of the block at once …
    let codes = decoder.block(column, row, mip)?;
    let (channels, height, width) = codes.dim();
    println!(
        "block ({column}, {row}) of mip {mip}: {channels} channels, {width} × {height} texels"
    );

    // … and every value on the way, texel by texel.
    let texels = (0..height as u32).flat_map(|y| (0..width as u32).map(move |x| (x, y)));
    let taps: Vec<Taps> = texels
        .map(|(x, y)| Request::new(&asset.shape, 4 * column + x, 4 * row + y, mip))
        .map(|request| request.map(|request| decoder.taps(request)))
        .collect::<Result<_, _>>()?;
    for grid in 0..2 {
        let cells: BTreeSet<_> = taps
            .iter()
            .flat_map(|t| t.grids[grid].corners.cells())
            .collect();
        println!(
            "grid {grid}: {} cells for {} texels",
            cells.len(),
            taps.len()
        );
    }
    for layer in 0..asset.layers.len() {
        let sums = || taps.iter().flat_map(|t| &t.layers[layer].accumulators);
        let (low, high) = (sums().min(), sums().max());
        println!("layer {layer}: accumulators {low:?} to {high:?}");
    }
    Ok(())
}
