//! Streams: how fast demands are made, on one thread.
#![allow(clippy::unwrap_used, reason = "a bench fails by panicking")]

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use ntmu_isa::latent::LatentFormat;
use ntmu_isa::profile::Profile;
use ntmu_isa::sampler::{Order, Sampler};
use ntmu_isa::shape::{GridShape, OutputFormat, Sampling, Shape};
use ntmu_model::sampler::Sampled;
use ntmu_model::stream::{AccessSpec, Interleave, Stream};
use ntmu_model::{Demand, Demands};
use std::hint::black_box;

fn shape(size: u32) -> Shape {
    let grid = GridShape {
        channels: 8,
        format: LatentFormat::new(4).unwrap(),
        scale_log2: 3,
        sampling: Sampling::Interpolated,
    };
    Shape::whole_chain(size, size, [grid; 2], vec![OutputFormat::Unorm8; 9])
}

fn count(stream: &Stream<'_>) -> u64 {
    let (mut demands, mut demand, mut count) = (stream.demands(), Demand::default(), 0);
    while demands.advance(&mut demand).unwrap() {
        black_box(&demand);
        count += 1;
    }
    count
}

fn streams(criterion: &mut Criterion) {
    let with = |sampler: Sampler| {
        let sampled = Sampled::new(shape(1024), sampler, Profile::NORMATIVE);
        [sampled.unwrap()]
    };
    let anisotropic = |max_anisotropy| Sampler {
        max_anisotropy,
        ..Sampler::default()
    };
    let latents = Sampler {
        order: Order::FilterThenDecode,
        ..Sampler::default()
    };
    let cases = [
        ("raster", "raster:mip=0", Sampler::default()),
        ("blocks", "blocks:mip=0", Sampler::default()),
        ("zorder", "zorder:mip=0", Sampler::default()),
        ("random", "random:count=1000000", Sampler::default()),
        ("quad trilinear", "quad:scale=1.5", Sampler::default()),
        (
            "plane trilinear, lod",
            "plane:pitch=30,detail=lod",
            Sampler::default(),
        ),
        ("plane trilinear", "plane:pitch=30", Sampler::default()),
        ("plane latents", "plane:pitch=30", latents),
        ("plane 16 probes", "plane:pitch=30", anisotropic(16)),
        (
            "sphere trilinear",
            "sphere:distance=1.5",
            Sampler::default(),
        ),
    ];
    let mut group = criterion.benchmark_group("stream");
    group.sample_size(10);
    for (name, text, sampler) in cases {
        let materials = with(sampler);
        let stream = match text.parse().unwrap() {
            AccessSpec::Texels(spec) => Stream::texels(&spec, &materials),
            AccessSpec::Scene(spec) => {
                Stream::scene(&spec, [512, 512], &materials, Interleave::QUADS)
            }
            AccessSpec::File(path) => panic!("{} is no stream", path.display()),
        };
        let stream = stream.unwrap();
        group.throughput(Throughput::Elements(count(&stream)));
        group.bench_function(name, |bencher| bencher.iter(|| count(&stream)));
    }
    group.finish();
}

criterion_group!(benches, streams);
criterion_main!(benches);
