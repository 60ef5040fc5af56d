//! Sampler: what a request by normalised coordinates means, to the bit.
//!
//! Coordinates and levels of detail enter as the *bits* of f32 numbers and are taken as the exact
//! numbers that they are; from there on everything is integers with one rounding at each named
//! point. Where Direct3D 11.3 (functional specification, section 7.18) says what happens, that
//! happens; where it allows a choice, the profile has it; where it is silent, the module says so.
//!
//! | module | answers |
//! |---|---|
//! | [`number`] | which number f32 bits are, and how an exact quotient is rounded once |
//! | [`coordinate`] | where on a mip a coordinate lies, and between which texels |
//! | [`address`] | which texel an index outside the mip means |
//! | [`lod`] | which mips, and how much of each |
//! | [`footprint`] | how many probes along which line, from gradients |
//! | [`plan`] | all of a request's texels with their weights; the stochastic choice of one |
//! | [`blend`] | how codes become one code |
//!
//! Channels are filtered as they are stored: the codes of an sRGB map are not made linear before the
//! filter, because the trainer and the asset know stored codes only. That differs from an sRGB view
//! in Direct3D; a caller who wants linear light decodes texels and filters them itself.

pub mod address;
pub mod blend;
pub mod coordinate;
pub mod footprint;
pub mod lod;
pub mod number;
pub mod plan;

pub use address::Address;
pub use footprint::Footprint;
pub use plan::{Detail, SampleRequest};

use crate::half::Half;
use crate::shape::{OutputFormat, Shape};
use std::fmt;

/// The filter inside a mip.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, serde::Serialize, serde::Deserialize,
)]
#[serde(rename_all = "kebab-case")]
pub enum Filter {
    /// One texel.
    Point,
    /// Among four texels, by the profile's filter rule.
    Linear,
}

/// The filter between mips.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, serde::Serialize, serde::Deserialize,
)]
#[serde(rename_all = "kebab-case")]
pub enum MipFilter {
    /// Mip 0, whatever the level of detail.
    Base,
    /// The nearest mip.
    Point,
    /// Between two mips; only one where the level of detail is a whole number.
    Linear,
}

/// What comes first: the synthesizer or the filter.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, serde::Serialize, serde::Deserialize,
)]
#[serde(rename_all = "kebab-case")]
pub enum Order {
    /// Every texel of the footprint is decoded, and their codes are filtered.
    DecodeThenFilter,
    /// Latents are interpolated at the sample's own place, and decoded once.
    FilterThenDecode,
}

/// How two mips are joined where the filter comes before the synthesizer.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, serde::Serialize, serde::Deserialize,
)]
#[serde(rename_all = "kebab-case")]
pub enum MipBlend {
    /// One decode in each mip; the codes are blended.
    Codes,
    /// One decode at the fractional level of detail.
    Level,
}

/// The state of a sampler: everything about a sample but its place and its level.
///
/// Levels are in 1/256. Keys that a file leaves out have the values of [`Sampler::default`].
#[derive(Clone, Debug, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Sampler {
    /// See [`Filter`].
    pub filter: Filter,
    /// See [`MipFilter`].
    pub mip_filter: MipFilter,
    /// Of u and of v.
    pub address: [Address; 2],
    /// One code a channel, in the channel's own format; empty where no axis has a border.
    pub border: Vec<i32>,
    /// Added to the texels' columns and rows: −8..=7.
    pub offset: [i8; 2],
    /// The smallest level of detail, 1/256; wins over `max_lod`.
    pub min_lod: u16,
    /// The largest level of detail, 1/256.
    pub max_lod: u16,
    /// Added to every level of detail, 1/256: −16 to 15.99.
    pub bias: i16,
    /// The most probes of a footprint, 1..=16; 1 is isotropic.
    pub max_anisotropy: u8,
    /// See [`Order`].
    pub order: Order,
    /// See [`MipBlend`]; `codes` unless the order is `filter-then-decode`.
    pub mip_blend: MipBlend,
    /// One texel of the footprint, chosen by random bits with its weight as probability.
    pub stochastic: bool,
}

/// The smallest and the largest texel offset (Direct3D 11.3, `TEXEL_OFFSET_MAX`).
pub const OFFSET: (i8, i8) = (-8, 7);
/// The smallest and the largest bias: −16, and 15.99 rounded down to 1/256.
pub const BIAS: (i16, i16) = (-4096, 4093);
/// The largest bound of a level of detail: 4.8 fixed point, beyond any chain.
pub const MAX_LOD: u16 = 4095;
/// The most probes of a footprint.
pub const MAX_PROBES: u8 = 16;
/// Fractional bits of the levels that a sampler holds.
pub const STATE_LOD_BITS: u32 = 8;

