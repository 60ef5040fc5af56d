//! Which texels make a batch.

use crate::random::Stream;
use crate::sampler::Texel;
use crate::texels::Texels;
use rayon::prelude::*;

/// Texels that one task draws.
const DRAWN_TOGETHER: usize = 1024;

/// The mip of a texel: in proportion to the mips' areas, ⌊−log4 u⌋ with u uniform, or with
/// probability `uniform` any mip alike.
///
/// A drawn mip beyond the chain becomes its last, which is where the areas of the missing tail
/// would have gone.
pub(crate) fn draw_mip(choice: f64, u: f64, mip_count: u8, uniform: f64) -> u8 {
    let last = mip_count - 1;
    if choice < uniform {
        // `choice / uniform` is uniform again, given the branch.
        return ((choice / uniform * f64::from(mip_count)) as u8).min(last);
    }
    // 1 − u is in 0..=1 without the 0 whose logarithm is infinite.
    let mip = -(1.0 - u).ln() / 4.0_f64.ln();
    if mip >= f64::from(last) {
        last
    } else {
        mip as u8
    }
}

/// Texel `index` of a batch of the whole set; none that is masked out.
pub(crate) fn draw_texel(stream: Stream, index: u64, texels: &Texels, uniform: f64) -> Texel {
    let at = 4 * index;
    let mips = texels.sizes.len() as u8;
    let mip = draw_mip(stream.unit(at), stream.unit(at + 1), mips, uniform);
    let (width, height) = texels.sizes[usize::from(mip)];
    if let Some(covered) = texels.covered(mip) {
        let place = covered[stream.below(at + 2, covered.len() as u32) as usize];
        return Texel {
            x: place % width,
            y: place / width,
            mip,
            window: 0,
        };
    }
    Texel {
        x: stream.below(at + 2, width),
        y: stream.below(at + 3, height),
        mip,
        window: 0,
    }
}

/// The buffers of one step, texel by texel.
#[derive(Debug)]
pub(crate) struct Batch {
    pub(crate) texels: Vec<Texel>,
    /// Where each texel's corners lie in grid 0 and in grid 1.
    pub(crate) corners: [Vec<[u32; 4]>; 2],
    /// Weights of those corners, in 1/256.
    pub(crate) weights: [Vec<[f32; 4]>; 2],
    /// Gradients of the inputs, texels × padded inputs.
    pub(crate) gradient: Vec<f32>,
}

impl Batch {
    pub(crate) fn new(len: usize, inputs: usize) -> Batch {
        Batch {
            texels: vec![
                Texel {
                    x: 0,
                    y: 0,
                    mip: 0,
                    window: 0
                };
                len
            ],
            corners: [vec![[0; 4]; len], vec![[0; 4]; len]],
            weights: [vec![[0.0; 4]; len], vec![[0.0; 4]; len]],
            gradient: vec![0.0; len * inputs],
        }
    }

    /// Draws every texel from the whole set.
    pub(crate) fn draw(&mut self, stream: Stream, texels: &Texels, uniform: f64) {
        let parts = self.texels.par_chunks_mut(DRAWN_TOGETHER).enumerate();
        parts.for_each(|(part, drawn)| {
            for (index, texel) in drawn.iter_mut().enumerate() {
                let index = part * DRAWN_TOGETHER + index;
                *texel = draw_texel(stream, index as u64, texels, uniform);
            }
        });
    }
}

/// Every texel of every mip, mip by mip in reading order.
pub(crate) fn all_texels(sizes: &[(u32, u32)]) -> impl Iterator<Item = Texel> + '_ {
    sizes
        .iter()
        .enumerate()
        .flat_map(|(mip, &(width, height))| {
            (0..height).flat_map(move |y| {
                (0..width).map(move |x| Texel {
                    x,
                    y,
                    mip: mip as u8,
                    window: 0,
                })
            })
        })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Purpose;

    #[test]
    fn mips_follow_their_areas_and_the_uniform_share() {
        let stream = Stream::new(11, Purpose::Batch, 4);
        let (mips, uniform, n) = (6_u8, 0.1, 400_000_u64);
        let mut counts = [0_u64; 6];
        for i in 0..n {
            counts[usize::from(draw_mip(
                stream.unit(2 * i),
                stream.unit(2 * i + 1),
                mips,
                uniform,
            ))] += 1;
        }
        for m in 0..6_u8 {
            // P(⌊−log4 u⌋ = m) = 4^−m − 4^−(m+1); the last mip takes the tail.
            let tail = 4.0_f64.powi(-i32::from(m));
            let area = if m == 5 { tail } else { tail * 0.75 };
            let p = uniform / 6.0 + (1.0 - uniform) * area;
            let deviation = (n as f64 * p * (1.0 - p)).sqrt();
            let expected = n as f64 * p;
            let found = counts[usize::from(m)] as f64;
            assert!(
                (found - expected).abs() < 6.0 * deviation,
                "mip {m}: {found}, not {expected}"
            );
        }
    }

    #[test]
    fn the_extremes_of_the_draw_stay_in_the_chain() {
        assert_eq!(draw_mip(0.5, 0.0, 9, 0.1), 0);
        assert_eq!(draw_mip(0.5, 1.0 - f64::EPSILON, 9, 0.1), 8);
        assert_eq!(draw_mip(0.0999999, 0.0, 9, 0.1), 8);
        assert_eq!(draw_mip(0.9, 0.9, 1, 0.0), 0);
    }
}
