//! Quality: how far a texture set is from its source, per map, per mip and overall, and what it
//! costs in bits.

mod markdown;

use crate::metrics::{self, AngleErrors, AngleFigures, Mask, MetricsError};
use crate::texture_set::TextureSet;
use ndarray::{Array3, Axis, Slice};
use ntmu_isa::Asset;
use ntmu_isa::asset::Encoding;
use rayon::prelude::*;
use serde::Serialize;
use std::ops::Range;

/// One pair of figures. `null` in JSON stands for the infinite PSNR of equal images, and for both
/// where no texel of a mask counts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Figures {
    /// In dB, peak 1; see [`metrics::psnr`]. Not a number where no texel counts.
    pub psnr: f64,
    /// 0 to 1; see [`metrics::ssim`]. Not a number where no window counts.
    pub ssim: f64,
}

/// Angles between the normals of a map; see [`metrics::angle_errors`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Angles {
    /// Per mip, mip 0 first.
    pub mips: Vec<AngleFigures>,
    /// Of all normals of the chain.
    pub overall: AngleFigures,
}

/// SSIMULACRA2 of a colour map; see [`metrics::ssimulacra2`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Perceptual {
    /// Per mip, mip 0 first; none where a side is below [`metrics::LEAST_SIDE`].
    pub mips: Vec<Option<f64>>,
    /// The mean of those that were measured, weighted by their texels as the paper weighs SSIM.
    pub overall: Option<f64>,
}

/// The figures of one map.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MapQuality {
    /// The map's name.
    pub map: String,
    /// How its channels are to be understood; see [`Encoding::name`].
    pub encoding: &'static str,
    /// Per mip, mip 0 first.
    pub mips: Vec<Figures>,
    /// Over the whole chain.
    pub overall: Figures,
    /// Of a normal map with 2 or 3 channels.
    pub angles: Option<Angles>,
    /// Of an sRGB map with 1 or 3 channels, where no mask was given.
    pub perceptual: Option<Perceptual>,
}

/// The figures of a texture set.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Quality {
    /// Per map, in channel order.
    pub maps: Vec<MapQuality>,
    /// All channels, per mip.
    pub mips: Vec<Figures>,
    /// All channels of the whole chain: the paper's definition.
    pub overall: Figures,
    /// Texels of each mip along x and y.
    pub sizes: Vec<(usize, usize)>,
    /// Share of mip 0 that was measured, where a mask was given.
    pub masked_share: Option<f64>,
}

/// A map and where its channels are.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MapChannels {
    /// The map's name.
    pub name: String,
    /// Its channels in the set.
    pub channels: Range<usize>,
    /// How they are to be understood.
    pub encoding: Encoding,
}

/// Two chains of \[channel, row, column\], and what of them counts.
#[derive(Clone, Copy)]
struct Pair<'a> {
    reference: &'a [Array3<f32>],
    test: &'a [Array3<f32>],
    mask: Option<&'a Mask>,
}

impl Quality {
    /// Compares `test` with `reference`; both are chains of \[channel, row, column\], 0..=1.
    ///
    /// # Errors
    /// When the two do not have the same shape.
    pub fn measure(
        reference: &[Array3<f32>],
        test: &[Array3<f32>],
        maps: &[MapChannels],
    ) -> Result<Quality, MetricsError> {
        Quality::measure_within(reference, test, maps, None)
    }

    /// Compares the texels in a mask, or all of them. SSIMULACRA2 is not defined within a mask and
    /// is left out with one.
    ///
    /// # Errors
    /// When the two do not have the same shape, or the mask does not fit or leaves nothing.
    pub fn measure_within(
        reference: &[Array3<f32>],
        test: &[Array3<f32>],
        maps: &[MapChannels],
        mask: Option<&Mask>,
    ) -> Result<Quality, MetricsError> {
        let pair = Pair {
            reference,
            test,
            mask,
        };
        let measured = maps.iter().map(|map| pair.map(map));
        let measured = measured.collect::<Result<Vec<_>, MetricsError>>()?;
        let all: Vec<usize> = maps.iter().flat_map(|map| map.channels.clone()).collect();
        let size = |mip: &Array3<f32>| (mip.len_of(Axis(2)), mip.len_of(Axis(1)));
        Ok(Quality {
            maps: measured,
            mips: pair.per_mip(&all)?,
            overall: pair.figures(&all, &pair.mips())?,
            sizes: reference.iter().map(size).collect(),
            masked_share: mask.map(Mask::share),
        })
    }
}

