//! The texture set to train on.

use crate::error::TrainError;
use ndarray::Array3;
use ntmu_isa::asset::Map;
use ntmu_isa::limits;
use ntmu_isa::shape::{OutputFormat, Shape};
use rayon::prelude::*;

/// A texture set with its mip chain.
#[derive(Clone, Debug)]
pub struct Source {
    /// The set's name, for the asset's metadata.
    pub name: String,
    /// Reals by `[channel, row, column]`, mip 0 first. Mip m has `max(size >> m, 1)` texels along
    /// an axis. A channel that leaves as unorm holds 0..=1, one that leaves as snorm −1..=1.
    pub mips: Vec<Array3<f32>>,
    /// How each channel leaves the unit: its code is the real times the format's largest code, so
    /// not as `Float16`.
    pub outputs: Vec<OutputFormat>,
    /// The maps, in channel order; together they hold every channel once.
    pub maps: Vec<Map>,
}

impl Source {
    /// Whether the set can be trained on.
    ///
    /// # Errors
    /// The first part that is missing, has another size than its mip, or holds a value out of
    /// range.
    pub fn validate(&self) -> Result<(), TrainError> {
        let Some(first) = self.mips.first() else {
            return Err(TrainError::source("mips", "none", "at least mip 0"));
        };
        let (channels, height, width) = first.dim();
        let max = usize::from(limits::MAX_CHANNELS);
        if channels == 0 || channels > max {
            return Err(TrainError::source(
                "channels",
                channels,
                format!("1..={max}"),
            ));
        }
        let max = limits::MAX_SIZE as usize;
        if width == 0 || height == 0 || width > max || height > max {
            let found = format!("{width}×{height}");
            return Err(TrainError::source(
                "mips[0]",
                found,
                format!("1..={max} along each axis"),
            ));
        }
        let longest = Shape::max_mip_count(width as u32, height as u32);
        if self.mips.len() > usize::from(longest) {
            return Err(TrainError::source(
                "mips",
                self.mips.len(),
                format!("1..={longest}"),
            ));
        }
        if self.outputs.contains(&OutputFormat::Float16) {
            return Err(TrainError::source(
                "outputs",
                OutputFormat::Float16.name(),
                "unorm8, unorm16 or snorm8",
            ));
        }
        if self.outputs.len() != channels {
            let found = self.outputs.len();
            return Err(TrainError::source(
                "outputs",
                found,
                format!("{channels}, one a channel"),
            ));
        }
        for (m, mip) in self.mips.iter().enumerate() {
            let expected = (channels, (height >> m).max(1), (width >> m).max(1));
            if mip.dim() != expected {
                let found = format!("{:?}", mip.dim());
                return Err(TrainError::source(
                    format!("mips[{m}]"),
                    found,
                    format!("{expected:?}"),
                ));
            }
            for (channel, plane) in mip.outer_iter().enumerate() {
                let (low, high) = real_range(self.outputs[channel]);
                // Not `v < low`: a NaN is in no range.
                if let Some(v) = plane.iter().find(|&&v| !(v >= low && v <= high)) {
                    let field = format!("mips[{m}] channel {channel}");
                    return Err(TrainError::source(field, v, format!("{low}..={high}")));
                }
            }
        }
        Ok(())
    }
}

/// The reals that a format can emit.
pub(crate) fn real_range(format: OutputFormat) -> (f32, f32) {
    let (low, high) = format.range();
    (low as f32 / high as f32, 1.0)
}

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
}

impl Texels {
    pub(crate) fn new(source: &Source) -> Texels {
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
        let sizes = source
            .mips
            .iter()
            .map(|m| (m.dim().2 as u32, m.dim().1 as u32))
            .collect();
        Texels {
            channels,
            sizes,
            mips: mips.collect(),
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

    /// The mean of a channel over the coarsest mip.
    pub(crate) fn mean(&self, channel: usize) -> f32 {
        let Some(coarsest) = self.mips.last() else {
            return 0.0;
        };
        let texels = coarsest.chunks_exact(self.channels);
        let count = texels.len() as f32;
        texels.map(|t| t[channel]).sum::<f32>() / count
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
        let mut bytes = Vec::new();
        for block in self.mips.iter().flat_map(|m| m.chunks(1 << 14)) {
            bytes.clear();
            bytes.extend(block.iter().flat_map(|v| v.to_le_bytes()));
            hasher.update(&bytes);
        }
        hasher.finalize()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn source(width: usize, height: usize) -> Source {
        Source {
            name: "test".into(),
            mips: vec![Array3::from_elem((2, height, width), 0.5)],
            outputs: vec![OutputFormat::Unorm8; 2],
            maps: Vec::new(),
        }
    }

    #[test]
    fn a_wrong_mip_size_a_value_out_of_range_and_a_nan_are_refused() {
        assert!(source(3, 1).validate().is_ok());
        let mut wrong = source(4, 4);
        wrong.mips.push(Array3::from_elem((2, 2, 3), 0.5));
        assert!(
            wrong
                .validate()
                .unwrap_err()
                .to_string()
                .contains("mips[1]")
        );
        for value in [1.5, -0.1, f32::NAN] {
            let mut wrong = source(4, 4);
            wrong.mips[0][[1, 2, 3]] = value;
            assert!(
                wrong
                    .validate()
                    .unwrap_err()
                    .to_string()
                    .contains("channel 1"),
                "{value}"
            );
        }
        let mut wrong = source(4, 4);
        wrong.outputs.pop();
        assert!(wrong.validate().is_err());
    }

    #[test]
    fn texels_keep_channels_together_and_the_fingerprint_sees_every_value() {
        let mut s = source(5, 3);
        s.mips[0][[1, 2, 4]] = 0.25;
        let texels = Texels::new(&s);
        assert_eq!(texels.texel(4, 2, 0), [0.5, 0.25]);
        assert_eq!(texels.texel(4, 1, 0), [0.5, 0.5]);
        assert_ne!(
            texels.fingerprint(),
            Texels::new(&source(5, 3)).fingerprint()
        );
    }
}
