//! Asset: one compressed texture set, validated.
//!
//! An [`Asset`] is the proof that its parts fit together; decoding one cannot fail.

use crate::activation::{Activation, MAX_LEAK_SHIFT};
use crate::embed::MAX_OCTAVES;
use crate::error::AssetError;
use crate::layer::Layer;
use crate::limits;
use crate::profile::Profile;
use crate::shape::Shape;

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
    /// Codes of each grid: rows of cells, cells of channels.
    pub grids: [Vec<u8>; 2],
    /// Bits of a weight in the file, 2..=8.
    pub weight_bits: u8,
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
        check_layers(&parts)?;
        check_metadata(&parts)?;
        Ok(Asset { parts })
    }

    /// The parts, for building another asset from them.
    #[must_use]
    pub fn into_parts(self) -> Parts {
        self.parts
    }

    /// The codes of one cell of a grid, one for each channel.
    #[must_use]
    pub fn cell(&self, grid: usize, x: u32, y: u32) -> &[u8] {
        let (width, _) = self.shape.grid_size(grid);
        let channels = usize::from(self.shape.grids[grid].channels);
        let start = (y as usize * width as usize + x as usize) * channels;
        &self.grids[grid][start..start + channels]
    }

    /// Bits of both grids' latents.
    #[must_use]
    pub fn grid_bits(&self) -> u64 {
        (0..2)
            .map(|g| self.shape.grid_latents(g) * u64::from(self.shape.grids[g].format.bits()))
            .sum()
    }

    /// Bits of the synthesizer's parameters as a unit stores them: weights at their width, and for
    /// every row a 32-bit bias, a 31-bit mantissa and a 6-bit shift rounded up to 40 bits.
    #[must_use]
    pub fn parameter_bits(&self) -> u64 {
        self.layers
            .iter()
            .map(|l| {
                u64::from(l.macs()) * u64::from(self.weight_bits) + u64::from(l.outputs) * (32 + 40)
            })
            .sum()
    }

    /// Multiplications per texel.
    #[must_use]
    pub fn macs(&self) -> u32 {
        self.layers.iter().map(Layer::macs).sum()
    }
}

/// `found`, if it is in `low..=high`.
fn in_range<T: PartialOrd + std::fmt::Display>(
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

fn check_layers(parts: &Parts) -> Result<(), AssetError> {
    let (low, high) = limits::WEIGHT_BITS;
    in_range("weights.bits", parts.weight_bits, low, high)?;
    in_range(
        "weights.layers",
        parts.layers.len() as u64,
        1,
        u64::from(limits::MAX_LAYERS),
    )?;
    let mut lanes = parts.shape.input_count();
    for (index, layer) in parts.layers.iter().enumerate() {
        check_layer(parts, index, layer, lanes)?;
        lanes = u32::from(layer.outputs);
    }
    if lanes != u32::from(parts.shape.channel_count()) {
        let last = parts.layers.len() - 1;
        let channels = parts.shape.channel_count();
        return Err(AssetError::field(
            format!("weights.layer{last}.outputs"),
            lanes,
            format!("{channels}, the channels of the set"),
        ));
    }
    Ok(())
}

fn check_layer(parts: &Parts, index: usize, layer: &Layer, lanes: u32) -> Result<(), AssetError> {
    let field = |name: &str| format!("weights.layer{index}.{name}");
    let is_last = index + 1 == parts.layers.len();
    if u32::from(layer.inputs) != lanes {
        return Err(AssetError::field(
            field("inputs"),
            layer.inputs,
            format!("{lanes}, what the stage before it gives"),
        ));
    }
    in_range(field("outputs"), layer.outputs, 1, limits::MAX_LANES)?;
    let rows = usize::from(layer.outputs);
    for (name, found, expected) in [
        (
            "weights",
            layer.weights.len(),
            rows * usize::from(layer.inputs),
        ),
        ("bias", layer.bias.len(), rows),
        ("scales", layer.scales.len(), rows),
    ] {
        if found != expected {
            return Err(AssetError::field(field(name), found, expected));
        }
    }
    let largest = (1_i16 << (parts.weight_bits - 1)) - 1;
    for &weight in &layer.weights {
        in_range(field("weight"), i16::from(weight), -largest - 1, largest)?;
    }
    for &bias in &layer.bias {
        in_range(
            field("bias"),
            bias,
            1 - limits::BIAS_LIMIT,
            limits::BIAS_LIMIT - 1,
        )?;
    }
    if let Activation::Leaky { shift } = layer.activation {
        in_range(field("leak_shift"), shift, 1, MAX_LEAK_SHIFT)?;
    }
    if is_last {
        in_range(field("zero_point"), layer.zero_point, 0, 0)?;
        if layer.activation != Activation::Identity {
            let allowed = "identity, because it is the last layer";
            return Err(AssetError::field(
                field("activation"),
                layer.activation.name(),
                allowed,
            ));
        }
        if layer.skip.is_some() {
            return Err(AssetError::field(
                field("skip"),
                "a skip path",
                "none in the last layer",
            ));
        }
    } else {
        in_range(field("zero_point"), layer.zero_point, -128, 127)?;
    }
    if let Some(skip) = layer.skip {
        in_range(field("skip_span"), skip.span, 1, limits::MAX_SKIP_SPAN)?;
        // The path starts at the output of the layer `span` before this one: never at the inputs
        // of the synthesizer, which have another width and no scale of their own.
        let source = index
            .checked_sub(usize::from(skip.span))
            .map(|i| parts.layers[i].outputs);
        if source != Some(layer.outputs) {
            let found = source.map_or("no such layer".to_owned(), |o| format!("{o} outputs"));
            let allowed = format!("{} outputs, like the layer itself", layer.outputs);
            return Err(AssetError::field(field("skip_source"), found, allowed));
        }
    }
    Ok(())
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
