//! Asset: one compressed texture set, validated.
//!
//! An [`Asset`] is the proof that its parts fit together; decoding one cannot fail.

use crate::check_layers::check_layers;
use crate::embed::MAX_OCTAVES;
use crate::error::AssetError;
use crate::layer::Layer;
use crate::limits;
use crate::profile::Profile;
use crate::shape::{LaneFormat, Shape};

/// How the channels of a map are to be understood by whoever shows it. The unit does not care.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Encoding {
    /// sRGB-encoded colour, trained and emitted as its stored codes.
    Srgb,
    /// Linear data.
    Linear,
    /// A tangent-space normal, green up (OpenGL).
    NormalGl,
    /// A tangent-space normal, green down (Direct3D).
    NormalDx,
}

impl Encoding {
    /// Every encoding, in the order of its code in a file.
    pub const ALL: [Encoding; 4] = [
        Encoding::Srgb,
        Encoding::Linear,
        Encoding::NormalGl,
        Encoding::NormalDx,
    ];

    /// The name in tables and JSON.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Encoding::Srgb => "srgb",
            Encoding::Linear => "linear",
            Encoding::NormalGl => "normal-gl",
            Encoding::NormalDx => "normal-dx",
        }
    }

    /// The code in a file.
    #[must_use]
    pub const fn code(self) -> u8 {
        self as u8
    }

    /// The encoding with this code, if there is one.
    #[must_use]
    pub fn from_code(code: u8) -> Option<Encoding> {
        Encoding::ALL.get(usize::from(code)).copied()
    }
}

/// One map of the set: a run of channels with a name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Map {
    /// `color`, `normal`, …; unique in the asset.
    pub name: String,
    /// The first of its channels.
    pub first_channel: u16,
    /// How many channels it has.
    pub channel_count: u16,
    /// How to understand them.
    pub encoding: Encoding,
    /// Bits of a channel in the source, for writing it back: 8, 16 or 32.
    pub bit_depth: u8,
}

/// What the decode does not need: names, and how the asset was made.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Metadata {
    /// The set's name.
    pub name: String,
    /// The maps, in channel order; together they hold every channel once.
    pub maps: Vec<Map>,
    /// The training record: key and value, in the trainer's order.
    pub record: Vec<(String, String)>,
}

/// The parts of an asset, unchecked.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Parts {
    /// Sizes and sampling.
    pub shape: Shape,
    /// Implementation-defined choices.
    pub profile: Profile,
    /// Codes of each grid: levels of rows of cells, cells of channels.
    pub grids: [Vec<u8>; 2],
    /// The synthesizer, first layer first.
    pub layers: Vec<Layer>,
    /// Names and training record.
    pub metadata: Metadata,
}

/// One compressed texture set, validated.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Asset {
    parts: Parts,
}

impl std::ops::Deref for Asset {
    type Target = Parts;

    fn deref(&self) -> &Parts {
        &self.parts
    }
}

impl Asset {
    /// The parts, checked against [`limits`] and against each other.
    ///
    /// # Errors
    /// The first field that is out of range or contradicts another.
    pub fn new(parts: Parts) -> Result<Asset, AssetError> {
        check_shape(&parts.shape)?;
        for (index, codes) in parts.grids.iter().enumerate() {
            check_grid(&parts.shape, index, codes)?;
        }
        check_profile(&parts.profile)?;
        check_layers(&parts)?;
        check_metadata(&parts)?;
        Ok(Asset { parts })
    }

    /// The parts, for building another asset from them.
    #[must_use]
    pub fn into_parts(self) -> Parts {
        self.parts
    }

    /// The codes of one cell of a level of a grid, one for each channel. Mip `m` reads those of level
    /// `pyramid.level_of(m)`.
    #[must_use]
    pub fn cell(&self, grid: usize, level: u8, x: u32, y: u32) -> &[u8] {
        let (width, _) = self.shape.level_size(grid, level);
        let channels = usize::from(self.shape.grids[grid].channels);
        let base = self.shape.level_base(grid, level) as usize;
        let start = base + (y as usize * width as usize + x as usize) * channels;
        &self.grids[grid][start..start + channels]
    }

    /// Bits of both grids' latents.
    #[must_use]
    pub fn grid_bits(&self) -> u64 {
        (0..2)
            .map(|g| self.shape.grid_latents(g) * u64::from(self.shape.grids[g].format.bits()))
            .sum()
    }

    /// Bits of the synthesizer's numbers as a unit stores them.
    #[must_use]
    pub fn parameter_bits(&self) -> u64 {
        let bias_bits = self.profile.bias_bits;
        self.layers
            .iter()
            .map(|l| l.parameter_bits(bias_bits))
            .sum()
    }

    /// What the register that a layer reads holds: the inputs', or that of the layer before.
    #[must_use]
    pub fn input_format(&self, layer: usize) -> LaneFormat {
        match layer.checked_sub(1) {
            None => self.shape.input_format(),
            Some(before) => self.layers[before].output_format(),
        }
    }

