//! A stream written as CSV and read is the stream.

use super::*;
use ntmu::access::write_csv;
use ntmu::isa::sampler::Order;
use ntmu::model::stream::{AccessSpec, Interleave, Stream};

fn stream<'m>(text: &str, materials: &'m [Sampled]) -> Stream<'m> {
    let interleave = Interleave::Random { side: 4, seed: 1 };
    match text.parse().unwrap() {
        AccessSpec::Texels(spec) => Stream::texels(&spec, materials).unwrap(),
        AccessSpec::Scene(spec) => Stream::scene(&spec, [50, 38], materials, interleave).unwrap(),
        AccessSpec::File(path) => panic!("{} is a file", path.display()),
    }
}

fn assert_is_read_back(text: &str, materials: &[Sampled]) {
    let (folder, stream) = (folder(), stream(text, materials));
    let path = folder.path().join("trace.csv");
    let rows = write_csv(&stream, &path).unwrap();
    let Ok(demands) = all(stream.demands());
    assert_eq!(read(&path, materials).unwrap(), demands, "{text}");
    assert_eq!(rows, demands.len() as u64, "{text}");
    let text = std::fs::read_to_string(&path).unwrap();
    assert_eq!(text.lines().count() as u64, rows + 1);
}

#[test]
fn a_texel_scan_is_read_back() {
    for text in ["raster", "blocks", "zorder:mip=2", "random:count=500"] {
        assert_is_read_back(text, &materials());
    }
}

#[test]
fn a_scene_is_read_back_with_its_samplers() {
    let latents = Sampler {
        order: Order::FilterThenDecode,
        ..Sampler::default()
    };
    let stochastic = Sampler {
        stochastic: true,
        max_anisotropy: 8,
        ..Sampler::default()
    };
    let mut materials = materials();
    materials.extend([sampled(32, 32, latents), sampled(8, 64, stochastic)]);
    for scene in ["quad:scale=1.7", "plane:pitch=20", "sphere:distance=1.5"] {
        for detail in ["lod", "gradients"] {
            assert_is_read_back(&format!("{scene},detail={detail}"), &materials);
        }
    }
}

#[test]
fn a_scene_of_sky_alone_is_a_header_and_reading_it_says_that_there_are_no_rows() {
    let (folder, materials) = (folder(), materials());
    let path = folder.path().join("sky.csv");
    assert_eq!(
        write_csv(&stream("plane:pitch=-89", &materials), &path).unwrap(),
        0
    );
    let found = read(&path, &materials).unwrap_err().to_string();
    assert!(found.contains("no rows"), "{found}");
}

#[test]
fn a_place_that_cannot_be_written_is_named() {
    let (folder, materials) = (folder(), materials());
    let path = folder.path().join("missing/trace.csv");
    let error = write_csv(&stream("raster", &materials), &path).unwrap_err();
    assert!(matches!(error, AccessError::Io { .. }));
    assert!(error.to_string().contains("trace.csv"), "{error}");
}
