//! Texels: the set as a step reads it, with what each texel and channel counts.

use crate::error::TrainError;
use crate::source::Source;
use ndarray::Array2;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// The texels of every mip, channels of a texel together.
///
/// A step reads a few ten thousand texels from all over the set, so a texel must be one cache
/// line, not one line for each channel.
#[derive(Debug)]
pub(crate) struct Texels {
    pub(crate) channels: usize,
    /// Width and height of every mip.
    pub(crate) sizes: Vec<(u32, u32)>,
    mips: Vec<Vec<f32>>,
    /// How much the squared error of each channel counts; the mean is 1.
    pub(crate) weights: Vec<f32>,
    /// The texels of each mip that count, in reading order; all of them without it.
    covered: Option<Vec<Coverage>>,
}

/// The texels of a mip that count.
#[derive(Debug)]
struct Coverage {
    /// For each texel.
    mask: Vec<bool>,
    /// Their numbers in reading order.
    list: Vec<u32>,
}

impl Texels {
    /// The texels of a set whose maps count as `named` says, those without a name once.
    pub(crate) fn new(
        source: &Source,
        named: &BTreeMap<String, f64>,
    ) -> Result<Texels, TrainError> {
        let channels = source.outputs.len();
        let mips = source.mips.iter().map(|mip| {
            let (_, height, width) = mip.dim();
            let mut out = vec![0.0; channels * height * width];
            out.par_chunks_mut(channels * width)
                .enumerate()
                .for_each(|(row, out)| {
                    for (channel, plane) in mip.outer_iter().enumerate() {
                        for (texel, &value) in plane.row(row).iter().enumerate() {
                            out[texel * channels + channel] = value;
                        }
                    }
                });
            out
        });
        let mips = mips.collect();
        let sizes = source.sizes();
        // A mask that leaves nothing out is none: texels are drawn as without it.
        let mask = source.mask.as_ref();
        let mask = mask.filter(|mask| mask.iter().any(|counts| !counts));
        let covered = mask.map(|mask| coverage(mask, &sizes));
        Ok(Texels {
            channels,
            sizes,
            mips,
            weights: weights(source, named)?,
            covered,
        })
    }

    /// Whether a texel counts.
    #[inline(always)]
    pub(crate) fn is_covered(&self, x: u32, y: u32, mip: u8) -> bool {
        let Some(covered) = &self.covered else {
            return true;
        };
        let mip = usize::from(mip);
        covered[mip].mask[y as usize * self.sizes[mip].0 as usize + x as usize]
    }

    /// The texels of a mip that count, in reading order; none where all do.
    pub(crate) fn covered(&self, mip: u8) -> Option<&[u32]> {
        let covered = self.covered.as_ref()?;
        Some(&covered[usize::from(mip)].list)
    }

    /// How many texels of a mip count.
    pub(crate) fn counted(&self, mip: u8) -> u64 {
        let (width, height) = self.sizes[usize::from(mip)];
        let all = u64::from(width) * u64::from(height);
        self.covered(mip).map_or(all, |list| list.len() as u64)
    }

    /// The channels of one texel as a step compares them: no numbers where it does not count.
    #[inline(always)]
    pub(crate) fn target(&self, x: u32, y: u32, mip: u8, out: &mut [f32]) {
        if self.is_covered(x, y, mip) {
            out.copy_from_slice(self.texel(x, y, mip));
        } else {
            out.fill(f32::NAN);
        }
    }

    /// The channels of one texel.
    #[inline(always)]
    pub(crate) fn texel(&self, x: u32, y: u32, mip: u8) -> &[f32] {
        let (width, _) = self.sizes[usize::from(mip)];
        let at = (y as usize * width as usize + x as usize) * self.channels;
        &self.mips[usize::from(mip)][at..at + self.channels]
    }

    /// The texels of each mip, row by row, whole texels together.
    pub(crate) fn mips(&self) -> &[Vec<f32>] {
        &self.mips
    }

    /// The value of each channel that has only one.
    pub(crate) fn constants(&self) -> Vec<Option<f32>> {
        let of = |channel: usize| {
            let first = self.mips.first()?.get(channel)?;
            let mut all = self.mips.iter().flat_map(|m| m.chunks_exact(self.channels));
            all.all(|texel| texel[channel] == *first).then_some(*first)
        };
        (0..self.channels).map(of).collect()
    }

    /// The mean of a channel over the texels of the coarsest mip that count.
    pub(crate) fn mean(&self, channel: usize) -> f32 {
        let Some(coarsest) = self.mips.last() else {
            return 0.0;
        };
        let last = self.sizes.len() as u8 - 1;
        let texels = coarsest.chunks_exact(self.channels);
        let sum = match self.covered(last) {
            Some(list) => list
                .iter()
                .map(|&at| coarsest[at as usize * self.channels + channel])
                .sum::<f32>(),
            None => texels.map(|t| t[channel]).sum::<f32>(),
        };
        sum / self.counted(last) as f32
    }

    /// Every texel of every mip.
    pub(crate) fn count(&self) -> u64 {
        self.sizes
            .iter()
            .map(|&(w, h)| u64::from(w) * u64::from(h))
            .sum()
    }

