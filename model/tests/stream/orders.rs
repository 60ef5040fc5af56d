//! Pixels: their order, tiles, quads and materials.

use super::*;

#[test]
fn tiles_in_order_are_the_whole_stream_and_tiles_beyond_it_are_empty() {
    let materials = [
        trilinear(64, 32),
        sampled(
            50,
            70,
            Sampler {
                max_anisotropy: 4,
                ..Sampler::default()
            },
        ),
    ];
    let mut streams = Vec::new();
    for text in ["raster", "blocks:mip=1", "zorder", "random:count=1000"] {
        streams.push((
            text.to_owned(),
            Stream::texels(&texel_spec(text), &materials),
        ));
    }
    for (scene, order) in SCENES
        .iter()
        .flat_map(|s| ["raster", "tiles:8", "tiles:10", "zorder"].map(|o| (s, o)))
    {
        let text = format!("{scene},order={order}");
        let interleave = Interleave::Random { side: 6, seed: 3 };
        let stream = Stream::scene(&scene_spec(&text), [75, 43], &materials, interleave);
        streams.push((text, stream));
    }
    for (text, stream) in streams {
        let stream = stream.unwrap();
        let whole = all(stream.demands());
        let parts: Vec<Demand> = (0..stream.tiles())
            .flat_map(|t| all(stream.tile(t)))
            .collect();
        assert_eq!(parts, whole, "{text}");
        assert!(!whole.is_empty(), "{text}");
        let half = stream.tiles() / 2;
        let halves = [0..half, half..stream.tiles()].map(|tiles| all(stream.part(tiles)));
        assert_eq!(halves.concat(), whole, "{text}");
        assert_eq!(all(stream.tile(stream.tiles())), []);
        assert_eq!(all(stream.tile(u64::MAX)), []);
    }
}

#[test]
fn every_order_of_pixels_asks_the_same_samples() {
    let materials = [trilinear(64, 64), trilinear(32, 16)];
    let of = |order: &str, scene: &str| {
        let text = format!("{scene},order={order}");
        let mut found = samples(&text, [61, 37], &materials, Interleave::QUADS);
        found.sort_by_key(|s| (s.pixel[1], s.pixel[0]));
        found
    };
    for scene in SCENES {
        let raster = of("raster", scene);
        let distinct: BTreeSet<[u32; 2]> = raster.iter().map(|s| s.pixel).collect();
        assert_eq!(distinct.len(), raster.len());
        for order in ["tiles:8", "tiles:16", "tiles:22", "zorder"] {
            assert_eq!(of(order, scene), raster, "{scene} {order}");
        }
    }
}

#[test]
fn four_successive_pixels_are_a_quad_of_one_material() {
    let materials = [trilinear(64, 64), trilinear(32, 16), trilinear(8, 8)];
    for interleave in ["quads", "tiles:6", "random:2:1"] {
        for order in ["raster", "tiles:8", "tiles:16", "zorder"] {
            let text = format!("quad:order={order}");
            let found = samples(&text, [62, 38], &materials, interleave.parse().unwrap());
            for quad in found.chunks(4) {
                let [x, y] = quad[0].pixel;
                let pixels: Vec<[u32; 2]> = quad.iter().map(|s| s.pixel).collect();
                assert_eq!(pixels, [[x, y], [x + 1, y], [x, y + 1], [x + 1, y + 1]]);
                assert_eq!((x % 2, y % 2), (0, 0));
                assert!(quad.iter().all(|s| s.material == quad[0].material));
            }
        }
    }
}

#[test]
fn interleaving_gives_each_pixel_one_material_and_each_tile_one() {
    let materials: Vec<Sampled> = [8, 16, 32].map(|size| trilinear(size, size)).into();
    for (text, side) in [("quads", 2), ("tiles:8", 8), ("random:4:9", 4)] {
        let interleave: Interleave = text.parse().unwrap();
        let found = samples("quad", [96, 64], &materials, interleave);
        let of: BTreeMap<[u32; 2], u16> = found.iter().map(|s| (s.pixel, s.material)).collect();
        assert_eq!((found.len(), of.len()), (96 * 64, 96 * 64), "{text}");
        for ([x, y], material) in &of {
            assert_eq!(of[&[x / side * side, y / side * side]], *material, "{text}");
        }
        let used: BTreeSet<u16> = of.values().copied().collect();
        assert_eq!(used.len(), 3, "{text}");
        if !text.starts_with("random") {
            let neighbour = |x: u32, y: u32| of[&[x * side, y * side]];
            assert!((0..8).all(|i| neighbour(i, 0) != neighbour(i + 1, 0)));
            assert!((0..7).all(|i| neighbour(0, i) != neighbour(0, i + 1)));
        }
    }
    let random = |seed| {
        samples(
            "quad",
            [96, 64],
            &materials,
            Interleave::Random { side: 4, seed },
        )
    };
    assert_eq!(random(1), random(1));
    assert_ne!(random(1), random(2));
}

#[test]
fn each_material_is_sampled_by_its_own_shape_and_sampler() {
    let point = Sampler {
        filter: Filter::Point,
        mip_filter: MipFilter::Base,
        ..Sampler::default()
    };
    let bilinear = Sampler {
        mip_filter: MipFilter::Base,
        ..Sampler::default()
    };
    let materials = [sampled(16, 16, point), sampled(64, 32, bilinear)];
    let spec = scene_spec("quad:scale=0.75");
    let stream = Stream::scene(&spec, [64, 64], &materials, Interleave::QUADS).unwrap();
    for demand in all(stream.demands()) {
        let of = materials[usize::from(demand.material)].shape();
        let within =
            |p: &Place| p.x() < 2 * i64::from(of.width) && p.y() < 2 * i64::from(of.height);
        assert!(demand.places.iter().all(|p| p.bits() == 1 && within(p)));
        let expected = [1, 4][usize::from(demand.material)];
        // Fractions of eighths: only some samples lie on a texel's column or row.
        assert!(demand.weights <= expected && demand.places.len() <= expected as usize);
        assert!(demand.weights >= 1);
    }
}
