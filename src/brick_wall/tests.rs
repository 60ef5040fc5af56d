//! What the generated set promises.

use std::collections::BTreeSet;

use super::*;

/// FNV-1a of all codes of mip 0.
fn fingerprint(set: &TextureSet) -> u64 {
    set.texels[0]
        .iter()
        .fold(0xcbf2_9ce4_8422_2325, |hash, &value| {
            (hash ^ u64::from((value * 255.0).round() as u8)).wrapping_mul(0x0000_0100_0000_01b3)
        })
}

#[test]
fn the_codes_are_the_same_everywhere() {
    assert_eq!(fingerprint(&generate(64, 1)), 0x556a_592b_9bd7_b221);
    assert_eq!(fingerprint(&generate(256, 7)), 0xfe29_55a4_b27c_a29e);
}

#[test]
fn maps_cover_nine_channels() {
    let set = generate(16, 0);
    assert_eq!(set.channel_count(), CHANNELS);
    assert_eq!(set.maps.last().map(Map::channels), Some(8..9));
    assert_eq!(set.texels[0].dim(), (9, 16, 16));
    assert_eq!(set.texels.len(), 3);
}

#[test]
fn every_value_is_an_eight_bit_code_and_every_channel_is_used() {
    let set = generate(128, 3);
    for channel in set.texels[0].outer_iter() {
        for &value in channel {
            assert_eq!(value, (value * 255.0).round() / 255.0);
        }
        let codes: BTreeSet<u8> = channel.iter().map(|&v| (v * 255.0).round() as u8).collect();
        assert!(
            codes.len() >= 32,
            "a channel of {} codes is not hard",
            codes.len()
        );
    }
}

/// The wall is a function of the plane that knows no borders; a tile is a window onto it. So the
/// tile repeats without a seam if the function does: what lies past a border is what lies at the
/// opposite side. (Normals and occlusion repeat because they are computed around the border; see
/// `shading`.)
#[test]
fn the_wall_continues_past_the_border_as_it_began() {
    // Lattice coordinates of u and u ± 1 differ by whole periods exactly; only the hand-laid
    // offsets are added with another rounding, at most 2^-51. No gradient reaches 2^20.
    const BOUND: f64 = 1.0 / (1_u64 << 31) as f64;
    let size = 64;
    let seed = noise::hash(5, 0, 0);
    let centre = |texel: i32| (f64::from(texel) + 0.5) / f64::from(size);
    for row in 0..size as i32 {
        for column in 0..size as i32 {
            let (u, v) = (centre(column), centre(row));
            let here = surface::at(seed, u, v, size);
            for (du, dv) in [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)] {
                let there = surface::at(seed, u + du, v + dv, size);
                assert!((here.height - there.height).abs() < BOUND, "{row} {column}");
                assert!(
                    (here.roughness - there.roughness).abs() < BOUND,
                    "{row} {column}"
                );
                for (a, b) in here.color.into_iter().zip(there.color) {
                    assert!((a - b).abs() < 255.0 * BOUND, "{row} {column}");
                }
            }
        }
    }
}

#[test]
fn seeds_show_different_walls() {
    assert_ne!(fingerprint(&generate(32, 0)), fingerprint(&generate(32, 1)));
}

#[test]
#[should_panic(expected = "size: found 48")]
fn other_sizes_are_refused() {
    let _ = generate(48, 0);
}
