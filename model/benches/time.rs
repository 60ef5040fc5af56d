//! Time: how fast a run is simulated, on one thread, and the most memory that it holds.
//!
//! The unit is `desktop`; the asset has the shape of CNTC-16 at 1024². Throughput is in pixels; the
//! unit's cycles for each pixel, and the peak, are written beside the results as
//! `target/criterion/time/facts.json`.
#![allow(clippy::unwrap_used, reason = "a bench fails by panicking")]
#![allow(
    unsafe_code,
    reason = "an allocator is unsafe to implement; this one hands everything on"
)]

#[path = "support/mod.rs"]
#[allow(
    dead_code,
    unreachable_pub,
    reason = "the engine's benchmark uses the rest"
)]
mod support;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use ntmu_isa::Program;
use ntmu_isa::layout::Layout;
use ntmu_isa::profile::Profile;
use ntmu_isa::sampler::Sampler;
use ntmu_model::Material;
use ntmu_model::control::{Order, Plain};
use ntmu_model::sampler::Sampled;
use ntmu_model::stream::{AccessSpec, Interleave, Stream};
use ntmu_model::time::{Timing, Unit, simulate};
use std::alloc::{GlobalAlloc, System};
use std::hint::black_box;
use std::sync::atomic::{AtomicUsize, Ordering};

struct Counting;

static HELD: AtomicUsize = AtomicUsize::new(0);
static MOST: AtomicUsize = AtomicUsize::new(0);

// SAFETY: every call goes to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: std::alloc::Layout) -> *mut u8 {
        let held = HELD.fetch_add(layout.size(), Ordering::Relaxed) + layout.size();
        MOST.fetch_max(held, Ordering::Relaxed);
        // SAFETY: the caller's promise is handed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: std::alloc::Layout) {
        HELD.fetch_sub(layout.size(), Ordering::Relaxed);
        // SAFETY: the caller's promise is handed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

const SIZE: u32 = 1024;
const SCREEN: [u32; 2] = [512, 512];

const STREAMS: [(&str, &str); 2] = [
    ("texel blocks", "blocks:mip=0"),
    ("plane trilinear", "plane:pitch=30"),
];

fn run(unit: &Unit, materials: &[Material<'_>], stream: &Stream<'_>) -> Timing {
    simulate(unit, materials, &mut stream.demands(), &mut ()).unwrap()
}

fn runs(criterion: &mut Criterion) {
    let unit = Unit::desktop();
    let asset = support::asset(support::KINDS[3], SIZE);
    let program = Program::compile(&asset, Layout::TILED);
    let shape = asset.shape.clone();
    let sampled = [Sampled::new(shape.clone(), Sampler::default(), Profile::NORMATIVE).unwrap()];
    let plain = Plain::new(&shape, 3, Order::Blocked { side: 8 }).unwrap();
    let materials = [
        Material::new("cntc-16", &asset, &program),
        Material::with_addresses("plain", plain.work(), plain),
    ];
    let mut facts = Vec::new();
    let mut group = criterion.benchmark_group("time");
    group.sample_size(10);
    for material in &materials {
        for (name, text) in STREAMS {
            let stream = match text.parse().unwrap() {
                AccessSpec::Texels(spec) => Stream::texels(&spec, &sampled),
                AccessSpec::Scene(spec) => {
                    Stream::scene(&spec, SCREEN, &sampled, Interleave::QUADS)
                }
                AccessSpec::File(path) => panic!("{} is no stream", path.display()),
            };
            let (stream, material) = (stream.unwrap(), std::slice::from_ref(material));
            let before = HELD.load(Ordering::Relaxed);
            MOST.store(before, Ordering::Relaxed);
            let timing = run(&unit, material, &stream);
            let peak = MOST.load(Ordering::Relaxed) - before;
            let name = format!("{}, {name}", material[0].name());
            facts.push(serde_json::json!({
                "name": name,
                "stream": text,
                "pixels": timing.pixels,
                "decodes": timing.decodes,
                "cycles": timing.cycles,
                "peak_bytes": peak,
            }));
            group.throughput(Throughput::Elements(timing.pixels));
            group.bench_function(name, |bencher| {
                bencher.iter(|| black_box(run(&unit, material, &stream)));
            });
        }
    }
    group.finish();
    let target = std::env::var_os("CARGO_TARGET_DIR").map_or_else(
        || concat!(env!("CARGO_MANIFEST_DIR"), "/../target").into(),
        std::path::PathBuf::from,
    );
    let folder = target.join("criterion/time");
    std::fs::create_dir_all(&folder).unwrap();
    let facts = serde_json::json!({ "unit": unit.identity(), "runs": facts });
    std::fs::write(folder.join("facts.json"), facts.to_string()).unwrap();
}

criterion_group!(benches, runs);
criterion_main!(benches);
