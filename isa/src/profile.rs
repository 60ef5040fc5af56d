//! Profile: every choice that an implementation may make differently, as data.
//!
//! No mode is ambient: each is read from here. A profile is identified by the hash of its bytes in
//! a file; those in [`NAMED`] have a name too, and a file of their own under `profiles/`.

use crate::accumulate::{Accumulator, Overflow};
use crate::filter::FilterRule;
use crate::half::SumOrder;
use crate::rescale::Requantizer;
use crate::round::Rounding;
use sha2::{Digest, Sha256};
use std::fmt;

/// Where a point sample lies between two texels.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, serde::Serialize, serde::Deserialize,
)]
#[serde(rename_all = "kebab-case")]
pub enum PointSnap {
    /// The texel of the rounded fixed-point coordinate. Direct3D, AMD, Intel.
    Fixed,
    /// The texel of the coordinate before it is rounded. The Vulkan text, NVIDIA.
    Floor,
}

impl PointSnap {
    /// Every choice, in the order of its code in a file.
    pub const ALL: [PointSnap; 2] = [PointSnap::Fixed, PointSnap::Floor];

    /// The name in tables and profiles.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            PointSnap::Fixed => "fixed",
            PointSnap::Floor => "floor",
        }
    }

    /// The code in a file.
    #[must_use]
    pub const fn code(self) -> u8 {
        self as u8
    }

    /// The choice with this code, if there is one.
    #[must_use]
    pub fn from_code(code: u8) -> Option<PointSnap> {
        PointSnap::ALL.get(usize::from(code)).copied()
    }
}

/// The choices, in the order of the texel's journey.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Profile {
    /// Fractional bits of a texture coordinate in texels, and of a filter's weights: 4..=12.
    pub subtexel_bits: u8,
    /// Fractional bits of a level of detail, and of the weight between two mips: 4..=8.
    pub lod_bits: u8,
    /// A coordinate or a level of detail, from its f32 to fixed point.
    pub coordinate: Rounding,
    /// Which texel a point sample takes.
    pub point_snap: PointSnap,
    /// The filter over decoded texels.
    pub filter: FilterRule,
    /// The filter's final rounding to a channel code, and those between its steps.
    pub filter_rounding: Rounding,
    /// The interpolation of a grid's corners.
    pub interpolate: FilterRule,
    /// The input quantiser: interpolated latents, and corners that have more bits than an input.
    pub input: Rounding,
    /// The accumulators of integer layers.
    pub accumulator: Accumulator,
    /// Bits of a bias of an integer layer, 8..=32: a wider one is refused.
    pub bias_bits: u8,
    /// The negative side of a leaky ReLU of an integer layer.
    pub leak: Rounding,
    /// Accumulator to activation, in every hidden integer layer; both steps of a hard GELU.
    pub requantize: Requantizer,
    /// The rescaling of an integer skip path.
    pub skip: Requantizer,
    /// Bits of a rescaled skip term, 8..=32: a larger one saturates before it is added.
    pub residual_bits: u8,
    /// Accumulator of an integer layer to channel code.
    pub output: Requantizer,
    /// How an fp16 layer sums.
    pub sum: SumOrder,
    /// f32 sum of an fp16 layer to an integer: activations of the next layer, channel codes.
    pub convert: Rounding,
}

/// Ranges of the profile's numbers: name, smallest, largest.
const RANGES: [(&str, u8, u8); 5] = [
    ("subtexel_bits", 4, 12),
    ("lod_bits", 4, 8),
    ("accumulator.bits", 16, 32),
    ("bias_bits", 8, 32),
    ("residual_bits", 8, 32),
];

/// Bytes of a profile in a file.
pub const PROFILE_BYTES: usize = 24;

impl Profile {
    /// The normative choices: one rounding wherever there can be one, ties up as TOSA has them,
    /// coordinates as Direct3D 11.3 has them.
    pub const NORMATIVE: Profile = Profile {
        subtexel_bits: 8,
        lod_bits: 8,
        coordinate: Rounding::HalfEven,
        point_snap: PointSnap::Fixed,
        filter: FilterRule::Exact,
        filter_rounding: Rounding::HalfUp,
        interpolate: FilterRule::Exact,
        input: Rounding::HalfUp,
        accumulator: Accumulator {
            bits: 32,
            overflow: Overflow::Wrap,
        },
        bias_bits: 32,
        leak: Rounding::HalfUp,
        requantize: Requantizer::Single,
        skip: Requantizer::Single,
        residual_bits: 32,
        output: Requantizer::Single,
        sum: SumOrder::Sequential,
        convert: Rounding::HalfEven,
    };

