//! Packing: which channels of a set share an image, as a careful user would choose.
//!
//! - A channel that has one value throughout is not stored: a shader has it as a constant.
//! - A normal map is stored as X and Y where Z follows from them ([`super::normal`]); else whole.
//! - A map of three or four channels is an image of its own.
//! - `opacity` is the alpha of `color`, where the set has both. No other image has an alpha for its
//!   own sake.
//! - What is left, scalars, goes together or alone, as [`Scalars`] says.
//!
//! Codes are packed as they are stored. What is compared are codes, so nothing is linearised.

use super::normal;
use crate::texture_set::{Encoding, TextureSet};
use ndarray::{Array3, ArrayView3, Axis};
use serde::{Deserialize, Serialize};

/// What becomes of scalar maps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Scalars {
    /// Up to four in an image, as few images as can be, evenly filled.
    Together,
    /// Each in an image of its own.
    Alone,
}

/// What an image holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PackKind {
    /// X and Y of unit vectors.
    Normal,
    /// Anything else.
    Codes,
}

/// Channels of a set that are stored as one image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pack {
    /// The maps in it, joined by `+`.
    pub name: String,
    /// What it holds.
    pub kind: PackKind,
    /// Whether its colour codes are sRGB.
    pub is_srgb: bool,
    /// Whether a channel in it has more than 8 bits.
    pub is_deep: bool,
    /// The set's channels in the image's order, 1 to 4 of them.
    pub channels: Vec<usize>,
}

impl Pack {
    /// The pack in words.
    #[must_use]
    pub fn words(&self) -> String {
        let components = match (self.kind, self.channels.len()) {
            (PackKind::Normal, _) => "X and Y",
            (PackKind::Codes, 1) => "one channel",
            (PackKind::Codes, 2) => "two channels",
            (PackKind::Codes, 3) => "RGB",
            (PackKind::Codes, _) => "RGBA",
        };
        let encoding = if self.is_srgb { "sRGB" } else { "linear" };
        let depth = if self.is_deep {
            ", more than 8 bits"
        } else {
            ""
        };
        format!("{} as {components}, {encoding}{depth}", self.name)
    }

    /// The pack's image at a mip: its channels, in its order.
    #[must_use]
    pub fn image(&self, mip: ArrayView3<'_, f32>) -> Array3<f32> {
        mip.select(Axis(0), &self.channels)
    }
}

/// How every channel of a set comes about.
#[derive(Clone, Debug, PartialEq)]
pub struct Packing {
    /// The images stored.
    pub packs: Vec<Pack>,
    /// Channels with one value throughout, and the value.
    pub constants: Vec<(usize, f32)>,
    /// Channels made from two others: the third of a normal map, its first and its second.
    pub thirds: Vec<[usize; 3]>,
    /// Whether a channel has 8-bit codes.
    shallow: Vec<bool>,
}

impl Packing {
    /// The packing of a set.
    #[must_use]
    pub fn of(set: &TextureSet, scalars: Scalars) -> Packing {
        let mut packing = Packing {
            packs: Vec::new(),
            constants: constants(set),
            thirds: Vec::new(),
            shallow: Vec::new(),
        };
        let opacity = packing.opacity(set);
        // Scalars of each encoding, with the names of their maps.
        let mut loose: [Vec<(usize, &str)>; 2] = [Vec::new(), Vec::new()];
        for map in &set.maps {
            let is_shallow = map.bit_depth <= 8;
            packing
                .shallow
                .extend(std::iter::repeat_n(is_shallow, map.channel_count));
            let mut channels: Vec<usize> = map.channels().collect();
            channels.retain(|channel| packing.constants.iter().all(|(c, _)| c != channel));
            if channels.len() == 3 && normal::third_follows(set, map) {
                packing.thirds.push([channels[2], channels[0], channels[1]]);
                channels.pop();
            }
            let (kind, is_srgb) = match map.encoding {
                Encoding::NormalGl | Encoding::NormalDx if channels.len() == 2 => {
                    (PackKind::Normal, false)
                }
                Encoding::NormalGl | Encoding::NormalDx | Encoding::Linear => {
                    (PackKind::Codes, false)
                }
                Encoding::Srgb => (PackKind::Codes, true),
            };
            let mut name = map.name.clone();
            if map.name == "color" && channels.len() == 3 {
                if let Some(channel) = opacity {
                    channels.push(channel);
                    name.push_str("+opacity");
                }
            } else if Some(map.first_channel) == opacity {
                continue;
            }
            match (kind, channels.len()) {
                (_, 0) => {}
                (PackKind::Normal, _) | (PackKind::Codes, 3..) => packing.packs.push(Pack {
                    name,
                    kind,
                    is_srgb,
                    is_deep: false,
                    channels,
                }),
                (PackKind::Codes, _) => loose[usize::from(is_srgb)]
                    .extend(channels.into_iter().map(|c| (c, map.name.as_str()))),
            }
        }
        for (loose, is_srgb) in loose.iter().zip([false, true]) {
            packing.pack_scalars(loose, is_srgb, scalars);
        }
        for pack in &mut packing.packs {
            pack.is_deep = pack.channels.iter().any(|&c| !packing.shallow[c]);
        }
        packing
    }

