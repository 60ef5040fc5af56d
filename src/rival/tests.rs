#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use super::astc::{self, AstcQuality, BLOCK_BITS, Block};
use super::astcenc::{Astcenc, VARIABLE};
use super::packing::{PackKind, Packing, Scalars};
use super::{Coded, RivalError, bc, normal};
use crate::brick_wall;
use crate::texture_set::{Encoding, Map, TextureSet, mip_chain};
use ndarray::{Array3, Axis};
use std::ffi::OsStr;

/// A set of maps given as name, channels, encoding and bits, with the values of mip 0.
fn set(
    maps: &[(&str, usize, Encoding, u8)],
    (height, width): (usize, usize),
    value: impl Fn(usize, usize, usize) -> f32,
) -> TextureSet {
    let mut first_channel = 0;
    let maps = maps
        .iter()
        .map(|&(name, channel_count, encoding, bit_depth)| {
            let map = Map {
                name: name.to_owned(),
                file: String::new(),
                first_channel,
                channel_count,
                bit_depth,
                encoding,
            };
            first_channel += channel_count;
            map
        })
        .collect();
    let mip0 = Array3::from_shape_fn((first_channel, height, width), |(c, y, x)| value(c, y, x));
    TextureSet {
        name: "test".to_owned(),
        width: width as u32,
        height: height as u32,
        maps,
        texels: mip_chain(mip0),
        skipped: Vec::new(),
    }
}

/// The nine channels of a usual scan; its normals are unit vectors in 8 bits.
fn scan(size: (usize, usize)) -> TextureSet {
    let maps = [
        ("color", 3, Encoding::Srgb, 8),
        ("normal", 3, Encoding::NormalGl, 8),
        ("roughness", 1, Encoding::Linear, 8),
        ("height", 1, Encoding::Linear, 8),
        ("occlusion", 1, Encoding::Linear, 8),
    ];
    set(&maps, size, |channel, y, x| {
        let wave = |a: usize, b: usize| ((a * y + b * x) as f64 / 40.0).sin();
        let (nx, ny) = (0.1 * wave(1, 2), 0.1 * wave(2, 1));
        let value = match channel {
            3 => nx,
            4 => ny,
            5 => (1.0 - nx * nx - ny * ny).sqrt(),
            _ => wave(channel, channel + 1),
        };
        (255.0 * (value + 1.0) / 2.0).round() as f32 / 255.0
    })
}

fn channels(packing: &Packing) -> Vec<Vec<usize>> {
    packing.packs.iter().map(|p| p.channels.clone()).collect()
}

#[test]
fn a_scan_is_packed_as_colour_and_two_of_the_normal_and_the_scalars() {
    let set = scan((16, 16));
    let packing = Packing::of(&set, Scalars::Together);
    assert_eq!(
        channels(&packing),
        [vec![0, 1, 2], vec![3, 4], vec![6, 7, 8]]
    );
    assert_eq!(packing.packs[1].kind, PackKind::Normal);
    assert_eq!(packing.thirds, [[5, 3, 4]]);
    assert_eq!(packing.packs[2].name, "roughness+height+occlusion");
    let is_srgb = packing.packs.iter().map(|pack| pack.is_srgb);
    assert_eq!(is_srgb.collect::<Vec<_>>(), [true, false, false]);
    let alone = Packing::of(&set, Scalars::Alone);
    assert_eq!(
        channels(&alone),
        [vec![0, 1, 2], vec![3, 4], vec![6], vec![7], vec![8]]
    );
}

#[test]
fn vectors_that_are_not_of_length_one_keep_their_third_channel() {
    let mut set = scan((16, 16));
    for mip in &mut set.texels {
        mip.index_axis_mut(Axis(0), 5).mapv_inplace(|z| 0.9 * z);
    }
    assert!(!normal::third_follows(&set, &set.maps[1]));
    let packing = Packing::of(&set, Scalars::Together);
    assert_eq!(
        channels(&packing),
        [vec![0, 1, 2], vec![3, 4, 5], vec![6, 7, 8]]
    );
    assert_eq!(packing.packs[1].kind, PackKind::Codes);
}

