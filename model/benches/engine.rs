//! Speed of the engine.
//!
//! `cargo bench -p ntmu-model --bench engine [-- FILTER]`
//!
//! Groups, and what a unit of their throughput is:
//!
//! | group | unit | what |
//! |---|---|---|
//! | `peak` | product | the 8-bit dot product on registers alone |
//! | `mlp` | product | a synthesizer on a batch of 16,384 texels, inputs and codes row-major |
//! | `blocked` | product | the same, inputs and codes in the engine's own order |
//! | `mip` | texel | mip 0 of 512², from grids to planes |
//! | `chain` | texel | the whole chain of 1024², nine channels |
//! | `latency` | texel | one texel, then the next |
//!
//! `NTMU_EXPORT=DIR` writes the networks with their inputs and codes instead, for other engines.
#![allow(
    missing_docs,
    clippy::unwrap_used,
    reason = "criterion's macros document nothing; a benchmark stops by panicking"
)]

mod export;
mod support;

use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, BenchmarkId, Criterion, Throughput};
use ntmu_isa::Asset;
use ntmu_model::Request;
use ntmu_model::engine::kernel::Kernels;
use ntmu_model::engine::{Engine, Path};
use std::hint::black_box;
use std::time::Duration;
use support::{BATCH, KINDS, inputs};

/// Texels along a side of the decoded mip.
const SIDE: u32 = 512;

/// Steps of the dot product in one run of the peak.
const PEAK_STEPS: usize = 1 << 16;

fn pool(threads: usize) -> rayon::ThreadPool {
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .unwrap()
}

fn group<'c>(criterion: &'c mut Criterion, name: &str) -> BenchmarkGroup<'c, WallTime> {
    let mut group = criterion.benchmark_group(name);
    group
        .sample_size(10)
        .warm_up_time(Duration::from_millis(200))
        .measurement_time(Duration::from_millis(900));
    group
}

/// Machines that others use slow down and recover within seconds, so the peak is measured between
/// the other groups too; the fastest counts.
fn peak(criterion: &mut Criterion, turn: u32) {
    let mut group = group(criterion, "peak");
    for path in Path::available() {
        let kernels = Kernels::new(path).unwrap();
        let products = kernels.peak8(1) * PEAK_STEPS as u64;
        if products > 0 {
            group.throughput(Throughput::Elements(products));
            group.bench_function(BenchmarkId::new(path.name(), turn), |b| {
                b.iter(|| black_box(kernels.peak8(black_box(PEAK_STEPS))));
            });
        }
    }
}

fn synthesizers(criterion: &mut Criterion, assets: &[Asset], threads: usize) {
    let pool = pool(threads);
    for (kind, asset) in KINDS.iter().zip(assets) {
        let engine = Engine::new(asset);
        let batch = inputs(asset);
        let mut codes = vec![0; BATCH * kind.channels];
        let products = BATCH as u64 * u64::from(asset.macs());
        let mut mlp = group(criterion, "mlp");
        mlp.throughput(Throughput::Elements(products));
        mlp.bench_function(BenchmarkId::new(kind.name, threads), |b| {
            b.iter(|| pool.install(|| engine.synthesize(&batch, black_box(&mut codes))));
        });
        mlp.finish();
        let blocked = engine.block_inputs(&batch);
        let mut codes = engine.planar(&blocked);
        let mut native = group(criterion, "blocked");
        native.throughput(Throughput::Elements(products));
        native.bench_function(BenchmarkId::new(kind.name, threads), |b| {
            b.iter(|| pool.install(|| engine.synthesize_blocked(&blocked, black_box(&mut codes))));
        });
        native.finish();
    }
}

fn mips(criterion: &mut Criterion, assets: &[Asset], threads: usize) {
    let pool = pool(threads);
    let mut group = group(criterion, "mip");
    group.throughput(Throughput::Elements(u64::from(SIDE * SIDE)));
    for (kind, asset) in KINDS.iter().zip(assets) {
        let engine = Engine::new(asset);
        group.bench_function(BenchmarkId::new(kind.name, threads), |b| {
            b.iter(|| black_box(pool.install(|| engine.mip(0))));
        });
    }
}

fn chain(criterion: &mut Criterion) {
    let asset = support::asset(KINDS[3], 1024);
    let engine = Engine::new(&asset);
    let mut group = group(criterion, "chain");
    group.throughput(Throughput::Elements(asset.shape.texel_count()));
    for threads in [1, 2] {
        let pool = pool(threads);
        group.bench_function(BenchmarkId::new(KINDS[3].name, threads), |b| {
            b.iter(|| {
                pool.install(|| {
                    for mip in 0..asset.shape.mip_count {
                        black_box(engine.mip(mip));
                    }
                });
            });
        });
    }
}

fn latency(criterion: &mut Criterion, assets: &[Asset]) {
    let mut group = group(criterion, "latency");
    group.throughput(Throughput::Elements(1));
    for (kind, asset) in KINDS.iter().zip(assets) {
        let engine = Engine::new(asset);
        let (mut scratch, mut codes) = (engine.scratch(), vec![0; kind.channels]);
        let mut at = 0_u32;
        group.bench_function(BenchmarkId::new(kind.name, 1), |b| {
            b.iter(|| {
                at = at.wrapping_add(0x9e37_79b9);
                let request = Request::new(&asset.shape, at >> 23, (at >> 14) % SIDE, 0).unwrap();
                engine.texel(&mut scratch, request, &mut codes);
                black_box(&codes);
            });
        });
    }
}

fn main() {
    if let Some(folder) = std::env::var_os("NTMU_EXPORT") {
        export::export(std::path::Path::new(&folder));
        return;
    }
    let mut criterion = Criterion::default().without_plots().configure_from_args();
    let assets = KINDS.map(|kind| support::asset(kind, SIDE));
    peak(&mut criterion, 0);
    synthesizers(&mut criterion, &assets, 1);
    peak(&mut criterion, 1);
    synthesizers(&mut criterion, &assets, 2);
    mips(&mut criterion, &assets, 1);
    mips(&mut criterion, &assets, 2);
    chain(&mut criterion);
    latency(&mut criterion, &assets);
    peak(&mut criterion, 2);
    criterion.final_summary();
}
