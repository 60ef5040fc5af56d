//! Probes: single functions of the shaders against the specification's, on the device.

use crate::gpu::Gpu;
use crate::source::{WORKGROUP, source};
use crate::variant::Variant;
use ntmu_isa::round::Rounding;

mod embed;
mod half;
mod integer;

type Case = [u32; 4];
type Answer = [i32; 4];

/// The decode with the probes' entry points.
pub(crate) fn text() -> String {
    let mut text = source(&Variant::largest(), false);
    text.push_str(include_str!("../../wgsl/probe.wgsl"));
    text.push_str(include_str!("../../wgsl/probe_half.wgsl"));
    text
}

/// A device; `None`, and a line that says so, where there is none and none is demanded.
fn gpu() -> Option<Gpu> {
    match Gpu::open() {
        Ok(gpu) => Some(gpu),
        Err(error) if error.is_no_adapter() => {
            let demanded = ["NTMU_REQUIRE_ALL", "NTMU_REQUIRE_ADAPTER"]
                .iter()
                .find(|name| std::env::var_os(name).is_some_and(|v| v == "1"));
            assert!(demanded.is_none(), "{demanded:?} is 1 and {error}");
            eprintln!("SKIPPED: {error}");
            None
        }
        Err(error) => panic!("{error}"),
    }
}

/// Runs cases through an entry point and compares all answers with `expected`.
fn compare(entry: &str, cases: &[Case], expected: impl Fn(&Case) -> Answer) {
    let Some(gpu) = gpu() else { return };
    let pipeline = gpu.pipeline(text(), entry).unwrap();
    let storage = wgpu::BufferUsages::STORAGE;
    assert!(!cases.is_empty());
    // As many as one dimension of a dispatch and the smallest binding bear.
    for cases in cases.chunks(1 << 20) {
        let uploaded = gpu.upload("cases", cases, storage).unwrap();
        let results = gpu.results(4 * cases.len() as u64).unwrap();
        let bindings = [(10, &uploaded), (11, &results)];
        let groups = (cases.len() as u32).div_ceil(WORKGROUP);
        let words = gpu
            .run(&pipeline, &[bindings.to_vec()], groups, &results)
            .unwrap();
        assert_eq!(words.len(), 4 * cases.len());
        for (case, answer) in cases.iter().zip(words.chunks_exact(4)) {
            assert_eq!(answer, expected(case), "{entry} of {case:x?}");
        }
    }
}

/// A small generator of even quality; the same cases everywhere.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        // splitmix64 (Steele, Lea, Flood 2014).
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// 0..count.
    fn below(&mut self, count: u64) -> u64 {
        self.next() % count
    }

    /// Of every magnitude alike.
    fn signed(&mut self, bits: u32) -> i64 {
        let width = self.below(u64::from(bits) + 1) as u32;
        let magnitude = (u128::from(self.next()) & ((1 << width) - 1)) as i64;
        if self.next() & 1 == 1 {
            -magnitude
        } else {
            magnitude
        }
    }
}

fn rounding(code: u32) -> Rounding {
    Rounding::from_code(code as u8).unwrap()
}