#[test]
fn opacity_is_the_alpha_of_colour_and_constants_are_not_stored() {
    let maps = [
        ("color", 3, Encoding::Srgb, 8),
        ("metallic", 1, Encoding::Linear, 8),
        ("opacity", 1, Encoding::Linear, 8),
        ("height", 1, Encoding::Linear, 16),
    ];
    let set = set(&maps, (8, 8), |channel, y, x| match channel {
        3 => 0.0,
        _ => (channel + y + x) as f32 / 255.0,
    });
    let packing = Packing::of(&set, Scalars::Together);
    assert_eq!(channels(&packing), [vec![0, 1, 2, 4], vec![5]]);
    assert_eq!(packing.constants, [(3, 0.0)]);
    assert_eq!(
        packing.words(),
        [
            "color+opacity as RGBA, sRGB",
            "height as one channel, linear, more than 8 bits",
            "channel 3 not stored: 0 throughout"
        ]
    );
}

#[test]
fn scalars_fill_as_few_images_as_can_be_evenly() {
    for (count, expected) in [
        (1, vec![1]),
        (2, vec![2]),
        (3, vec![3]),
        (4, vec![4]),
        (5, vec![3, 2]),
        (6, vec![3, 3]),
        (7, vec![4, 3]),
        (9, vec![3, 3, 3]),
        (16, vec![4, 4, 4, 4]),
    ] {
        let names: Vec<String> = (0..count).map(|i| format!("m{i}")).collect();
        let maps: Vec<_> = names
            .iter()
            .map(|name| (name.as_str(), 1, Encoding::Linear, 8))
            .collect();
        let set = set(&maps, (4, 4), |c, y, x| (c + y + x) as f32 / 255.0);
        let packing = Packing::of(&set, Scalars::Together);
        let sizes: Vec<usize> = packing.packs.iter().map(|p| p.channels.len()).collect();
        assert_eq!(sizes, expected);
        let all: Vec<usize> = channels(&packing).concat();
        assert_eq!(all, (0..count).collect::<Vec<_>>());
    }
}

#[test]
fn assembling_undoes_packing() {
    let mut deep = scan((9, 14));
    deep.maps[3].bit_depth = 16;
    let set = scan((9, 14));
    for set in [set, deep] {
        for scalars in [Scalars::Together, Scalars::Alone] {
            let packing = Packing::of(&set, scalars);
            let mip0 = &set.texels[0];
            let images: Vec<_> = packing.packs.iter().map(|p| p.image(mip0.view())).collect();
            let mip = packing.assemble(&images, (9, 14));
            for channel in (0..9).filter(|&channel| channel != 5) {
                assert_eq!(
                    mip.index_axis(Axis(0), channel),
                    mip0.index_axis(Axis(0), channel)
                );
            }
            // X and Y have lost half a code each; here that moves Z by less than a code.
            for (found, stored) in mip
                .index_axis(Axis(0), 5)
                .iter()
                .zip(mip0.index_axis(Axis(0), 5))
            {
                let codes = [found, stored].map(|value| (value * 255.0).round());
                assert!((codes[0] - codes[1]).abs() <= 1.0, "{codes:?}");
            }
        }
    }
}

