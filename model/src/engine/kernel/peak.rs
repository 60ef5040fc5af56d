//! Peak: the 8-bit dot product on registers alone, for the benchmark that compares with it.
//!
//! It lives here because it needs the same instructions, and is the only use of them that computes
//! nothing of interest.

use super::Set;
#[cfg(target_arch = "x86_64")]
use std::hint::black_box;

/// Sums at once: enough to hide the latency of the instruction on any processor of today.
#[cfg(target_arch = "x86_64")]
const SUMS: usize = 16;

/// See `Kernels::peak8`. Where a set has no such instruction the answer is 0.
#[cfg_attr(
    not(target_arch = "x86_64"),
    expect(unused_variables, reason = "no peak there")
)]
pub(super) fn run(set: Set, steps: usize) -> u64 {
    match set {
        Set::Scalar => 0,
        #[cfg(target_arch = "x86_64")]
        Set::Avx2 => {
            // SAFETY: `Kernels::new` found AVX2.
            unsafe { madd(steps) };
            (steps * SUMS / 2 * 16) as u64
        }
        #[cfg(target_arch = "x86_64")]
        Set::Avx512 => {
            // SAFETY: `Kernels::new` found AVX-512 F, BW and VNNI.
            unsafe { dpbusd(steps) };
            (steps * SUMS * 64) as u64
        }
        #[cfg(target_arch = "aarch64")]
        Set::Neon => 0,
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512vnni")]
fn dpbusd(steps: usize) {
    use std::arch::x86_64::{_mm512_dpbusd_epi32, _mm512_set1_epi32};
    let (a, b) = black_box((
        _mm512_set1_epi32(0x0102_0304),
        _mm512_set1_epi32(0x0101_0101),
    ));
    let mut sums = black_box([_mm512_set1_epi32(0); SUMS]);
    for _ in 0..steps {
        for sum in &mut sums {
            *sum = _mm512_dpbusd_epi32(*sum, a, b);
        }
    }
    black_box(sums);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn madd(steps: usize) {
    use std::arch::x86_64::{_mm256_add_epi32, _mm256_madd_epi16, _mm256_set1_epi32};
    let mut sums = black_box([_mm256_set1_epi32(0); SUMS / 2]);
    let b = black_box(_mm256_set1_epi32(0x0001_0001));
    for _ in 0..steps {
        for sum in &mut sums {
            // The multiplicand changes with the sum, or the product would be computed once.
            *sum = _mm256_add_epi32(*sum, _mm256_madd_epi16(*sum, b));
        }
    }
    black_box(sums);
}
