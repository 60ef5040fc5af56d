//! The examples do what they say.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

#[path = "../examples/decode_block.rs"]
mod decode_block;
#[path = "../examples/decode_texel.rs"]
mod decode_texel;
#[path = "../examples/write_asset.rs"]
mod write_asset;

#[test]
fn a_texel_is_decoded() {
    decode_texel::main().unwrap();
}

#[test]
fn a_block_is_decoded_with_its_taps() {
    decode_block::main().unwrap();
}

#[test]
fn an_asset_written_by_hand_shows_its_grid() {
    write_asset::main().unwrap();
    let asset = write_asset::asset().unwrap();
    let program = ntmu::isa::Program::compile(&asset, ntmu::isa::layout::Layout::LINEAR);
    let codes = ntmu::model::exec::Decoder::new(&asset, &program).mip(0);
    // Code 0 stands for black and code 15 for white; the first row of cells rises, the second
    // falls.
    assert_eq!((codes[[0, 0, 0]], codes[[0, 0, 31]]), (0, 255));
    assert_eq!((codes[[0, 15, 0]], codes[[0, 15, 31]]), (255, 0));
}