impl Default for Sampler {
    /// Trilinear, wrapped, isotropic, decode then filter.
    fn default() -> Sampler {
        Sampler {
            filter: Filter::Linear,
            mip_filter: MipFilter::Linear,
            address: [Address::Wrap; 2],
            border: Vec::new(),
            offset: [0; 2],
            min_lod: 0,
            max_lod: MAX_LOD,
            bias: 0,
            max_anisotropy: 1,
            order: Order::DecodeThenFilter,
            mip_blend: MipBlend::Codes,
            stochastic: false,
        }
    }
}

/// Why a sampler is refused.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SamplerError {
    /// A number outside its range.
    Range {
        /// The field.
        field: &'static str,
        /// What was found.
        found: i64,
        /// The smallest and the largest that is allowed.
        allowed: (i64, i64),
    },
    /// A border without a code for every channel.
    BorderLength {
        /// Codes found.
        found: usize,
        /// Channels of the texture set.
        allowed: usize,
    },
    /// A border code that its channel cannot have.
    BorderCode {
        /// The channel.
        channel: usize,
        /// The code.
        found: i32,
        /// The channel's format.
        allowed: OutputFormat,
    },
    /// Two choices that exclude each other.
    Conflict {
        /// The field, and its choice.
        found: &'static str,
        /// What that choice needs.
        allowed: &'static str,
    },
}

impl fmt::Display for SamplerError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            SamplerError::Range {
                field,
                found,
                allowed: (low, high),
            } => write!(f, "sampler.{field}: found {found}; allowed: {low}..={high}"),
            SamplerError::BorderLength { found, allowed } => write!(
                f,
                "sampler.border: found {found} codes; allowed: {allowed}, one a channel"
            ),
            SamplerError::BorderCode {
                channel,
                found,
                allowed,
            } => write!(
                f,
                "sampler.border[{channel}]: found {found}; allowed: a code of {}",
                allowed.name()
            ),
            SamplerError::Conflict { found, allowed } => {
                write!(f, "sampler: found {found}; allowed with: {allowed}")
            }
        }
    }
}

impl std::error::Error for SamplerError {}

impl Sampler {
    /// Whether the state can sample texture sets of this shape.
    ///
    /// # Errors
    /// When a number is outside its range, the border does not fit the channels, or two choices
    /// exclude each other.
    pub fn check(&self, shape: &Shape) -> Result<(), SamplerError> {
        let anisotropy = (1, i64::from(MAX_PROBES));
        let offset = (i64::from(OFFSET.0), i64::from(OFFSET.1));
        let bias = (i64::from(BIAS.0), i64::from(BIAS.1));
        let lod = (0, i64::from(MAX_LOD));
        let numbers = [
            ("offset.u", i64::from(self.offset[0]), offset),
            ("offset.v", i64::from(self.offset[1]), offset),
            ("min_lod", i64::from(self.min_lod), lod),
            ("max_lod", i64::from(self.max_lod), lod),
            ("bias", i64::from(self.bias), bias),
            ("max_anisotropy", i64::from(self.max_anisotropy), anisotropy),
        ];
        for (field, found, allowed) in numbers {
            if found < allowed.0 || found > allowed.1 {
                return Err(SamplerError::Range {
                    field,
                    found,
                    allowed,
                });
            }
        }
        self.check_border(shape)?;
        self.check_choices()
    }

    fn check_border(&self, shape: &Shape) -> Result<(), SamplerError> {
        if self.border.is_empty() && !self.has_border() {
            return Ok(());
        }
        if self.border.len() != shape.outputs.len() {
            return Err(SamplerError::BorderLength {
                found: self.border.len(),
                allowed: shape.outputs.len(),
            });
        }
        for (channel, (&found, &allowed)) in self.border.iter().zip(&shape.outputs).enumerate() {
            let (low, high) = allowed.range();
            let is_code = match allowed {
                OutputFormat::Float16 => {
                    (low..=high).contains(&found) && Half::from_bits(found as u16).is_finite()
                }
                OutputFormat::Unorm8 | OutputFormat::Unorm16 | OutputFormat::Snorm8 => {
                    (low..=high).contains(&found)
                }
            };
            if !is_code {
                return Err(SamplerError::BorderCode {
                    channel,
                    found,
                    allowed,
                });
            }
        }
        Ok(())
    }

    fn check_choices(&self) -> Result<(), SamplerError> {
        let conflict = |found, allowed| Err(SamplerError::Conflict { found, allowed });
        if self.max_anisotropy > 1 && self.filter == Filter::Point {
            return conflict("max_anisotropy above 1", "filter linear");
        }
        match self.order {
            Order::DecodeThenFilter => match self.mip_blend {
                MipBlend::Codes => Ok(()),
                MipBlend::Level => conflict("mip_blend level", "order filter-then-decode"),
            },
            // Point sampling has nothing to filter, and latents have no border.
            Order::FilterThenDecode if self.filter == Filter::Point => {
                conflict("order filter-then-decode", "filter linear")
            }
            Order::FilterThenDecode if self.has_border() => {
                conflict("order filter-then-decode", "no border on any axis")
            }
            Order::FilterThenDecode => Ok(()),
        }
    }

    fn has_border(&self) -> bool {
        self.address.contains(&Address::Border)
    }
}