impl Pair<'_> {
    fn mips(&self) -> Vec<usize> {
        (0..self.reference.len().max(self.test.len())).collect()
    }

    fn figures(&self, channels: &[usize], mips: &[usize]) -> Result<Figures, MetricsError> {
        let (reference, test, mask) = (self.reference, self.test, self.mask);
        Ok(Figures {
            psnr: metrics::psnr_within(reference, test, channels, mips, mask)?,
            ssim: match metrics::ssim_within(reference, test, channels, mips, mask) {
                // The mask has texels, which PSNR found, but no window around one.
                Err(MetricsError::Empty) if mask.is_some() => f64::NAN,
                ssim => ssim?,
            },
        })
    }

    fn per_mip(&self, channels: &[usize]) -> Result<Vec<Figures>, MetricsError> {
        let figures = |mip: usize| match self.figures(channels, &[mip]) {
            Err(MetricsError::Empty) if self.mask.is_some_and(|mask| !mask.covers(mip)) => {
                Ok(Figures {
                    psnr: f64::NAN,
                    ssim: f64::NAN,
                })
            }
            figures => figures,
        };
        self.mips().into_iter().map(figures).collect()
    }

    fn map(&self, map: &MapChannels) -> Result<MapQuality, MetricsError> {
        let channels: Vec<usize> = map.channels.clone().collect();
        let (is_normal, is_colour) = match map.encoding {
            Encoding::Srgb => (false, matches!(channels.len(), 1 | 3)),
            Encoding::Linear => (false, false),
            Encoding::NormalGl | Encoding::NormalDx => (matches!(channels.len(), 2 | 3), false),
        };
        Ok(MapQuality {
            map: map.name.clone(),
            encoding: map.encoding.name(),
            mips: self.per_mip(&channels)?,
            overall: self.figures(&channels, &self.mips())?,
            angles: is_normal.then(|| self.angles(&channels)).transpose()?,
            perceptual: (is_colour && self.mask.is_none()).then(|| self.perceptual(map)),
        })
    }

    fn angles(&self, channels: &[usize]) -> Result<Angles, MetricsError> {
        let mut all = AngleErrors::default();
        let mut mips = Vec::new();
        for mip in self.mips() {
            let found = metrics::angle_errors(self.reference, self.test, channels, mip, self.mask);
            let errors = match found {
                Err(MetricsError::Empty) if self.mask.is_some() => AngleErrors::default(),
                errors => errors?,
            };
            mips.push(errors.clone().figures());
            all.append(errors);
        }
        Ok(Angles {
            mips,
            overall: all.figures(),
        })
    }

    /// Both chains have the map's channels.
    fn perceptual(&self, map: &MapChannels) -> Perceptual {
        let channels = Slice::from(map.channels.clone());
        let pairs: Vec<_> = self.reference.iter().zip(self.test).collect();
        let scores = pairs.par_iter().map(|(a, b)| {
            let (a, b) = (
                a.slice_axis(Axis(0), channels),
                b.slice_axis(Axis(0), channels),
            );
            metrics::ssimulacra2(a, b)
        });
        let mips: Vec<Option<f64>> = scores.collect();
        let (mut sum, mut texels) = (0.0, 0.0);
        for (score, (mip, _)) in mips.iter().zip(&pairs) {
            if let Some(score) = score {
                let weight = (mip.len_of(Axis(1)) * mip.len_of(Axis(2))) as f64;
                sum += weight * score;
                texels += weight;
            }
        }
        Perceptual {
            mips,
            overall: (texels > 0.0).then(|| sum / texels),
        }
    }
}

/// The maps of an asset with their channels.
#[must_use]
pub fn maps_of(asset: &Asset) -> Vec<MapChannels> {
    let maps = asset.metadata.maps.iter();
    maps.map(|map| {
        let first = usize::from(map.first_channel);
        MapChannels {
            name: map.name.clone(),
            channels: first..first + usize::from(map.channel_count),
            encoding: map.encoding,
        }
    })
    .collect()
}

