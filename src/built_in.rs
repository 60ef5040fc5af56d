//! The built-in asset and its source: what `ntmu study` uses when it is given nothing.

use crate::brick_wall;
use crate::texture_set::TextureSet;
use ntmu_isa::{Asset, AssetError};

/// Texels along an axis of the built-in set.
pub const SIZE: u32 = 256;
/// The seed of the built-in set.
pub const SEED: u64 = 1;

/// The `.ntx` file, as committed. Remade by
/// `cargo run --release --features train -- encode --built-in --preset hw-64 --grids 16,32
/// --effort thorough -o assets/brick_wall.ntx`.
pub const BYTES: &[u8] = include_bytes!("../assets/brick_wall.ntx");

/// The built-in asset.
///
/// # Errors
/// When the committed file is damaged.
pub fn asset() -> Result<Asset, AssetError> {
    Asset::from_bytes(BYTES)
}

/// The texture set from which the built-in asset was trained.
#[must_use]
pub fn source() -> TextureSet {
    brick_wall::generate(SIZE, SEED)
}
