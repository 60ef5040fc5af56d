//! What the engine allocates. A file of its own: the allocator measures the whole process.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
#![allow(
    unsafe_code,
    reason = "an allocator is unsafe to implement; this one hands everything on"
)]

#[path = "../benches/support/mod.rs"]
#[allow(dead_code, unreachable_pub, reason = "the benchmarks use the rest")]
mod support;

use ntmu_isa::Asset;
use ntmu_isa::profile::Profile;
use ntmu_isa::rescale::Requantizer;
use ntmu_model::Request;
use ntmu_model::engine::{Engine, Path};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

struct Counting;

thread_local! {
    /// Of this thread alone: the harness prints the other test's result from its own meanwhile.
    static ALLOCATIONS: Cell<usize> = const { Cell::new(0) };
}
/// Bytes of all threads together: a chain is decoded on several.
static HELD: AtomicUsize = AtomicUsize::new(0);
static MOST_HELD: AtomicUsize = AtomicUsize::new(0);

/// What is held is one figure for all threads, so the tests take turns.
static TURN: Mutex<()> = Mutex::new(());

// SAFETY: every call goes to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.set(ALLOCATIONS.get() + 1);
        let held = HELD.fetch_add(layout.size(), Ordering::Relaxed) + layout.size();
        MOST_HELD.fetch_max(held, Ordering::Relaxed);
        // SAFETY: the caller's promise is handed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        HELD.fetch_sub(layout.size(), Ordering::Relaxed);
        // SAFETY: the caller's promise is handed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn a_texel_allocates_nothing_on_any_path_in_any_kind_and_with_any_requantiser() {
    let _turn = TURN.lock().unwrap();
    let kinds = [support::KINDS[3], support::KINDS[5]];
    for (requantizer, kind) in Requantizer::ALL
        .into_iter()
        .flat_map(|requantizer| kinds.map(|kind| (requantizer, kind)))
    {
        let mut parts = support::asset(kind, 64).into_parts();
        parts.profile = Profile {
            requantize: requantizer,
            ..Profile::NORMATIVE
        };
        let asset = Asset::new(parts).unwrap();
        for path in Path::available() {
            let engine = Engine::with_path(&asset, path).unwrap();
            let mut scratch = engine.scratch();
            let mut codes = vec![0; asset.shape.outputs.len()];
            let requests: Vec<Request> = (0..64)
                .map(|i| Request::new(&asset.shape, i, i * 7 % 64, 0).unwrap())
                .collect();
            let before = ALLOCATIONS.get();
            for &request in &requests {
                engine.texel(&mut scratch, request, &mut codes);
            }
            let after = ALLOCATIONS.get();
            let what = format!("{} {} {}", kind.name, path.name(), requantizer.name());
            assert_eq!(after - before, 0, "{what}");
        }
    }
}

/// The most that decoding may hold beside the asset and the codes.
const ROOM: usize = 64 << 20;

#[test]
fn a_chain_is_decoded_in_64_mib_beside_the_asset_and_its_codes() {
    let _turn = TURN.lock().unwrap();
    let asset = support::asset(support::KINDS[3], 1024);
    let before = HELD.load(Ordering::Relaxed);
    MOST_HELD.store(before, Ordering::Relaxed);
    let engine = Engine::new(&asset);
    for mip in 0..asset.shape.mip_count {
        engine.bands(mip, |_, _| {});
    }
    let banded = MOST_HELD.load(Ordering::Relaxed) - before;
    assert!(banded <= ROOM, "{banded} bytes by bands");
    let chain: Vec<_> = (0..asset.shape.mip_count)
        .map(|mip| engine.mip(mip))
        .collect();
    let codes: usize = chain.iter().map(|codes| 4 * codes.len()).sum();
    let whole = MOST_HELD.load(Ordering::Relaxed) - before - codes;
    assert!(whole <= ROOM, "{whole} bytes beside {codes} of codes");
}