#[test]
fn rates_count_whole_blocks_of_every_mip_over_the_texels_of_mip_0() {
    let block: Block = "8x8".parse().unwrap();
    assert_eq!(block.image_bits(64, 64), 64 * BLOCK_BITS);
    assert_eq!(block.image_bits(65, 1), 9 * BLOCK_BITS);
    let twelve: Block = "12x12".parse().unwrap();
    assert_eq!(twelve.image_bits(1024, 1024), 86 * 86 * BLOCK_BITS);
    // Three packs, nine channels, mips of 64, 32, 16, 8 and 4 texels.
    let blocks = 3 * (64 + 16 + 4 + 1 + 1);
    let coded = Coded {
        mips: vec![Array3::zeros((9, 64, 64))],
        bits: [64, 16, 4, 1, 1].map(|n| 3 * n * BLOCK_BITS).to_vec(),
        packs: Vec::new(),
        encoder: String::new(),
        encode_seconds: 0.0,
        decode_seconds: 0.0,
    };
    assert_eq!(
        coded.bppc(),
        f64::from(blocks * 128) / f64::from(64 * 64 * 9)
    );
    // 2 bits a texel and image, three images for nine channels.
    assert_eq!(coded.bppc_mip0(), 2.0 * 3.0 / 9.0);
}

#[test]
fn block_sizes_and_qualities_are_astcs_own() {
    for block in Block::ALL {
        assert_eq!(block.to_string().parse::<Block>().unwrap(), block);
    }
    for bad in ["", "8", "7x7", "8X8", "3x3x3", "8x8 "] {
        bad.parse::<Block>().unwrap_err();
    }
    let exhaustive: AstcQuality = "exhaustive".parse().unwrap();
    assert_eq!(exhaustive, AstcQuality::EXHAUSTIVE);
    for number in 0..=100 {
        let quality: AstcQuality = number.to_string().parse().unwrap();
        assert_eq!(quality.to_string().parse::<AstcQuality>().unwrap(), quality);
    }
    for bad in ["", "101", "-1", "best", "-exhaustive"] {
        bad.parse::<AstcQuality>().unwrap_err();
    }
}

#[test]
fn a_missing_astcenc_is_an_error_that_says_how_to_get_it() {
    let error = Astcenc::find_in(None, OsStr::new("/nowhere")).unwrap_err();
    let text = error.to_string();
    assert!(text.contains("apt-get install astcenc"), "{text}");
    assert!(text.contains(VARIABLE), "{text}");
    let named = OsStr::new("/nowhere/astcenc");
    let error = Astcenc::find_in(Some(named), OsStr::new("")).unwrap_err();
    assert!(matches!(error, RivalError::NoAstcenc { .. }));
    assert!(error.to_string().contains("/nowhere/astcenc"), "{error}");
}

/// A set whose every 12 × 12 texels, aligned, have one value, so that no block of any size sees two:
/// what is wrong after coding is wrong in the plumbing.
fn flat_blocks(depth: u8) -> TextureSet {
    let maps = [
        ("color", 3, Encoding::Srgb, depth),
        ("opacity", 1, Encoding::Linear, 8),
        ("normal", 3, Encoding::NormalGl, depth),
        ("roughness", 1, Encoding::Linear, 8),
        ("height", 1, Encoding::Linear, depth),
    ];
    let codes = [200, 40, 90, 130, 128, 128, 255, 17, 77];
    set(&maps, (24, 36), |channel, y, x| {
        let code = codes[channel];
        let step = if (4..7).contains(&channel) { 0 } else { 1 };
        (code + step * (y / 12 + 5 * (x / 12))) as f32 / 255.0
    })
}

#[test]
fn constant_blocks_survive_bc_within_its_own_rounding() {
    let set = flat_blocks(8);
    for scalars in [Scalars::Together, Scalars::Alone] {
        let coded = bc::code(&set, scalars, &mut |_, _| ());
        assert_eq!(coded.mips.len(), set.texels.len());
        for (found, expected) in coded.mips[0].iter().zip(&set.texels[0]) {
            assert_eq!(found, expected);
        }
    }
}

#[test]
fn bc_counts_the_bits_of_its_formats() {
    let set = scan((32, 32));
    let bits = |scalars| bc::code(&set, scalars, &mut |_, _| ()).bits;
    // Mips of 32, 16, 8 and 4 texels: 64, 16, 4 and 1 blocks of BC7, BC5 and three BC4, or of BC7,
    // BC5 and BC7.
    assert_eq!(
        bits(Scalars::Alone),
        [64, 16, 4, 1].map(|blocks| blocks * (128 + 128 + 3 * 64))
    );
    assert_eq!(
        bits(Scalars::Together),
        [64, 16, 4, 1].map(|blocks| blocks * 3 * 128)
    );
}

