//! What reading a set promises, on files made here and on the published sets.

use std::fs;
use std::path::{Path, PathBuf};

use image::{DynamicImage, ImageFormat, Luma, LumaA, Rgb, Rgba};
use ndarray::{Array3, Axis};
use tempfile::{TempDir, tempdir};

use super::*;

fn grey(folder: &Path, file: &str, (width, height): (u32, u32)) {
    let image = image::GrayImage::from_fn(width, height, |x, y| Luma([(x + 3 * y) as u8]));
    image.save(folder.join(file)).unwrap();
}

fn rgb(folder: &Path, file: &str, (width, height): (u32, u32)) {
    let image = image::RgbImage::from_fn(width, height, |x, y| Rgb([x as u8, y as u8, 200]));
    image.save(folder.join(file)).unwrap();
}

fn rgba(folder: &Path, file: &str, alpha: u8) {
    let image = image::RgbaImage::from_fn(4, 4, |x, y| Rgba([x as u8, y as u8, 9, alpha]));
    image.save(folder.join(file)).unwrap();
}

fn maps(set: &TextureSet) -> Vec<(&str, usize, usize)> {
    set.maps
        .iter()
        .map(|m| (m.name.as_str(), m.first_channel, m.channel_count))
        .collect()
}

fn refusal(folder: &TempDir) -> String {
    TextureSet::read(folder.path()).unwrap_err().to_string()
}

#[test]
fn maps_are_stacked_in_canonical_order_and_other_files_are_listed() {
    let folder = tempdir().unwrap();
    for file in [
        "a_Roughness.png",
        "a_zebra.png",
        "a_Displacement.tga",
        "a_apple.tif",
    ] {
        grey(folder.path(), file, (4, 4));
    }
    rgb(folder.path(), "a_NormalGL.png", (4, 4));
    rgb(folder.path(), "a_NormalDX.png", (4, 4));
    rgb(folder.path(), "a_Color.png", (4, 4));
    fs::write(folder.path().join("license.txt"), "CC0").unwrap();
    fs::create_dir(folder.path().join("sub")).unwrap();
    grey(&folder.path().join("sub"), "a_Opacity.png", (4, 4));
    let set = TextureSet::read(folder.path()).unwrap();
    assert_eq!(
        maps(&set),
        [
            ("color", 0, 3),
            ("normal", 3, 3),
            ("roughness", 6, 1),
            ("height", 7, 1),
            ("a_apple", 8, 1),
            ("a_zebra", 9, 1)
        ]
    );
    assert_eq!(set.maps[1].encoding, Encoding::NormalGl);
    let skipped: Vec<_> = set.skipped.iter().map(|s| s.file.as_str()).collect();
    assert_eq!(skipped, ["a_NormalDX.png", "license.txt"]);
    assert_eq!(
        set.texels[0].index_axis(Axis(0), 0).row(2).to_vec(),
        [0.0, 1.0, 2.0, 3.0].map(|c| c / 255.0)
    );
    assert_eq!(set.texels[0][[6, 3, 2]], 11.0 / 255.0);
}

#[test]
fn packed_files_become_maps_that_share_the_file() {
    let folder = tempdir().unwrap();
    rgba(folder.path(), "g_alb_ht.png", 7);
    rgba(folder.path(), "g_nrm_rgh.png", 8);
    let set = TextureSet::read(folder.path()).unwrap();
    assert_eq!(
        maps(&set),
        [
            ("color", 0, 3),
            ("normal", 3, 3),
            ("roughness", 6, 1),
            ("height", 7, 1)
        ]
    );
    assert_eq!(set.texels[0][[6, 0, 0]], 8.0 / 255.0);
    assert_eq!(set.texels[0][[7, 0, 0]], 7.0 / 255.0);
    assert_eq!(set.maps[3].file, "g_alb_ht.png");

    let folder = tempdir().unwrap();
    rgb(folder.path(), "g_occlusionRoughnessMetallic.png", (4, 2));
    let set = TextureSet::read(folder.path()).unwrap();
    assert_eq!(
        maps(&set),
        [("roughness", 0, 1), ("occlusion", 1, 1), ("metallic", 2, 1)]
    );
    assert_eq!(set.texels[0][[2, 0, 0]], 200.0 / 255.0);
}

