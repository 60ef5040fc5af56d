//! Assets and programs return from their bytes and texts, and nothing else is taken for one.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use ntmu::conformance::suite::container::Container;
use ntmu::conformance::synthetic;
use ntmu::isa::instruction::Instruction;
use ntmu::isa::layout::Layout;
use ntmu::isa::pyramid::Pyramid;
use ntmu::isa::{Asset, Program, assembly};
use ntmu::model::Request;
use ntmu::model::exec::Decoder;
use proptest::prelude::*;

fn with_pyramid(seed: u64, pyramid: Pyramid) -> Asset {
    let mut spec = synthetic::Spec::small(16, 8);
    spec.shape.pyramid = pyramid;
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

    /// A file whose CRC-32 are right may hold anything.
    #[test]
    fn a_sealed_file_with_any_shape_is_an_asset_that_decodes_or_an_error(
        changes in proptest::collection::vec((0_usize..32, any::<u8>()), 1..4),
        minor in 0_u16..3,
        code: u8,
    ) {
        let pyramid = Pyramid::from_code(code).unwrap_or(Pyramid::SINGLE);
        let file = with_pyramid(3, pyramid).to_bytes();
        let mut container = Container::parse(&file).unwrap();
        container.version.1 = minor;
        for (at, byte) in changes {
            container = container.with("SHAP", at, &[byte]);
        }
        if let Ok(asset) = Asset::from_bytes(&container.to_bytes()) {
            prop_assert_eq!(Asset::from_bytes(&asset.to_bytes()).unwrap(), asset.clone());
            let program = Program::compile(&asset, Layout::TILED);
            let decoder = Decoder::new(&asset, &program);
            for mip in 0..asset.shape.mip_count {
                let request = Request::new(&asset.shape, 0, 0, mip).unwrap();
                prop_assert_eq!(decoder.texel(request, &mut ()).len(), asset.shape.outputs.len());
            }
        }
    }
}

#[test]
fn a_file_has_the_smallest_version_that_holds_it_and_an_older_one_has_no_pyramid() {
    for code in 0..=255 {
        let Some(pyramid) = Pyramid::from_code(code) else {
            continue;
        };
        let asset = with_pyramid(1, pyramid);
        let minor = u16::from(pyramid != Pyramid::SINGLE);
        let mut container = Container::parse(&asset.to_bytes()).unwrap();
        assert_eq!(container.version, (2, minor));
        container.version.1 = 1;
        assert_eq!(Asset::from_bytes(&container.to_bytes()), Ok(asset.clone()));
        container.version.1 = 0;
        let older = Asset::from_bytes(&container.to_bytes());
        if pyramid == Pyramid::SINGLE {
            assert_eq!(older, Ok(asset));
        } else {
            let error = older.unwrap_err().to_string();
            let expected = [
                "shape.pyramid".to_owned(),
                format!("{code}"),
                "0 in a file of version 2.0".to_owned(),
            ];
            assert!(expected.iter().all(|part| error.contains(part)), "{error}");
        }
    }
}

#[test]
fn every_code_that_is_no_pyramid_is_refused_with_what_is_one() {
    let file = with_pyramid(1, Pyramid::EVERY_MIP).to_bytes();
    let container = Container::parse(&file).unwrap();
    for code in (0..=255).filter(|&code| Pyramid::from_code(code).is_none()) {
        let file = container.with("SHAP", 15, &[code]).to_bytes();
        let error = Asset::from_bytes(&file).unwrap_err().to_string();
        assert!(error.contains("shape.pyramid") && error.contains(&code.to_string()));
        assert!(error.contains("1 ≤ each ≤ first"), "{error}");
    }
}

#[test]
fn every_truncation_is_refused() {
    let bytes = with_pyramid(1, Pyramid::EVERY_MIP).to_bytes();
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
    for pyramid in [Pyramid::SINGLE, Pyramid::EVERY_MIP] {
        assert_every_flip_refused(with_pyramid(2, pyramid).to_bytes());
    }
}

fn assert_every_flip_refused(mut bytes: Vec<u8>) {
    for bit in 0..8 * bytes.len() {
        bytes[bit / 8] ^= 1 << (bit % 8);
        assert!(Asset::from_bytes(&bytes).is_err(), "bit {bit}");
        bytes[bit / 8] ^= 1 << (bit % 8);
    }
    assert!(Asset::from_bytes(&bytes).is_ok());
}

#[test]
fn a_program_that_does_not_fit_is_refused_at_its_place() {
    let asset = with_pyramid(3, Pyramid::SINGLE);
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