/// The maps of a texture set with their channels.
#[must_use]
pub fn maps_of_set(set: &TextureSet) -> Vec<MapChannels> {
    let maps = set.maps.iter();
    maps.map(|map| MapChannels {
        name: map.name.clone(),
        channels: map.channels(),
        encoding: map.encoding,
    })
    .collect()
}

/// Bits per pixel and channel of an asset, parameters counted; see [`metrics::bppc`].
#[must_use]
pub fn bppc(asset: &Asset) -> f64 {
    let shape = &asset.shape;
    let channels = shape.outputs.len();
    metrics::bppc(
        asset.grid_bits(),
        asset.parameter_bits(),
        shape.width,
        shape.height,
        channels,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array2;

    fn map(name: &str, channels: Range<usize>, encoding: Encoding) -> MapChannels {
        MapChannels {
            name: name.to_owned(),
            channels,
            encoding,
        }
    }

    /// Two mips of a colour, a normal of two channels, and a height.
    fn set() -> (Vec<Array3<f32>>, [MapChannels; 3]) {
        let mip = |side: usize| {
            Array3::from_shape_fn((6, side, side), |(c, y, x)| {
                ((3 * c + 7 * y + 5 * x) % 16) as f32 / 20.0
            })
        };
        let maps = [
            map("color", 0..3, Encoding::Srgb),
            map("normal", 3..5, Encoding::NormalGl),
            map("height", 5..6, Encoding::Linear),
        ];
        (vec![mip(128), mip(64)], maps)
    }

    #[test]
    fn a_map_has_the_figures_that_its_encoding_asks_for() {
        let (a, maps) = set();
        let b: Vec<_> = a.iter().map(|mip| mip.mapv(|v| v * 0.95)).collect();
        let quality = Quality::measure(&a, &b, &maps).unwrap();
        let [color, normal, height] = &quality.maps[..] else {
            panic!("{:?}", quality.maps);
        };
        assert!(color.angles.is_none() && normal.perceptual.is_none());
        assert!(height.angles.is_none() && height.perceptual.is_none());
        let score = color.perceptual.as_ref().unwrap();
        assert!(score.mips[0].unwrap() < 100.0);
        assert_eq!(score.mips[1], None, "64 texels are too few");
        assert_eq!(score.overall, score.mips[0]);
        let angles = normal.angles.as_ref().unwrap();
        assert_eq!(angles.overall.vectors, 128 * 128 + 64 * 64);
        let means = [0, 1].map(|mip: usize| angles.mips[mip].mean.unwrap());
        assert!(means.iter().all(|mean| *mean > 0.0));
        assert_eq!(quality.sizes, [(128, 128), (64, 64)]);
        assert_eq!(quality.masked_share, None);
    }

    #[test]
    fn a_mask_of_everything_changes_nothing_but_the_perceptual_figures() {
        let (a, maps) = set();
        let b: Vec<_> = a.iter().map(|mip| mip.mapv(|v| v * 0.95)).collect();
        let all = Mask::new([128, 64].map(|s| Array2::from_elem((s, s), true)).into());
        let mut whole = Quality::measure(&a, &b, &maps).unwrap();
        let masked = Quality::measure_within(&a, &b, &maps, Some(&all)).unwrap();
        assert_eq!(masked.masked_share, Some(1.0));
        whole.masked_share = Some(1.0);
        whole.maps[0].perceptual = None;
        assert_eq!(masked, whole);
    }

    #[test]
    fn a_mip_that_the_mask_leaves_empty_has_no_figures_and_does_not_count() {
        let (a, maps) = set();
        let b: Vec<_> = a.iter().map(|mip| mip.mapv(|v| v * 0.95)).collect();
        let first = Mask::new(vec![
            Array2::from_elem((128, 128), true),
            Array2::from_elem((64, 64), false),
        ]);
        let masked = Quality::measure_within(&a, &b, &maps, Some(&first)).unwrap();
        let alone = Quality::measure(&a[..1], &b[..1], &maps).unwrap();
        assert!(masked.mips[1].psnr.is_nan() && masked.mips[1].ssim.is_nan());
        assert_eq!(masked.overall, alone.overall);
        let vectors = masked.maps[1].angles.as_ref().unwrap().overall.vectors;
        assert_eq!(vectors, 128 * 128);
    }
}