#[test]
fn alpha_is_a_map_only_when_it_says_something() {
    let folder = tempdir().unwrap();
    rgba(folder.path(), "color.png", 255);
    assert_eq!(
        maps(&TextureSet::read(folder.path()).unwrap()),
        [("color", 0, 3)]
    );
    rgba(folder.path(), "color.png", 254);
    assert_eq!(
        maps(&TextureSet::read(folder.path()).unwrap()),
        [("color", 0, 3), ("opacity", 3, 1)]
    );
    grey(folder.path(), "opacity.png", (4, 4));
    assert!(refusal(&folder).contains("map `opacity` found in both"));
}

#[test]
fn grey_stored_as_rgb_is_one_channel() {
    let folder = tempdir().unwrap();
    let mut image = image::RgbImage::from_fn(8, 8, |x, y| Rgb([(x * y) as u8; 3]));
    image.save(folder.path().join("ao.png")).unwrap();
    assert_eq!(
        maps(&TextureSet::read(folder.path()).unwrap()),
        [("occlusion", 0, 1)]
    );
    image[(7, 7)].0[2] += 1;
    image.save(folder.path().join("ao.png")).unwrap();
    assert_eq!(
        maps(&TextureSet::read(folder.path()).unwrap()),
        [("occlusion", 0, 3)]
    );
}

#[test]
fn sixteen_bit_grey_with_alpha_keeps_its_bits() {
    let folder = tempdir().unwrap();
    let image = image::ImageBuffer::<LumaA<u16>, Vec<u16>>::from_pixel(2, 2, LumaA([257, 40001]));
    let image = DynamicImage::ImageLumaA16(image);
    image
        .save_with_format(folder.path().join("height.png"), ImageFormat::Png)
        .unwrap();
    let set = TextureSet::read(folder.path()).unwrap();
    assert_eq!(maps(&set), [("height", 0, 1), ("height_alpha", 1, 1)]);
    assert_eq!(set.maps[1].bit_depth, 16);
    assert_eq!(set.texels[0][[0, 0, 0]], 257.0 / 65535.0);
    assert_eq!(set.texels[0][[1, 1, 1]], 40001.0 / 65535.0);
}

#[test]
fn any_size_has_its_chain() {
    for size in [(1, 1), (1, 64), (37, 5), (12, 100)] {
        let folder = tempdir().unwrap();
        rgb(folder.path(), "color.png", size);
        let set = TextureSet::read(folder.path()).unwrap();
        assert_eq!((set.width, set.height), size);
        assert_eq!(set.texels.len(), usize::from(mip_count(size.0, size.1)));
    }
}

#[test]
fn a_manifest_names_swizzles_and_orders() {
    let folder = tempdir().unwrap();
    rgba(folder.path(), "scan.png", 77);
    let text = "name = 'wall'\n\
        [[map]]\nname = 'mask'\nfile = 'scan.png'\nchannels = 'a'\n\
        [[map]]\nname = 'normal'\nfile = 'scan.png'\nchannels = 'gr'\nencoding = 'normal-dx'\n";
    fs::write(folder.path().join("texture_set.toml"), text).unwrap();
    for path in [
        folder.path().to_owned(),
        folder.path().join("texture_set.toml"),
    ] {
        let set = TextureSet::read(&path).unwrap();
        assert_eq!(set.name, "wall");
        assert_eq!(maps(&set), [("mask", 0, 1), ("normal", 1, 2)]);
        assert_eq!(set.maps[1].encoding, Encoding::NormalDx);
        assert_eq!(
            set.texels[0].index_axis(Axis(1), 1).column(2).to_vec(),
            [77.0, 1.0, 2.0].map(|c| c / 255.0)
        );
    }
}

#[test]
fn float_files_are_linear_and_must_lie_in_the_unit_interval() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("x_diff_2k.exr");
    let values = Array3::from_shape_fn((3, 4, 4), |(c, y, x)| (c + y + x) as f32 / 16.0);
    write_map(&path, &values.view(), Depth::Float).unwrap();
    let set = TextureSet::read(folder.path()).unwrap();
    assert_eq!(set.texels[0], values);
    assert_eq!(
        (set.maps[0].encoding, set.maps[0].bit_depth),
        (Encoding::Linear, 32)
    );

    let bright = image::Rgb32FImage::from_fn(4, 4, |x, _| Rgb([0.0, 0.5, x as f32]));
    fs::remove_file(path).unwrap();
    bright.save(folder.path().join("color.tiff")).unwrap();
    let message = refusal(&folder);
    assert!(
        message.ends_with("found 2 at component 2, row 0, column 2, allowed is 0 to 1"),
        "{message}"
    );
}

