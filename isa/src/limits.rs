//! The limits that a validated asset obeys, in one table.

/// Texels along one axis of mip 0.
pub const MAX_SIZE: u32 = 16_384;
/// Channels of a texture set.
pub const MAX_CHANNELS: u16 = 16;
/// Channels of one grid.
pub const MAX_GRID_CHANNELS: u16 = 128;
/// log2 of the ratio between the resolutions of mip 0 and of a grid: 1..=3.
pub const GRID_SCALE_LOG2: (u8, u8) = (1, 3);
/// Bits of a latent: 1..=8.
pub const LATENT_BITS: (u8, u8) = (1, 8);
/// Bits of a weight: 2..=8.
pub const WEIGHT_BITS: (u8, u8) = (2, 8);
/// Lanes of a vector register: inputs or outputs of a layer.
///
/// 1024 products of two 8-bit values stay below 2^24, so with a bias below 2^30 no accumulator
/// can leave 31 bits: overflow is impossible, not merely undefined.
pub const MAX_LANES: u16 = 1024;
/// Layers of a synthesizer.
pub const MAX_LAYERS: u16 = 64;
/// Magnitude of a bias, exclusive.
pub const BIAS_LIMIT: i32 = 1 << 30;
/// Layers that a skip path may span.
pub const MAX_SKIP_SPAN: u8 = 3;
/// Bytes of one string of the metadata, and how many entries there may be.
pub const MAX_TEXT: u32 = 65_536;
/// Entries of the metadata's tables.
pub const MAX_ENTRIES: u16 = 1024;