    /// The first number outside its range: its name, what was found, smallest and largest allowed.
    #[must_use]
    pub fn out_of_range(&self) -> Option<(&'static str, u8, u8, u8)> {
        let found = [
            self.subtexel_bits,
            self.lod_bits,
            self.accumulator.bits,
            self.bias_bits,
            self.residual_bits,
        ];
        RANGES
            .into_iter()
            .zip(found)
            .find(|((_, low, high), found)| found < low || found > high)
            .map(|((name, low, high), found)| (name, found, low, high))
    }

    /// The profile as a file holds it: one byte a choice, in the order of the fields, then zeros.
    #[must_use]
    pub fn to_bytes(&self) -> [u8; PROFILE_BYTES] {
        let choices = [
            self.subtexel_bits,
            self.lod_bits,
            self.coordinate.code(),
            self.point_snap.code(),
            self.filter.code(),
            self.filter_rounding.code(),
            self.interpolate.code(),
            self.input.code(),
            self.accumulator.bits,
            self.accumulator.overflow.code(),
            self.bias_bits,
            self.leak.code(),
            self.requantize.code(),
            self.skip.code(),
            self.residual_bits,
            self.output.code(),
            self.sum.code(),
            self.convert.code(),
        ];
        let mut bytes = [0; PROFILE_BYTES];
        bytes[..choices.len()].copy_from_slice(&choices);
        bytes
    }

    /// The first eight bytes of the SHA-256 of [`Profile::to_bytes`], in hexadecimal.
    #[must_use]
    pub fn hash(&self) -> String {
        let digest = Sha256::digest(self.to_bytes());
        digest[..8]
            .iter()
            .map(|byte| format!("{byte:02x}"))
            .collect()
    }

    /// The name, if it is one of [`NAMED`]; `custom` otherwise.
    #[must_use]
    pub fn name(&self) -> &'static str {
        NAMED
            .iter()
            .find(|(_, text)| NamedProfile::from_toml(text).is_ok_and(|n| n.profile == *self))
            .map_or("custom", |(name, _)| name)
    }

    /// Name and hash, `nt-d3d11@0123456789abcdef`: what every result prints.
    #[must_use]
    pub fn identity(&self) -> String {
        format!("{}@{}", self.name(), self.hash())
    }
}

impl Default for Profile {
    fn default() -> Profile {
        Profile::NORMATIVE
    }
}

/// A profile with a name: one file.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NamedProfile {
    /// Lower-case letters, digits, `-` and `.`.
    pub name: String,
    /// One line on what it stands for.
    pub about: String,
    /// Where the choices were found.
    pub source: String,
    /// The choices.
    pub profile: Profile,
}

/// Why a text is no profile.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ProfileError {
    /// No profile in TOML: an unknown or a missing key, or an unknown choice.
    Syntax {
        /// What the reader says, with the line.
        found: String,
    },
    /// A number outside its range.
    Range {
        /// The number.
        field: &'static str,
        /// What was found.
        found: u8,
        /// The smallest and the largest that is allowed.
        allowed: (u8, u8),
    },
    /// A name that no built-in profile has.
    Unknown {
        /// The name.
        found: String,
    },
}

impl fmt::Display for ProfileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ProfileError::Syntax { found } => write!(f, "no profile: {}", found.trim_end()),
            ProfileError::Range {
                field,
                found,
                allowed: (low, high),
            } => write!(f, "profile.{field}: found {found}; allowed: {low}..={high}"),
            ProfileError::Unknown { found } => {
                let names: Vec<&str> = NAMED.iter().map(|(name, _)| *name).collect();
                write!(f, "profile {found:?}; allowed: {}", names.join(", "))
            }
        }
    }
}

impl std::error::Error for ProfileError {}

impl NamedProfile {
    /// The profile in a file's text. Every choice must be there and no other key.
    ///
    /// # Errors
    /// When a key is missing, unknown or outside what it may hold.
    pub fn from_toml(text: &str) -> Result<NamedProfile, ProfileError> {
        let named: NamedProfile = toml::from_str(text).map_err(|error| ProfileError::Syntax {
            found: error.to_string(),
        })?;
        match named.profile.out_of_range() {
            None => Ok(named),
            Some((field, found, low, high)) => Err(ProfileError::Range {
                field,
                found,
                allowed: (low, high),
            }),
        }
    }

    /// The built-in profile with this name.
    ///
    /// # Errors
    /// When there is none.
    pub fn named(name: &str) -> Result<NamedProfile, ProfileError> {
        let unknown = || ProfileError::Unknown {
            found: name.to_owned(),
        };
        let (_, text) = NAMED.iter().find(|(n, _)| *n == name).ok_or_else(unknown)?;
        NamedProfile::from_toml(text)
    }