#[test]
fn bc_of_a_real_picture_is_close_and_alike_twice() {
    let set = brick_wall::generate(64, 1);
    let maps = crate::quality::maps_of_set(&set);
    let coded = bc::code(&set, Scalars::Alone, &mut |_, _| ());
    let quality = crate::quality::Quality::measure(&set.texels, &coded.mips, &maps).unwrap();
    // A swapped channel or a shifted block gives less than 20 dB.
    assert!(quality.overall.psnr > 30.0, "{:?}", quality.overall);
    let again = bc::code(&set, Scalars::Alone, &mut |_, _| ());
    assert_eq!(coded.mips, again.mips);
}

/// The program, where this machine has it.
fn astcenc() -> Option<Astcenc> {
    match Astcenc::find() {
        Ok(astcenc) => Some(astcenc),
        Err(error) => {
            use std::io::Write as _;
            let required = std::env::var_os("NTMU_REQUIRE_ALL").is_some_and(|value| value == "1");
            assert!(!required, "NTMU_REQUIRE_ALL is 1: {error}");
            writeln!(std::io::stderr(), "SKIPPED: {error}").unwrap();
            None
        }
    }
}

#[test]
fn constant_blocks_survive_astc_exactly() {
    let Some(astcenc) = astcenc() else { return };
    for depth in [8, 16] {
        let set = flat_blocks(depth);
        let mut heard = Vec::new();
        let mut after = |done, total| heard.push((done, total));
        let quality = "fastest".parse().unwrap();
        let coded = astc::code(&set, Block::ALL[13], quality, &astcenc, &mut after).unwrap();
        assert_eq!(heard.len(), heard[0].1);
        for ((index, found), &expected) in coded.mips[0].indexed_iter().zip(&set.texels[0]) {
            let map = set
                .maps
                .iter()
                .find(|m| m.channels().contains(&index.0))
                .unwrap();
            if map.bit_depth == 8 {
                assert_eq!(*found, expected, "{index:?}");
            } else {
                // Rounded to binary16 on the way in and on the way out, whose steps are 2^-10 of
                // a value at most.
                let most = expected * 2.0_f32.powi(-9);
                assert!(
                    (found - expected).abs() <= most,
                    "{index:?}: {found} {expected}"
                );
            }
        }
    }
}

#[test]
fn astc_of_a_real_picture_is_close_and_costs_what_it_says() {
    let Some(astcenc) = astcenc() else { return };
    let set = brick_wall::generate(64, 1);
    let maps = crate::quality::maps_of_set(&set);
    let block: Block = "6x6".parse().unwrap();
    let quality = "fast".parse().unwrap();
    let coded = astc::code(&set, block, quality, &astcenc, &mut |_, _| ()).unwrap();
    let measured = crate::quality::Quality::measure(&set.texels, &coded.mips, &maps).unwrap();
    // A swapped channel or a shifted block gives less than 20 dB.
    assert!(measured.overall.psnr > 25.0, "{:?}", measured.overall);
    let packs = Packing::of(&set, Scalars::Together).packs.len() as u64;
    let expected: Vec<u64> = set
        .texels
        .iter()
        .map(|mip| packs * block.image_bits(mip.dim().2 as u32, mip.dim().1 as u32))
        .collect();
    assert_eq!(coded.bits, expected);
}

#[test]
fn a_failing_astcenc_says_what_was_run() {
    let Some(astcenc) = astcenc() else { return };
    let error = astcenc
        .run(&["-cl".into(), "/nowhere.png".into()])
        .unwrap_err();
    let RivalError::Astcenc { command, .. } = error else {
        panic!("{error}");
    };
    assert!(command.ends_with("-cl /nowhere.png"), "{command}");
}