    /// The layer whose output a layer's skip path starts from.
    #[must_use]
    pub fn skip_source(&self, layer: usize) -> Option<usize> {
        let skip = self.layers[layer].skip?;
        layer.checked_sub(usize::from(skip.span))
    }

    /// Multiplications per texel.
    #[must_use]
    pub fn macs(&self) -> u32 {
        self.layers.iter().map(Layer::macs).sum()
    }
}

/// `found`, if it is in `low..=high`.
pub(crate) fn in_range<T: PartialOrd + std::fmt::Display>(
    field: impl Into<String>,
    found: T,
    low: T,
    high: T,
) -> Result<(), AssetError> {
    if found >= low && found <= high {
        Ok(())
    } else {
        Err(AssetError::field(field, found, format!("{low}..={high}")))
    }
}

pub(crate) fn check_shape(shape: &Shape) -> Result<(), AssetError> {
    in_range("shape.width", shape.width, 1, limits::MAX_SIZE)?;
    in_range("shape.height", shape.height, 1, limits::MAX_SIZE)?;
    let longest = Shape::max_mip_count(shape.width, shape.height);
    in_range("shape.mip_count", shape.mip_count, 1, longest)?;
    in_range("shape.octaves", shape.octaves, 0, MAX_OCTAVES)?;
    in_range("shape.padding", shape.padding, 0, limits::MAX_PADDING)?;
    let (low, high) = limits::LANE_BITS;
    in_range("shape.input_bits", shape.input_bits, low, high)?;
    in_range(
        "shape.channels",
        shape.outputs.len() as u64,
        1,
        u64::from(limits::MAX_CHANNELS),
    )?;
    for (index, grid) in shape.grids.iter().enumerate() {
        let field = |name: &str| format!("shape.grid{index}.{name}");
        in_range(
            field("channels"),
            grid.channels,
            1,
            limits::MAX_GRID_CHANNELS,
        )?;
        let (low, high) = limits::GRID_SCALE_LOG2;
        in_range(field("scale_log2"), grid.scale_log2, low, high)?;
    }
    in_range(
        "shape.inputs",
        shape.input_count(),
        1,
        u32::from(limits::MAX_LANES),
    )
}

pub(crate) fn check_profile(profile: &Profile) -> Result<(), AssetError> {
    match profile.out_of_range() {
        None => Ok(()),
        Some((field, found, low, high)) => in_range(format!("profile.{field}"), found, low, high),
    }
}

fn check_grid(shape: &Shape, index: usize, codes: &[u8]) -> Result<(), AssetError> {
    let expected = shape.grid_latents(index);
    if codes.len() as u64 != expected {
        return Err(AssetError::field(
            format!("grid{index}.latents"),
            codes.len(),
            expected,
        ));
    }
    let max = shape.grids[index].format.max_code();
    match codes.iter().position(|&code| code > max) {
        Some(at) => in_range(format!("grid{index}.code[{at}]"), codes[at], 0, max),
        None => Ok(()),
    }
}

fn check_metadata(parts: &Parts) -> Result<(), AssetError> {
    let metadata = &parts.metadata;
    let entries = u64::from(limits::MAX_ENTRIES);
    in_range("metadata.record", metadata.record.len() as u64, 0, entries)?;
    let texts = std::iter::once(&metadata.name)
        .chain(metadata.maps.iter().map(|m| &m.name))
        .chain(metadata.record.iter().flat_map(|(k, v)| [k, v]));
    for text in texts {
        in_range(
            "metadata.text_bytes",
            text.len() as u64,
            0,
            u64::from(limits::MAX_TEXT),
        )?;
    }
    let mut next = 0_u32;
    for (index, map) in metadata.maps.iter().enumerate() {
        let field = |name: &str| format!("metadata.map{index}.{name}");
        if u32::from(map.first_channel) != next || map.channel_count == 0 {
            let found = format!("{}+{}", map.first_channel, map.channel_count);
            let allowed = format!("a run of channels that starts at {next}");
            return Err(AssetError::field(field("channels"), found, allowed));
        }
        if ![8, 16, 32].contains(&map.bit_depth) {
            return Err(AssetError::field(
                field("bit_depth"),
                map.bit_depth,
                "8, 16 or 32",
            ));
        }
        // A name becomes a file name when the map is written out.
        let plain = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-' || c == '.';
        let named =
            !map.name.is_empty() && !map.name.starts_with('.') && map.name.chars().all(plain);
        if !named || map.name.len() > 64 {
            let allowed = "1 to 64 of A-Z a-z 0-9 _ - . that do not start with a point";
            return Err(AssetError::field(
                field("name"),
                format!("{:?}", map.name),
                allowed,
            ));
        }
        if metadata.maps[..index].iter().any(|m| m.name == map.name) {
            return Err(AssetError::field(
                field("name"),
                &map.name,
                "a name that no other map has",
            ));
        }
        next += u32::from(map.channel_count);
    }
    let channels = u32::from(parts.shape.channel_count());
    if next != channels {
        return Err(AssetError::field(
            "metadata.maps",
            format!("{next} channels"),
            channels,
        ));
    }
    Ok(())
}