    /// Every built-in profile, the normative one first.
    ///
    /// # Errors
    /// Never, as a test shows; the files are read like any other.
    pub fn all() -> Result<Vec<NamedProfile>, ProfileError> {
        NAMED
            .iter()
            .map(|(_, text)| NamedProfile::from_toml(text))
            .collect()
    }
}

macro_rules! named {
    ($($name:literal),* $(,)?) => {
        &[$(($name, include_str!(concat!("../../profiles/", $name, ".toml")))),*]
    };
}

/// The built-in profiles: name, and text of the file. The first is [`Profile::NORMATIVE`].
pub const NAMED: &[(&str, &str)] = named![
    "nt-d3d11",
    "gemmlowp",
    "half-even",
    "half-away",
    "narrow-multiplier",
    "nvidia-filter",
    "separable-filter",
    "all-ones-filter",
    "point-floor",
    "vulkan-minimum",
    "vulkan-1.4",
    "subtexel-12",
    "fp16-sum",
    "tree-4",
    "tree-8",
    "accumulator-24",
];

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn every_named_profile_is_read_is_distinct_and_bears_its_files_name() {
        let mut hashes = BTreeSet::new();
        for ((name, _), named) in NAMED.iter().zip(NamedProfile::all().unwrap()) {
            assert_eq!(named.name, *name);
            assert_eq!(named.profile.name(), *name);
            assert!(hashes.insert(named.profile.hash()), "{name}");
            let text = toml::to_string(&named).unwrap();
            assert_eq!(NamedProfile::from_toml(&text), Ok(named));
        }
        assert_eq!(
            NamedProfile::named(NAMED[0].0).unwrap().profile,
            Profile::NORMATIVE
        );
    }

    #[test]
    fn no_file_of_the_folder_is_left_out() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../profiles");
        let files: BTreeSet<String> = std::fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        let named = NAMED
            .iter()
            .map(|(name, _)| format!("{name}.toml"))
            .collect();
        assert_eq!(files, named);
    }

    #[test]
    fn unknown_missing_and_contradictory_keys_are_refused() {
        let text = NAMED[0].1;
        let refused = |from: &str, to: &str| {
            assert!(text.contains(from), "{from}");
            NamedProfile::from_toml(&text.replacen(from, to, 1))
                .unwrap_err()
                .to_string()
        };
        assert!(refused("lod_bits = 8", "").contains("lod_bits"));
        assert!(refused("lod_bits = 8", "lod_bits = 8\nlod = 1").contains("lod"));
        assert!(refused("\"half-even\"", "\"nearest\"").contains("half-up"));
        assert_eq!(
            refused("subtexel_bits = 8", "subtexel_bits = 13"),
            "profile.subtexel_bits: found 13; allowed: 4..=12"
        );
        assert!(
            NamedProfile::named("d3d")
                .unwrap_err()
                .to_string()
                .contains("nt-d3d11")
        );
    }

    #[test]
    fn every_choice_reaches_the_hash() {
        let base = Profile::NORMATIVE;
        let changed = [
            Profile {
                subtexel_bits: 9,
                ..base
            },
            Profile {
                lod_bits: 7,
                ..base
            },
            Profile {
                coordinate: Rounding::Floor,
                ..base
            },
            Profile {
                point_snap: PointSnap::Floor,
                ..base
            },
            Profile {
                filter: FilterRule::Factored,
                ..base
            },
            Profile {
                filter_rounding: Rounding::Floor,
                ..base
            },
            Profile {
                interpolate: FilterRule::Factored,
                ..base
            },
            Profile {
                input: Rounding::Floor,
                ..base
            },
            Profile {
                accumulator: Accumulator {
                    bits: 31,
                    ..base.accumulator
                },
                ..base
            },
            Profile {
                accumulator: Accumulator {
                    overflow: Overflow::Saturate,
                    ..base.accumulator
                },
                ..base
            },
            Profile {
                bias_bits: 31,
                ..base
            },
            Profile {
                leak: Rounding::Floor,
                ..base
            },
            Profile {
                requantize: Requantizer::Double,
                ..base
            },
            Profile {
                skip: Requantizer::Double,
                ..base
            },
            Profile {
                residual_bits: 31,
                ..base
            },
            Profile {
                output: Requantizer::Double,
                ..base
            },
            Profile {
                sum: SumOrder::Tree4,
                ..base
            },
            Profile {
                convert: Rounding::Floor,
                ..base
            },
        ];
        let hashes: BTreeSet<String> = changed.iter().chain([&base]).map(Profile::hash).collect();
        assert_eq!(hashes.len(), changed.len() + 1);
    }
}
