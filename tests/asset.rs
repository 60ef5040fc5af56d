//! Assets and programs return from their bytes and texts, and nothing else is taken for one.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use ntmu::conformance::synthetic;
use ntmu::isa::instruction::Instruction;
use ntmu::isa::layout::Layout;
use ntmu::isa::{Asset, Program, assembly};
use ntmu::model::Request;
use ntmu::model::exec::Decoder;
use proptest::prelude::*;

fn small(seed: u64) -> Asset {
    let mut spec = synthetic::Spec::small(16, 8);
    spec.activation = synthetic::SpecActivation::Leaky(3);
    synthetic::asset(&spec, seed).unwrap()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn asset_and_program_return_from_bytes_words_and_text(seed: u64) {
        let asset = synthetic::asset(&synthetic::arbitrary_spec(seed), seed).unwrap();
        prop_assert_eq!(Asset::from_bytes(&asset.to_bytes()).unwrap(), asset.clone());
        for layout in Layout::every() {
            let program = Program::compile(&asset, layout);
            let words: Vec<u64> = program.instructions().iter().map(Instruction::encode).collect();
            let decoded: Vec<Instruction> =
                words.iter().map(|&word| Instruction::decode(word).unwrap()).collect();
            prop_assert_eq!(&decoded, program.instructions());
            let text = assembly::print(layout, program.instructions());
            let (read_layout, read) = assembly::assemble(&text).unwrap();
            prop_assert_eq!(Program::link(&asset, read_layout, read).unwrap(), program);
        }
    }

    #[test]
    fn the_layout_changes_addresses_and_no_value(seed: u64) {
        let asset = synthetic::asset(&synthetic::arbitrary_spec(seed), seed).unwrap();
        let request = Request::new(&asset.shape, 0, 0, asset.shape.mip_count - 1).unwrap();
        let decode = |layout| {
            let program = Program::compile(&asset, layout);
            Decoder::new(&asset, &program).texel(request, &mut ())
        };
        for layout in Layout::named() {
            prop_assert_eq!(decode(layout), decode(Layout::LINEAR), "{}", layout);
        }
    }

    #[test]
    fn no_bytes_make_the_reader_panic(bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
        let mut file = ntmu::isa::format::MAGIC.to_vec();
        file.extend(bytes);
        prop_assert!(Asset::from_bytes(&file).is_err());
    }
}

#[test]
fn every_truncation_is_refused() {
    let bytes = small(1).to_bytes();
    for length in 0..bytes.len() {
        assert!(
            Asset::from_bytes(&bytes[..length]).is_err(),
            "{length} bytes"
        );
    }
    let longer = [bytes.as_slice(), &[0]].concat();
    assert!(Asset::from_bytes(&longer).is_err());
}

#[test]
fn every_flipped_bit_is_refused() {
    let mut bytes = small(2).to_bytes();
    for bit in 0..8 * bytes.len() {
        bytes[bit / 8] ^= 1 << (bit % 8);
        assert!(Asset::from_bytes(&bytes).is_err(), "bit {bit}");
        bytes[bit / 8] ^= 1 << (bit % 8);
    }
    assert!(Asset::from_bytes(&bytes).is_ok());
}

#[test]
fn a_program_that_does_not_fit_is_refused_at_its_place() {
    let asset = small(3);
    let good = Program::compile(&asset, Layout::LINEAR)
        .instructions()
        .to_vec();
    let refused_at = |instructions: Vec<Instruction>| {
        Program::link(&asset, Layout::LINEAR, instructions)
            .unwrap_err()
            .at
    };
    let request = Request::new(&asset.shape, 0, 0, 0).unwrap();
    for missing in 0..good.len() {
        let mut instructions = good.clone();
        let removed = instructions.remove(missing);
        // Without an activation, or with a register's older values, a program computes something
        // else, and safely; without anything else it would read what nobody wrote.
        let may_lack = matches!(
            removed,
            Instruction::Leaky { .. }
                | Instruction::Rescale { .. }
                | Instruction::RescaleSkip { .. }
        );
        match Program::link(&asset, Layout::LINEAR, instructions) {
            Ok(program) => {
                assert!(may_lack, "{removed:?}");
                let codes = Decoder::new(&asset, &program).texel(request, &mut ());
                assert_eq!(codes.len(), asset.shape.outputs.len());
            }
            // What is missed at the end is noticed at the instruction before it.
            Err(error) => assert!(error.at + 1 >= missing, "{removed:?}: {error}"),
        }
    }
    assert_eq!(
        refused_at(good[1..].to_vec()),
        0,
        "a fetch without a position"
    );
    let mut early_end = good.clone();
    early_end.insert(2, Instruction::End {});
    assert_eq!(refused_at(early_end), 2);
    let mut wide = good.clone();
    wide[0] = Instruction::Position { grid: 2 };
    assert_eq!(refused_at(wide), 0);
}

#[test]
fn texel_block_and_image_are_the_same_codes() {
    let asset = synthetic::asset(&synthetic::Spec::small(13, 6), 4).unwrap();
    let program = Program::compile(&asset, Layout::TILED);
    let decoder = Decoder::new(&asset, &program);
    for mip in 0..asset.shape.mip_count {
        let image = decoder.mip(mip);
        let (width, height) = asset.shape.mip_size(mip);
        for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
            let block = decoder.block(x / 4, y / 4, mip).unwrap();
            let texel = decoder.texel(Request::new(&asset.shape, x, y, mip).unwrap(), &mut ());
            for (channel, &code) in texel.iter().enumerate() {
                assert_eq!(code, image[[channel, y as usize, x as usize]]);
                assert_eq!(code, block[[channel, y as usize % 4, x as usize % 4]]);
            }
        }
        assert!(decoder.block(width.div_ceil(4), 0, mip).is_err());
    }
    assert!(decoder.block(u32::MAX, 0, 0).is_err());
}
