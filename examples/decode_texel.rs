//! Decodes one texel of an asset: `cargo run --example decode_texel [FILE.ntx X Y MIP]`, the
//! built-in asset without arguments.
#![allow(clippy::print_stdout, reason = "an example shows its result")]

use ntmu::isa::layout::Layout;
use ntmu::isa::{Asset, Program};
use ntmu::model::Request;
use ntmu::model::exec::Decoder;
use std::error::Error;

pub(crate) fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.as_slice() {
        [file, x, y, mip] => {
            // Reading is where bytes are checked; whatever comes out of it can be decoded.
            let asset = Asset::from_bytes(&std::fs::read(file)?)?;
            show(&asset, (x.parse()?, y.parse()?, mip.parse()?))
        }
        _ => show(&ntmu::built_in::asset()?, (10, 20, 0)),
    }
}

fn show(asset: &Asset, (x, y, mip): (u32, u32, u8)) -> Result<(), Box<dyn Error>> {
    let program = Program::compile(asset, Layout::LINEAR);
    let decoder = Decoder::new(asset, &program);
    let codes = decoder.texel(Request::new(&asset.shape, x, y, mip)?, &mut ());
    for map in &asset.metadata.maps {
        let first = usize::from(map.first_channel);
        let channels = &codes[first..first + usize::from(map.channel_count)];
        println!("{:12} {channels:?}", map.name);
    }
    Ok(())
}
