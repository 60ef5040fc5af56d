//! The limits that a validated asset obeys, in one table.

/// Texels along one axis of mip 0.
pub const MAX_SIZE: u32 = 16_384;
/// Mips of the longest chain, that of [`MAX_SIZE`] texels.
pub const MAX_MIPS: u8 = 15;
/// Levels of a grid, of which none serves fewer than one mip.
pub const MAX_LEVELS: u8 = MAX_MIPS;
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
/// 1024 products of an 8-bit weight and an 8-bit value stay below 2^24. Wider values, wide biases or
/// narrower accumulators can overflow; the profile says what happens then.
pub const MAX_LANES: u16 = 1024;
/// Layers of a synthesizer.
pub const MAX_LAYERS: u16 = 64;
/// Bits of a lane that holds an integer: inputs and activations.
pub const LANE_BITS: (u8, u8) = (4, 16);
/// log2 of the integer that stands for the real 1, where an fp16 layer gives integers.
pub const QUANTIZE_EXPONENT: (i8, i8) = (-16, 24);
/// Zeros after the last input.
pub const MAX_PADDING: u8 = 15;
/// Layers that a skip path may span.
pub const MAX_SKIP_SPAN: u8 = 3;
/// Bytes of one string of the metadata, and how many entries there may be.
pub const MAX_TEXT: u32 = 65_536;
/// Entries of the metadata's tables.
pub const MAX_ENTRIES: u16 = 1024;
/// Vector registers of a unit.
pub const VECTOR_REGISTERS: u16 = 4;
/// Runs of a loop's body.
pub const MAX_REPEATS: u16 = 64;
/// Instructions of a program, as stored.
pub const MAX_INSTRUCTIONS: u32 = 1024;
/// Instructions of a program, as executed: loops unrolled, the body of a footprint's loop once. The
/// compiler's longest program, 64 layers in a sample, has fewer than 300.
pub const MAX_STEPS: u32 = 4096;
/// Decodes of one sample, which bound a footprint's loop: sixteen probes of four texels in two mips.
pub const MAX_DECODES: u32 = 128;
