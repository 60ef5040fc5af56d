//! What is wrong with what is compared.

/// Why two sets cannot be compared.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MetricsError {
    /// The two arrays of one mip differ in shape.
    #[error("mip {mip}: found shape {found:?}, allowed is the reference's {allowed:?}")]
    Shape {
        /// The mip.
        mip: usize,
        /// Shape of the array under test: channels, rows, columns.
        found: (usize, usize, usize),
        /// Shape of the reference.
        allowed: (usize, usize, usize),
    },
    /// A mip was asked for that one of the sets lacks.
    #[error("mips: found {found}, allowed are 0 to {} (both sets have that many)", allowed.saturating_sub(1))]
    Mip {
        /// The mip asked for.
        found: usize,
        /// Number of mips both sets have.
        allowed: usize,
    },
    /// A channel was asked for that the sets lack.
    #[error("channels: found {found}, allowed is less than {allowed}")]
    Channel {
        /// The channel asked for.
        found: usize,
        /// Number of channels of the sets.
        allowed: usize,
    },
    /// No texel was selected.
    #[error("selection: found no texel, allowed is at least one channel of one mip")]
    Empty,
    /// A plane of the mask is not of its mip's size.
    #[error(
        "mask, mip {mip}: found {found:?} rows and columns, allowed are the reference's {allowed:?}"
    )]
    MaskShape {
        /// The mip.
        mip: usize,
        /// Rows and columns of the plane.
        found: (usize, usize),
        /// Rows and columns of the mip.
        allowed: (usize, usize),
    },
    /// The mask lacks a mip.
    #[error("mask: found {found} mips, allowed are at least {allowed}")]
    MaskMips {
        /// Mips of the mask.
        found: usize,
        /// Mips that are compared.
        allowed: usize,
    },
    /// Channels that are no normal.
    #[error("normal: found {found} channels, allowed are 2 (x, y) or 3 (x, y, z)")]
    Normal {
        /// How many were selected.
        found: usize,
    },
}
