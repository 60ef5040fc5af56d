//! Assets of every kind, and a decoder of a few lines that uses nothing but the specification.

mod recipe;
mod reference;

pub(crate) use recipe::{Halves, Recipe, shape};
pub(crate) use reference::reference;

use ntmu_shaders::Gpu;

/// A device; `None`, and a line that says so, where there is none and none is demanded.
pub(crate) fn gpu() -> Option<Gpu> {
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

/// A small generator; the same numbers everywhere.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn next(&mut self) -> u64 {
        // splitmix64 (Steele, Lea, Flood 2014).
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// `low..=high`.
    pub(crate) fn within(&mut self, low: i64, high: i64) -> i64 {
        low + (self.next() % (high - low + 1) as u64) as i64
    }

    pub(crate) fn one_of<T: Copy>(&mut self, choices: &[T]) -> T {
        choices[self.within(0, choices.len() as i64 - 1) as usize]
    }
}
