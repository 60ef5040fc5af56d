//! Scenes: what the pixels see.

use super::*;

#[test]
fn a_screen_aligned_quad_at_one_to_one_is_a_scan_of_its_texture() {
    let materials = [trilinear(64, 32)];
    for order in ["raster", "zorder"] {
        let spec = scene_spec(&format!("quad:scale=1,order={order}"));
        let stream = Stream::scene(&spec, [64, 32], &materials, Interleave::QUADS).unwrap();
        assert_eq!(
            all(stream.demands()),
            scan(&format!("{order}:mip=0"), &materials)
        );
    }
}

#[test]
fn magnified_quads_share_texels_and_minified_ones_take_smaller_mips() {
    let materials = [trilinear(256, 256)];
    let demands = |scale: u32| {
        let spec = scene_spec(&format!("quad:scale={scale}"));
        all(
            Stream::scene(&spec, [32, 32], &materials, Interleave::QUADS)
                .unwrap()
                .demands(),
        )
    };
    for log2 in 0..=3 {
        let mips = |d: &Demand| d.places.iter().all(|p| p.mip() == log2);
        assert!(demands(1 << log2).iter().all(mips));
    }
    let spec = scene_spec("quad:scale=0.125");
    let stream = Stream::scene(&spec, [32, 32], &materials, Interleave::QUADS).unwrap();
    let distinct: BTreeSet<Place> = all(stream.demands())
        .into_iter()
        .flat_map(|d| d.places)
        .collect();
    // Four texels each way, and one more on either side for the filter: 32 pixels of 1/8 texel.
    assert_eq!(distinct.len(), 6 * 6);
}

/// The level of detail of a sample, from its f32 bits.
fn lod(sample: &Sample) -> f32 {
    match sample.request.detail {
        Detail::Lod(bits) => f32::from_bits(bits),
        Detail::Gradients { .. } | Detail::Footprint(_) => panic!("not a level"),
    }
}

#[test]
fn the_floor_ends_at_the_horizon_and_its_level_of_detail_grows_towards_it() {
    let materials = [trilinear(512, 512)];
    let found = samples(
        "plane:pitch=10,detail=lod,order=raster",
        [64, 96],
        &materials,
        Interleave::QUADS,
    );
    let at: BTreeMap<[u32; 2], f32> = found.iter().map(|s| (s.pixel, lod(s))).collect();
    let horizon = at.keys().map(|p| p[1]).min().unwrap();
    assert!((1..95).contains(&horizon), "both sky and floor are seen");
    assert_eq!(
        found.len() as u32,
        64 * (96 - horizon),
        "the horizon is level"
    );
    for (x, y) in (0..64).flat_map(|x| (horizon..95).map(move |y| (x, y))) {
        assert!(at[&[x, y]] > at[&[x, y + 1]], "pixel {x} {y}");
    }
    let sky = samples("plane:pitch=-80", [64, 96], &materials, Interleave::QUADS);
    assert_eq!(sky, []);
}

#[test]
fn a_floor_seen_flat_is_more_anisotropic_than_one_seen_from_above() {
    let sampler = Sampler {
        max_anisotropy: 16,
        ..Sampler::default()
    };
    let materials = [sampled(512, 512, sampler)];
    let probes = |pitch: u32| -> u32 {
        let text = format!("plane:pitch={pitch},fov=40");
        let found = samples(&text, [64, 64], &materials, Interleave::QUADS);
        let of = |sample: &Sample| match sample.request.detail {
            Detail::Gradients { x, y } => {
                u32::from(Footprint::of(x, y, [512, 512], 16, &PROFILE).probes)
            }
            Detail::Lod(_) | Detail::Footprint(_) => panic!("no gradients"),
        };
        found.iter().map(of).max().unwrap()
    };
    assert!(probes(30) > probes(60) && probes(60) > probes(90));
    assert_eq!(probes(90), 1, "straight down both gradients are equal");
}

#[test]
fn the_level_of_gradients_is_the_level_that_a_pixel_would_say() {
    let materials = [trilinear(512, 256)];
    for scene in SCENES {
        let of = |detail| {
            let text = format!("{scene},detail={detail}");
            samples(&text, [64, 64], &materials, Interleave::QUADS)
        };
        for (level, gradients) in of("lod").iter().zip(of("gradients")) {
            let Detail::Gradients { x, y } = gradients.request.detail else {
                panic!("no gradients");
            };
            let footprint = Footprint::of(x, y, [512, 256], 1, &PROFILE);
            let found = f64::from(footprint.lod) / 65_536.0;
            // The footprint rounds gradients to 2^−16 texels and its level down to 2^−16; a gradient
            // is longer than 2^−4 texels here, so that its level changes by at most 2^−11.
            assert!(lod(level) > -4.0 && GRADIENT_BITS == 16);
            assert!(
                (found - f64::from(lod(level))).abs() < 1.0 / 2048.0,
                "{scene}"
            );
        }
    }
}

#[test]
fn a_sphere_is_round_and_its_poles_and_edges_are_coarse() {
    let materials = [trilinear(256, 128)];
    let found = samples(
        "sphere:distance=2,detail=lod",
        [64, 64],
        &materials,
        Interleave::QUADS,
    );
    let at: BTreeMap<[u32; 2], f32> = found.iter().map(|s| (s.pixel, lod(s))).collect();
    assert!(!at.contains_key(&[0, 0]) && at.contains_key(&[32, 32]));
    for [x, y] in at.keys() {
        assert!(at.contains_key(&[63 - x, *y]) && at.contains_key(&[*x, 63 - y]));
        assert!(at.contains_key(&[*y, *x]));
    }
    let edge = at
        .keys()
        .filter(|p| p[1] == 32)
        .map(|p| p[0])
        .min()
        .unwrap();
    assert!(at[&[edge, 32]] > at[&[31, 32]]);
    let v = |sample: &Sample| f32::from_bits(sample.request.place[1]);
    let above: Vec<&Sample> = found.iter().filter(|s| s.pixel[1] < 32).collect();
    assert!(above.iter().all(|s| v(s) < 0.5 && v(s) > 0.0));
}
