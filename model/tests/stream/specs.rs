//! Specs: streams as text.

use super::*;
use ntmu_model::stream::{Geometry, PixelOrder};

#[test]
fn names_alone_have_defaults_that_their_text_shows() {
    let shown = |text: &str| text.parse::<AccessSpec>().unwrap().to_string();
    assert_eq!(shown("blocks"), "blocks:mip=all");
    assert_eq!(shown("random:mip=2"), "random:mip=2,seed=0,count=65536");
    assert_eq!(shown("quad"), "quad:scale=1,order=tiles:8,detail=gradients");
    assert_eq!(
        shown("plane"),
        "plane:height=1.7,pitch=10,fov=60,size=1,order=tiles:8,detail=gradients"
    );
    assert_eq!(
        shown("sphere"),
        "sphere:distance=2,fov=60,repeat=1,order=tiles:8,detail=gradients"
    );
    assert_eq!(shown("a/trace.csv"), "a/trace.csv");
    assert_eq!(shown("plane.Parquet"), "plane.Parquet");
    for text in ["quads", "tiles:8", "random:16:7"] {
        assert_eq!(text.parse::<Interleave>().unwrap().to_string(), text);
    }
}

#[test]
fn what_is_not_known_is_refused_with_what_is_allowed() {
    let refused = |text: &str| text.parse::<AccessSpec>().unwrap_err().to_string();
    for (text, allowed) in [
        ("", "raster, blocks, zorder, random, quad, plane, sphere"),
        (
            "scan",
            "raster, blocks, zorder, random, quad, plane, sphere",
        ),
        ("trace.txt", ".csv or .parquet"),
        ("raster:seed=1", "allowed, each once: mip"),
        ("raster:", "allowed, each once: mip"),
        ("random:seed", "mip, seed, count"),
        ("random:seed=1,seed=2", "allowed, each once"),
        ("random:count=0", "1..=2^64"),
        ("raster:mip=x", "all, or 0..=255"),
        ("plane:fov=180", "1 to 170"),
        ("plane:pitch=nan", "-90 to 90"),
        ("plane:height=high", "a number"),
        ("sphere:distance=0.5", "1.001 to 1000000"),
        ("quad:order=tiles:7", "even N of 2..=1024"),
        ("quad:detail=mip", "lod, gradients"),
    ] {
        assert!(refused(text).contains(allowed), "{text}: {}", refused(text));
    }
    for text in ["tiles", "tiles:3", "tiles:8192", "random:8", "quads:2"] {
        let found = text.parse::<Interleave>().unwrap_err().to_string();
        assert!(found.contains("quads, tiles:N, random:N:SEED"), "{found}");
    }
}

#[test]
fn streams_that_cannot_be_are_refused() {
    let materials = [trilinear(8, 8)];
    let refused = |text, screen, materials: &[Sampled], interleave| {
        Stream::scene(&scene_spec(text), screen, materials, interleave)
            .unwrap_err()
            .to_string()
    };
    let quads = Interleave::QUADS;
    assert!(refused("quad", [0, 8], &materials, quads).contains("1..=16384"));
    assert!(refused("quad", [8, 16_385], &materials, quads).contains("8x16385"));
    assert!(refused("quad", [8, 8], &[], quads).contains("materials: found 0"));
    assert!(refused("quad", [8, 8], &materials, Interleave::Turns { side: 0 }).contains("even"));
    let mut spec = scene_spec("plane");
    spec.order = PixelOrder::Tiles { side: 5 };
    let found = Stream::scene(&spec, [8, 8], &materials, quads).unwrap_err();
    assert_eq!(
        found.to_string(),
        "order: found tiles of 5; allowed: even, 2..=1024 pixels"
    );
    let mut spec = scene_spec("quad");
    spec.geometry = Geometry::Quad { scale: -1.0 };
    let found = Stream::scene(&spec, [8, 8], &materials, quads).unwrap_err();
    assert!(
        found
            .to_string()
            .contains("scale: found -1; allowed: 0.000001 to 1000000")
    );
    let mip = Stream::texels(&texel_spec("raster:mip=4"), &materials).unwrap_err();
    assert_eq!(
        mip.to_string(),
        "mip: found 4; allowed: 0..=3, the mips of material 0"
    );
}