#[test]
fn a_set_that_is_none_is_refused_by_name() {
    let folder = tempdir().unwrap();
    assert!(refusal(&folder).contains("found no image"));
    let file = folder.path().join("notes.txt");
    fs::write(&file, "x").unwrap();
    assert!(refusal(&folder).contains("found no image"));
    assert!(
        TextureSet::read(&file)
            .unwrap_err()
            .to_string()
            .contains("found a file")
    );
    let missing = TextureSet::read(&folder.path().join("none")).unwrap_err();
    assert!(matches!(missing, TextureSetError::Io { .. }));
}

#[test]
fn sizes_that_differ_are_refused_with_both_files() {
    let folder = tempdir().unwrap();
    rgb(folder.path(), "a_Color.png", (8, 8));
    rgb(folder.path(), "preview.png", (16, 8));
    let message = refusal(&folder);
    assert!(message.contains("a_Color.png is 8 x 8 texels"), "{message}");
    assert!(message.contains("preview.png is 16 x 8"), "{message}");
}

#[test]
fn two_files_for_one_map_are_refused() {
    let folder = tempdir().unwrap();
    rgb(folder.path(), "a_albedo.png", (8, 8));
    rgb(folder.path(), "a_diffuse.png", (8, 8));
    let message = refusal(&folder);
    assert!(message.contains("map `color` found in both"), "{message}");
}

#[test]
fn seventeen_channels_are_refused_with_a_list() {
    let folder = tempdir().unwrap();
    for index in 0..5 {
        rgb(folder.path(), &format!("m{index}.png"), (4, 4));
    }
    grey(folder.path(), "m5.png", (4, 4));
    assert_eq!(TextureSet::read(folder.path()).unwrap().channel_count(), 16);
    grey(folder.path(), "m6.png", (4, 4));
    let message = refusal(&folder);
    assert!(
        message.ends_with(
            "found 17 channels (m0 3, m1 3, m2 3, m3 3, m4 3, m5 1, m6 1), allowed are 1 to 16"
        ),
        "{message}"
    );
}

/// A file cut anywhere, in any format, is an error and never a panic.
#[test]
fn truncated_files_are_refused() {
    for file in [
        "color.png",
        "color.jpg",
        "color.tga",
        "color.tif",
        "color.exr",
    ] {
        let folder = tempdir().unwrap();
        let path = folder.path().join(file);
        if file.ends_with("exr") {
            let values = Array3::from_shape_fn((3, 9, 16), |(c, y, x)| (c + y * x) as f32 / 200.0);
            write_map(&path, &values.view(), Depth::Float).unwrap();
        } else {
            rgb(folder.path(), file, (16, 9));
        }
        let bytes = fs::read(&path).unwrap();
        TextureSet::read(folder.path()).unwrap();
        // The last bytes of a PNG or a TGA are trailers without texels.
        for length in (0..bytes.len() - 40).step_by(7) {
            fs::write(&path, &bytes[..length]).unwrap();
            let error = TextureSet::read(folder.path());
            assert!(error.is_err(), "{file} cut to {length} of {}", bytes.len());
        }
    }
}

/// The IHDR of this PNG claims more texels than a set may have; its data is never looked at.
#[test]
fn a_header_that_claims_a_huge_image_is_refused_before_decoding() {
    for (width, height) in [(16385, 1), (1, 16385), (1 << 20, 1 << 20)] {
        let folder = tempdir().unwrap();
        let path = folder.path().join("color.png");
        rgb(folder.path(), "color.png", (4, 4));
        let mut bytes = fs::read(&path).unwrap();
        bytes[16..20].copy_from_slice(&u32::to_be_bytes(width));
        bytes[20..24].copy_from_slice(&u32::to_be_bytes(height));
        let checksum = crc32(&bytes[12..29]);
        bytes[29..33].copy_from_slice(&checksum.to_be_bytes());
        fs::write(&path, bytes).unwrap();
        let message = refusal(&folder);
        assert!(
            message.contains(&format!("found {width} x {height} texels")),
            "{message}"
        );
    }
}