    /// The channel that becomes the alpha of `color`.
    fn opacity(&self, set: &TextureSet) -> Option<usize> {
        let stored = |channel: &usize| self.constants.iter().all(|(c, _)| c != channel);
        let color = set.map("color").filter(|map| map.channel_count == 3)?;
        let opacity = set.map("opacity").filter(|map| map.channel_count == 1)?;
        let mut all = color.channels().chain(opacity.channels());
        all.all(|channel| stored(&channel))
            .then_some(opacity.first_channel)
    }

    fn pack_scalars(&mut self, loose: &[(usize, &str)], is_srgb: bool, scalars: Scalars) {
        let count = match scalars {
            Scalars::Together => loose.len().div_ceil(4),
            Scalars::Alone => loose.len(),
        };
        let mut rest = loose;
        for index in 0..count {
            let (these, after) = rest.split_at(rest.len().div_ceil(count - index));
            rest = after;
            let mut names: Vec<&str> = these.iter().map(|(_, name)| *name).collect();
            names.dedup();
            self.packs.push(Pack {
                name: names.join("+"),
                kind: PackKind::Codes,
                is_srgb,
                is_deep: false,
                channels: these.iter().map(|(channel, _)| *channel).collect(),
            });
        }
    }

    /// The set's channels at a mip from the packs' images, in the order of the packs. Channels with
    /// 8-bit codes get 8-bit codes, as they do from the neural decoder.
    ///
    /// # Panics
    /// When an image has fewer channels than its pack, or another size than the first. With no
    /// pack, `size` (rows, columns) is that of the mip.
    #[must_use]
    pub fn assemble(&self, images: &[Array3<f32>], size: (usize, usize)) -> Array3<f32> {
        let mut mip = Array3::zeros((self.shallow.len(), size.0, size.1));
        for (pack, image) in self.packs.iter().zip(images) {
            for (&channel, plane) in pack.channels.iter().zip(image.outer_iter()) {
                mip.index_axis_mut(Axis(0), channel).assign(&plane);
            }
        }
        for &(channel, value) in &self.constants {
            mip.index_axis_mut(Axis(0), channel).fill(value);
        }
        for &[third, x, y] in &self.thirds {
            let plane = normal::third(mip.index_axis(Axis(0), x), mip.index_axis(Axis(0), y));
            mip.index_axis_mut(Axis(0), third).assign(&plane);
        }
        for (mut plane, &is_shallow) in mip.outer_iter_mut().zip(&self.shallow) {
            if is_shallow {
                plane.mapv_inplace(|value| (value * 255.0).round() / 255.0);
            }
        }
        mip
    }

    /// Everything in words: the packs, then what is not stored.
    #[must_use]
    pub fn words(&self) -> Vec<String> {
        let mut words: Vec<String> = self.packs.iter().map(Pack::words).collect();
        let constants = self.constants.iter();
        words.extend(
            constants.map(|(channel, value)| {
                format!("channel {channel} not stored: {value} throughout")
            }),
        );
        words.extend(
            self.thirds
                .iter()
                .map(|[z, x, y]| format!("channel {z} not stored: Z of channels {x} and {y}")),
        );
        words
    }
}

/// Channels with one value throughout. A mip is a mean of the one before, so mip 0 tells.
fn constants(set: &TextureSet) -> Vec<(usize, f32)> {
    let Some(mip0) = set.texels.first() else {
        return Vec::new();
    };
    let mut constants = Vec::new();
    for (channel, plane) in mip0.outer_iter().enumerate() {
        if let Some(&first) = plane.first()
            && plane.iter().all(|&value| value == first)
        {
            constants.push((channel, first));
        }
    }
    constants
}
