//! Vector: the records of a vector file, format v2.
//!
//! Integers are JSON numbers, bytes are hexadecimal digits, enums are their names; there are no
//! floats. Unknown fields are refused. `schema/v2.json` says the same for other languages.

use crate::names;
use crate::stage::Taps;
use ntmu_isa::position::{AddressMode, CornerSnap};
use ntmu_isa::profile::Profile;
use ntmu_isa::rescale::Requantizer;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The schema of this version of the format.
pub const SCHEMA: &str = "ntmu-vectors/2";

/// One vector file: one suite.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VectorFile {
    /// [`SCHEMA`].
    pub schema: String,
    /// The suite's name; the file is `<suite>.json`.
    pub suite: String,
    /// What the suite is about, in one sentence.
    pub about: String,
    /// The version of the specification whose bits these are.
    pub isa: String,
    /// The version of the `.ntx` format, `major.minor`.
    pub format: String,
    /// Who wrote the file.
    pub generator: String,
    /// The profile of every case that names none of its own.
    pub profile: ProfileRecord,
    /// Every flag that a case has, explained.
    pub notes: BTreeMap<String, Note>,
    /// Assets that cases refer to by name.
    pub assets: Vec<AssetRecord>,
    /// How many cases follow.
    pub case_count: usize,
    /// The cases.
    pub cases: Vec<Case>,
}

/// What a flag means.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Note {
    /// The family of mistakes that it points at.
    pub kind: String,
    /// What a device that fails here is likely to do.
    pub description: String,
}

/// A profile: which one, and every choice by its name.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProfileRecord {
    /// Name and hash, see [`Profile::identity`].
    pub identity: String,
    /// The choices.
    pub choices: Profile,
}

impl From<Profile> for ProfileRecord {
    fn from(choices: Profile) -> ProfileRecord {
        ProfileRecord {
            identity: choices.identity(),
            choices,
        }
    }
}

/// An `.ntx` file that cases refer to.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AssetRecord {
    /// Its name in this file.
    pub name: String,
    /// What it is for.
    pub comment: String,
    /// Its profile, which is also in the file itself.
    pub profile: ProfileRecord,
    /// CRC-32 of the bytes, eight hexadecimal digits.
    pub crc32: String,
    /// The bytes.
    #[serde(with = "names::hex")]
    pub ntx: Vec<u8>,
}

/// One case.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Case {
    /// `<suite>-<hash of the request>`: the same request has the same id in every version.
    pub id: String,
    /// What is special here.
    pub comment: String,
    /// Why the case is here; every flag is explained in the file's notes.
    pub flags: Vec<String>,
    /// What the device is asked.
    pub request: Query,
    /// What it must do.
    pub result: Expectation,
    /// What it must answer; none where it must refuse.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub answer: Option<Answer>,
    /// Intermediate values on the way to the answer, to find where a device leaves it.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub taps: Taps,
}

/// What a device must do with a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Expectation {
    /// Give the answer, to the bit.
    Exact,
    /// Refuse, for whatever reason it states.
    Refuse,
}

/// What a device is asked.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Query {
    /// `value · mantissa / 2^shift` by a requantiser.
    Rescale(RescaleQuery),
    /// Where a texel lies in a grid, along one axis.
    Position(PositionQuery),
    /// The channel codes of a texel.
    Texel(TexelQuery),
    /// Whether bytes are an asset.
    Open(OpenQuery),
}

/// The operands of a rescaling.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RescaleQuery {
    /// The rule.
    #[serde(with = "names::requantizer")]
    pub requantizer: Requantizer,
    /// The accumulator.
    pub value: i32,
    /// 2^30..2^31.
    pub mantissa: i32,
    /// 2..=62.
    pub shift: u8,
}

/// A texel's coordinate along one axis, and the grid's size there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PositionQuery {
    /// Texel of the mip.
    pub texel: u32,
    /// Mip.
    pub mip: u8,
    /// log2 of mip 0's resolution over the grid's.
    pub scale_log2: u8,
    /// Where the first corner lies.
    #[serde(with = "names::snap")]
    pub snap: CornerSnap,
    /// What a corner outside the grid means.
    #[serde(with = "names::address_mode")]
    pub address_mode: AddressMode,
    /// Cells of the grid along this axis.
    pub cells: u32,
}

/// A texel of an asset.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TexelQuery {
    /// The asset, by its name in the file.
    pub asset: String,
    /// Texel along x.
    pub x: u32,
    /// Texel along y.
    pub y: u32,
    /// Mip.
    pub mip: u8,
}

/// Bytes that may be an asset.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OpenQuery {
    /// The bytes.
    #[serde(with = "names::hex")]
    pub ntx: Vec<u8>,
}

/// What a device must answer, or has answered.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Answer {
    /// To [`Query::Rescale`].
    Value(i32),
    /// To [`Query::Position`].
    Position(PositionAnswer),
    /// To [`Query::Texel`]: one code per channel.
    Channels(Vec<i32>),
    /// To [`Query::Open`]: true if the bytes are an asset.
    Accepted(bool),
}

/// One axis of the square of corners.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PositionAnswer {
    /// The first corner, in cells; may lie outside the grid.
    pub first: i32,
    /// From the first to the second corner, in cells.
    pub stride: u32,
    /// From the first towards the second corner, in sixteenths.
    pub phase: u16,
    /// The two corners as cells of the grid.
    pub corners: [u32; 2],
}