fn crc32(bytes: &[u8]) -> u32 {
    let step = |crc: u32, _| (crc >> 1) ^ (0xedb8_8320 & (crc & 1).wrapping_neg());
    !bytes
        .iter()
        .fold(!0, |crc, &byte| (0..8).fold(crc ^ u32::from(byte), step))
}

/// The folder of published sets, or `None` after saying so.
#[expect(clippy::print_stdout, reason = "a test that was skipped says so")]
fn published() -> Option<PathBuf> {
    let folder = std::env::var_os("NTMU_TEXTURES").map(PathBuf::from);
    if folder.is_none() {
        let required = std::env::var_os("NTMU_REQUIRE_ALL").is_some_and(|value| value == "1");
        assert!(
            !required,
            "NTMU_REQUIRE_ALL is 1 and NTMU_TEXTURES is not set"
        );
        println!("SKIPPED: NTMU_TEXTURES is not set");
    }
    folder
}

#[test]
fn published_sets_have_their_channels() {
    let Some(folder) = published() else { return };
    for (name, size, expected) in [
        (
            "Wood063_1K",
            1024,
            "color 3, normal 3, roughness 1, height 1, occlusion 1",
        ),
        (
            "Terrazzo018_1K",
            1024,
            "color 3, normal 3, roughness 1, height 1",
        ),
        (
            "Bricks059_1K",
            1024,
            "color 3, normal 3, roughness 1, height 1, occlusion 1",
        ),
        (
            "RoofingTiles013A_1K",
            1024,
            "color 3, normal 3, roughness 1, height 1, occlusion 1, opacity 1",
        ),
        (
            "Ground037_1K",
            1024,
            "color 3, normal 3, roughness 1, height 1",
        ),
        (
            "WaterBottle_2K",
            2048,
            "color 3, normal 3, roughness 1, occlusion 1, metallic 1, emissive 3",
        ),
    ] {
        let set = TextureSet::read(&folder.join(name)).unwrap();
        let listed: Vec<_> = set
            .maps
            .iter()
            .map(|m| format!("{} {}", m.name, m.channel_count))
            .collect();
        assert_eq!(listed.join(", "), expected, "{name}");
        assert_eq!(
            (set.name.as_str(), set.width, set.height),
            (name, size, size)
        );
        assert_eq!(
            set.map("normal").unwrap().encoding,
            Encoding::NormalGl,
            "{name}"
        );
        assert_eq!(set.skipped, [], "{name}");
        let sixteen: Vec<_> = set
            .maps
            .iter()
            .filter(|m| m.bit_depth == 16)
            .map(|m| m.name.as_str())
            .collect();
        let expected: &[&str] = if name == "RoofingTiles013A_1K" {
            &["normal", "height"]
        } else {
            &[]
        };
        assert_eq!(sixteen, expected, "{name}");
    }
}

/// Green-up means: where the height grows down the image the surface faces up, so green is more.
/// Red falls where the height grows to the right in either convention, which shows that height
/// is not inverted.
#[test]
fn normals_of_the_published_sets_are_green_up() {
    let Some(folder) = published() else { return };
    for name in [
        "Wood063_1K",
        "Terrazzo018_1K",
        "Bricks059_1K",
        "RoofingTiles013A_1K",
        "Ground037_1K",
    ] {
        let set = TextureSet::read(&folder.join(name)).unwrap();
        let channel = |map: &str, index| {
            let first = set.map(map).unwrap().first_channel;
            set.texels[0].index_axis(Axis(0), first + index)
        };
        let (height, red, green) = (
            channel("height", 0),
            channel("normal", 0),
            channel("normal", 1),
        );
        let (mut across, mut down) = (0.0, 0.0);
        for row in 1..1023 {
            for column in 1..1023 {
                let at = [row, column];
                let dx = height[[row, column + 1]] - height[[row, column - 1]];
                let dy = height[[row + 1, column]] - height[[row - 1, column]];
                across += f64::from(dx * (red[at] - 0.5));
                down += f64::from(dy * (green[at] - 0.5));
            }
        }
        assert!(across < 0.0 && down > 0.0, "{name}: {across} {down}");
    }
}
