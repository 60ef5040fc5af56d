//! The units' cycles for the whole chain of an asset.

use serde::Serialize;

/// Cycles charged to one cause.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Charge {
    /// The cause, `compute`, `latent-miss`, …
    pub cause: String,
    /// Cycles of the unit.
    pub cycles: u64,
}

/// One unit with one layout, over every texel of every mip in texel-block order.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TimingRow {
    /// The unit's name.
    pub unit: String,
    /// The layout of the grids in memory.
    pub layout: String,
    /// Texels decoded.
    pub texels: u64,
    /// Cycles from the first request to the last channel.
    pub cycles: u64,
    /// Cycles per 4×4 texel block.
    pub cycles_per_block: f64,
    /// The closed form's lower bound, per block.
    pub closed_form_per_block: f64,
    /// Bytes from memory per block.
    pub bytes_per_block: f64,
    /// Cache hits over tag lookups, 0 to 1.
    pub hit_rate: f64,
    /// MACs done over MACs possible, 0 to 1.
    pub mac_utilisation: f64,
    /// At the unit's clock, in millions of texels per second.
    pub mtexels_per_second: f64,
    /// The resource that limits the unit.
    pub bottleneck: String,
    /// Where the cycles went; the sum is `cycles`.
    pub ledger: Vec<Charge>,
}