    /// A number that changes when any value does.
    pub(crate) fn fingerprint(&self) -> u32 {
        let mut hasher = crc32fast::Hasher::new();
        for &(w, h) in &self.sizes {
            hasher.update(&w.to_le_bytes());
            hasher.update(&h.to_le_bytes());
        }
        for weight in &self.weights {
            hasher.update(&weight.to_le_bytes());
        }
        let masks = self.covered.iter().flatten().take(1);
        for number in masks.flat_map(|mip| &mip.list) {
            hasher.update(&number.to_le_bytes());
        }
        let mut bytes = Vec::new();
        for block in self.mips.iter().flat_map(|m| m.chunks(1 << 14)) {
            bytes.clear();
            bytes.extend(block.iter().flat_map(|v| v.to_le_bytes()));
            hasher.update(&bytes);
        }
        hasher.finalize()
    }
}

/// The weight of each channel in the loss; their mean is 1.
fn weights(source: &Source, named: &BTreeMap<String, f64>) -> Result<Vec<f32>, TrainError> {
    let mut weights = vec![1.0; source.outputs.len()];
    for (map, &weight) in named {
        for channel in source.channels_of(map)? {
            weights[channel] = weight;
        }
    }
    let sum: f64 = weights.iter().sum();
    if sum == 0.0 {
        return Err(TrainError::config(
            "weights",
            "all zero",
            "one map that counts",
        ));
    }
    let scale = weights.len() as f64 / sum;
    Ok(weights
        .iter()
        .map(|weight| (weight * scale) as f32)
        .collect())
}

/// Which texels of each mip count: those above any of mip 0 that does.
fn coverage(mask: &Array2<bool>, sizes: &[(u32, u32)]) -> Vec<Coverage> {
    let (rows, columns) = mask.dim();
    let of = |(mip, &(width, height)): (usize, &(u32, u32))| {
        let (width, height) = (width as usize, height as usize);
        let mut covered = vec![false; width * height];
        for (row, texels) in mask.outer_iter().enumerate() {
            // An odd size leaves a last row and column that belong to the texel before them.
            let y = (row >> mip).min(height - 1);
            for (column, &counts) in texels.iter().enumerate() {
                covered[y * width + (column >> mip).min(width - 1)] |= counts;
            }
        }
        let list = (0..).zip(&covered).filter(|(_, counts)| **counts);
        Coverage {
            list: list.map(|(number, _)| number).collect(),
            mask: covered,
        }
    };
    debug_assert_eq!((columns as u32, rows as u32), sizes[0]);
    sizes.iter().enumerate().map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array3;
    use ntmu_isa::shape::OutputFormat;

    fn source(width: usize, height: usize) -> Source {
        Source {
            name: "test".into(),
            mips: vec![Array3::from_elem((2, height, width), 0.5)],
            outputs: vec![OutputFormat::Unorm8; 2],
            maps: Vec::new(),
            mask: None,
        }
    }

    fn texels(source: &Source) -> Texels {
        Texels::new(source, &BTreeMap::new()).unwrap()
    }

    #[test]
    fn texels_keep_channels_together_and_the_fingerprint_sees_every_value_and_the_mask() {
        let mut s = source(5, 3);
        s.mips[0][[1, 2, 4]] = 0.25;
        let changed = texels(&s);
        assert_eq!(changed.texel(4, 2, 0), [0.5, 0.25]);
        assert_eq!(changed.texel(4, 1, 0), [0.5, 0.5]);
        let plain = texels(&source(5, 3));
        assert_ne!(changed.fingerprint(), plain.fingerprint());
        let mut masked = source(5, 3);
        masked.mask = Some(Array2::from_shape_fn((3, 5), |at| at != (1, 1)));
        assert_ne!(texels(&masked).fingerprint(), plain.fingerprint());
    }

    #[test]
    fn a_texel_of_any_mip_counts_exactly_when_one_below_it_does() {
        let (width, height) = (7_usize, 5_usize);
        for (row, column) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
            let mut s = source(width, height);
            let size = |m: usize| (2, (height >> m).max(1), (width >> m).max(1));
            s.mips = (0..3).map(|m| Array3::from_elem(size(m), 0.5)).collect();
            s.mask = Some(Array2::from_shape_fn((height, width), |at| {
                at == (row, column)
            }));
            let texels = texels(&s);
            for mip in 0..3_u8 {
                let (w, h) = texels.sizes[usize::from(mip)];
                let (x, y) = (
                    (column as u32 >> mip).min(w - 1),
                    (row as u32 >> mip).min(h - 1),
                );
                assert_eq!(texels.covered(mip), Some([y * w + x].as_slice()));
                assert_eq!(texels.counted(mip), 1);
                let mut target = [0.0; 2];
                for (ty, tx) in (0..h).flat_map(|y| (0..w).map(move |x| (y, x))) {
                    texels.target(tx, ty, mip, &mut target);
                    let counts = (tx, ty) == (x, y);
                    assert_eq!(target[0].is_nan(), !counts);
                    assert_eq!(texels.is_covered(tx, ty, mip), counts);
                }
            }
        }
    }
}
