//! Hash: a number that looks random, of a place in a stream; there is no state.

/// The finaliser of SplitMix64 (Steele, Lea and Flood 2014): a bijection with full avalanche.
const fn mix(mut x: u64) -> u64 {
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

/// Number `index` of the numbers of `seed`: SplitMix64 started at a mixed seed.
pub(super) const fn number(seed: u64, index: u64) -> u64 {
    mix(mix(seed).wrapping_add(GOLDEN.wrapping_mul(index.wrapping_add(1))))
}

/// `number` scaled to 0..`count`: the product's upper half.
pub(super) const fn below(number: u64, count: u64) -> u64 {
    ((number as u128 * count as u128) >> 64) as u64
}

/// The random bits with which a stochastic sampler chooses at a pixel, in streams and in trace files
/// alike: a function of the pixel and of nothing else.
#[must_use]
pub const fn random_bits([x, y]: [u32; 2]) -> u64 {
    number(0, (y as u64) << 32 | x as u64)
}
