//! Counter-based randomness: every number is a function of (seed, purpose, step, index).
//!
//! There is no state to save or to share between threads, so a run that is resumed at step n draws
//! exactly what the uninterrupted run would have drawn, in any order and on any number of threads.

/// What a stream of numbers is for. Two purposes never share a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Purpose {
    /// Initial weights of the synthesizer.
    Synthesizer,
    /// Initial weights of the encoder.
    Encoder,
    /// Initial latents where no encoder runs.
    Latents,
    /// Which texels make a batch.
    Batch,
    /// Uniform noise that stands for rounding.
    Noise,
    /// Where the crops lie.
    Crop,
    /// Which texels calibrate the activations.
    Calibration,
    /// Where the search for the principal components starts.
    Components,
}

/// A stream of numbers, addressed by index.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stream {
    key: u64,
}

/// The finaliser of SplitMix64 (Steele, Lea and Flood 2014): a bijection with full avalanche.
const fn mix(mut x: u64) -> u64 {
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

impl Stream {
    /// The stream of one purpose at one step.
    pub(crate) const fn new(seed: u64, purpose: Purpose, step: u64) -> Stream {
        let of_purpose = mix(seed.wrapping_add(GOLDEN.wrapping_mul(purpose as u64 + 1)));
        Stream {
            key: mix(of_purpose ^ mix(step.wrapping_add(GOLDEN))),
        }
    }

    /// 64 random bits.
    pub(crate) const fn bits(self, index: u64) -> u64 {
        mix(self.key.wrapping_add(GOLDEN.wrapping_mul(index)))
    }

    /// A real in 0..1, a multiple of 2^−53.
    pub(crate) fn unit(self, index: u64) -> f64 {
        (self.bits(index) >> 11) as f64 * (-53_f64).exp2()
    }

    /// An integer in 0..`bound`, by the high product; the bias is below `bound` / 2^32.
    pub(crate) const fn below(self, index: u64, bound: u32) -> u32 {
        (((self.bits(index) >> 32) * bound as u64) >> 32) as u32
    }

    /// A real in −1..1.
    pub(crate) fn signed(self, index: u64) -> f32 {
        (2.0 * self.unit(index) - 1.0) as f32
    }

    /// 32 bits for [`half_unit_noise`].
    pub(crate) const fn noise_key(self) -> u32 {
        (self.key >> 32) as u32
    }
}

/// A real in −½..½ for latent `index` of a step with this key: a 32-bit hash (lowbias32 by
/// Wellons), because a step needs one for every latent and 32-bit lanes are what vectorises.
#[inline(always)]
pub(crate) const fn half_unit_noise(key: u32, index: u32) -> f32 {
    let mut x = index.wrapping_mul(0x9e37_79b9) ^ key;
    x = (x ^ (x >> 16)).wrapping_mul(0x21f0_aaad);
    x = (x ^ (x >> 15)).wrapping_mul(0xd35a_2d97);
    x ^= x >> 15;
    // 24 bits fit a float exactly; the cast through i32 is the one that vectorises.
    ((x >> 8) as i32 - (1 << 23)) as f32 * (1.0 / (1_u32 << 24) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_of_different_purpose_or_step_differ() {
        let at = |purpose, step| Stream::new(7, purpose, step).bits(0);
        assert_ne!(at(Purpose::Batch, 0), at(Purpose::Noise, 0));
        assert_ne!(at(Purpose::Batch, 0), at(Purpose::Batch, 1));
        assert_eq!(at(Purpose::Batch, 3), at(Purpose::Batch, 3));
    }

    #[test]
    fn below_stays_below_and_reaches_everything() {
        let stream = Stream::new(1, Purpose::Batch, 0);
        let mut seen = [0_u32; 7];
        for index in 0..7000 {
            seen[stream.below(index, 7) as usize] += 1;
        }
        // Each bin is binomial with mean 1000 and deviation 29.3; six deviations on either side.
        assert!(seen.iter().all(|&n| (824..=1176).contains(&n)), "{seen:?}");
    }

    #[test]
    fn noise_is_uniform_with_mean_zero() {
        let key = Stream::new(5, Purpose::Noise, 9).noise_key();
        let n = 1 << 18;
        let mut bins = [0_u32; 16];
        for index in 0..n {
            let noise = half_unit_noise(key, index);
            assert!((-0.5..0.5).contains(&noise));
            bins[((noise + 0.5) * 16.0) as usize] += 1;
        }
        // Mean 16384, deviation 124; six deviations.
        assert!(bins.iter().all(|&b| b.abs_diff(16_384) < 744), "{bins:?}");
    }
}
