//! The texture set to train on.

use crate::error::TrainError;
use ndarray::{Array2, Array3};
use ntmu_isa::asset::Map;
use ntmu_isa::limits;
use ntmu_isa::shape::{OutputFormat, Shape};

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
    /// Which texels of mip 0 count, by `[row, column]`; all of them without it. A texel of another
    /// mip counts if any that lies below it does. The others are left out of the loss and of what
    /// the run measures.
    pub mask: Option<Array2<bool>>,
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
        if let Some(mask) = &self.mask {
            if mask.dim() != (height, width) {
                let (rows, columns) = mask.dim();
                return Err(TrainError::source(
                    "mask",
                    format!("{columns}×{rows}"),
                    format!("{width}×{height}"),
                ));
            }
            if !mask.iter().any(|&counts| counts) {
                return Err(TrainError::source(
                    "mask",
                    "no texel",
                    "at least one that counts",
                ));
            }
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

    /// Width and height of every mip.
    #[must_use]
    pub fn sizes(&self) -> Vec<(u32, u32)> {
        let sizes = self.mips.iter().map(|mip| mip.dim());
        sizes
            .map(|(_, height, width)| (width as u32, height as u32))
            .collect()
    }

    /// The channels of the map with this name.
    ///
    /// # Errors
    /// When there is none.
    pub fn channels_of(&self, map: &str) -> Result<std::ops::Range<usize>, TrainError> {
        let Some(found) = self.maps.iter().find(|m| m.name == map) else {
            let names: Vec<&str> = self.maps.iter().map(|m| m.name.as_str()).collect();
            return Err(TrainError::source("map", map, names.join(", ")));
        };
        let first = usize::from(found.first_channel);
        Ok(first..first + usize::from(found.channel_count))
    }

    /// Leaves out the texels at which the last channel of a map (its alpha, where it has one) is
    /// zero in mip 0.
    ///
    /// # Errors
    /// When there is no such map.
    pub fn mask_with(&mut self, map: &str) -> Result<(), TrainError> {
        let channel = self.channels_of(map)?.end - 1;
        let Some(first) = self.mips.first() else {
            return Err(TrainError::source("mips", "none", "at least mip 0"));
        };
        let plane = first.outer_iter().nth(channel);
        self.mask = plane.map(|plane| plane.mapv(|value| value != 0.0));
        Ok(())
    }

    /// Scales the vectors of a map of normals, in every mip, to unit length: the mean of unit
    /// vectors, which a mip holds, is shorter. A vector of no length stays.
    ///
    /// A channel that leaves as unorm holds (component + 1) / 2, one that leaves as snorm the
    /// component.
    ///
    /// # Errors
    /// When there is no such map, or it has not three channels.
    pub fn renormalise(&mut self, map: &str) -> Result<(), TrainError> {
        let channels = self.channels_of(map)?;
        if channels.len() != 3 {
            let found = format!("{} channels", channels.len());
            return Err(TrainError::source(
                format!("map {map}"),
                found,
                "three, x, y and z, to renormalise",
            ));
        }
        let first = channels.start;
        let is_signed = self.outputs[first] == OutputFormat::Snorm8;
        let (scale, offset, low) = if is_signed {
            (1.0, 0.0, -1.0)
        } else {
            (2.0, -1.0, 0.0)
        };
        for mip in &mut self.mips {
            let (_, height, width) = mip.dim();
            for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
                let normal = [0, 1, 2].map(|c| mip[[first + c, y, x]] * scale + offset);
                let length = normal.iter().map(|n| n * n).sum::<f32>().sqrt();
                if length > 0.0 {
                    for (c, n) in normal.into_iter().enumerate() {
                        let value = (n / length - offset) / scale;
                        mip[[first + c, y, x]] = value.clamp(low, 1.0);
                    }
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

#[cfg(test)]
mod tests {
    use super::*;

    fn map(name: &str, first_channel: u16, channel_count: u16) -> Map {
        Map {
            name: name.into(),
            first_channel,
            channel_count,
            encoding: ntmu_isa::asset::Encoding::Linear,
            bit_depth: 8,
        }
    }

    fn source(width: usize, height: usize) -> Source {
        Source {
            name: "test".into(),
            mips: vec![Array3::from_elem((2, height, width), 0.5)],
            outputs: vec![OutputFormat::Unorm8; 2],
            maps: Vec::new(),
            mask: None,
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
    fn renormalised_vectors_have_unit_length_in_every_mip_and_the_zero_vector_stays() {
        for (format, zero) in [(OutputFormat::Unorm8, 0.5), (OutputFormat::Snorm8, 0.0)] {
            let mut s = source(4, 4);
            s.outputs = vec![format; 4];
            s.maps = vec![map("alpha", 0, 1), map("normal", 1, 3)];
            let value =
                |(c, y, x): (usize, usize, usize)| 0.2 + 0.1 * c as f32 + 0.05 * (x + y) as f32;
            s.mips = [4, 2, 1]
                .map(|n| Array3::from_shape_fn((4, n, n), value))
                .to_vec();
            let alpha = s.mips.clone();
            for c in 1..4 {
                s.mips[1][[c, 0, 0]] = zero;
            }
            s.renormalise("normal").unwrap();
            s.validate().unwrap();
            for (mip, alpha) in s.mips.iter().zip(&alpha) {
                let (_, h, w) = mip.dim();
                for (y, x) in (0..h).flat_map(|y| (0..w).map(move |x| (y, x))) {
                    assert_eq!(mip[[0, y, x]], alpha[[0, y, x]]);
                    let square: f32 = (1..4)
                        .map(|c| ((mip[[c, y, x]] - zero) / (1.0 - zero)).powi(2))
                        .sum();
                    let is_zero = h == 2 && (y, x) == (0, 0);
                    // Three squares of numbers with 24 bits, and a root.
                    let expected = if is_zero { 0.0 } else { 1.0 };
                    assert!((square - expected).abs() < 8.0 * f32::EPSILON, "{square}");
                }
            }
            assert!(s.renormalise("alpha").is_err() && s.renormalise("color").is_err());
        }
    }

    #[test]
    fn a_mask_of_another_size_and_one_that_leaves_nothing_are_refused() {
        let mut s = source(4, 3);
        s.mask = Some(Array2::from_elem((4, 3), true));
        assert!(s.validate().unwrap_err().to_string().contains("mask"));
        s.mask = Some(Array2::from_elem((3, 4), false));
        assert!(s.validate().unwrap_err().to_string().contains("no texel"));
        s.mips[0][[1, 2, 3]] = 0.0;
        s.maps = vec![map("color", 0, 2)];
        s.mask_with("color").unwrap();
        s.validate().unwrap();
        let mask = s.mask.unwrap();
        assert!(
            mask.indexed_iter()
                .all(|(at, &counts)| counts == (at != (2, 3)))
        );
    }
}
