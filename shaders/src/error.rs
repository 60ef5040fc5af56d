//! What can go wrong between an asset and a device.

use std::fmt;

/// Why the twin gives no answer.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TwinError {
    /// No adapter that can run the shaders. Callers may show this as "skipped".
    #[error("no wgpu adapter: {wanted}; found: {}", Listed(.found))]
    NoAdapter {
        /// What was looked for, with the environment's restrictions.
        wanted: String,
        /// The adapters that are there and do not serve: name, backend and reason.
        found: Vec<String>,
    },
    /// The adapter gives no device.
    #[error("adapter {adapter}: no device: {reason}")]
    NoDevice {
        /// The adapter's name.
        adapter: String,
        /// The driver's words.
        reason: String,
    },
    /// A part of the asset is larger than the device can bind.
    #[error("{part}: {found} bytes; the adapter allows {allowed}")]
    TooLarge {
        /// `grid 0`, `weights`, ….
        part: String,
        /// Bytes that it needs.
        found: u64,
        /// Bytes that one binding may have.
        allowed: u64,
    },
    /// A request for a texel that does not exist.
    #[error("request {index}: texel ({}, {}) of mip {}; allowed: {allowed}", .found.0, .found.1, .found.2)]
    Request {
        /// The request, from 0.
        index: usize,
        /// x, y, mip.
        found: (u32, u32, u8),
        /// The mips, or the size of the mip.
        allowed: String,
    },
    /// The device refused or lost the work.
    #[error("the device failed in {during}: {reason}")]
    Device {
        /// What was being done.
        during: &'static str,
        /// The driver's or wgpu's words.
        reason: String,
    },
}

impl TwinError {
    /// Whether there is simply no device here, rather than something wrong with one.
    #[must_use]
    pub const fn is_no_adapter(&self) -> bool {
        matches!(self, TwinError::NoAdapter { .. })
    }
}

/// A list in a sentence.
struct Listed<'a>(&'a [String]);

impl fmt::Display for Listed<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0.is_empty() {
            f.write_str("none")
        } else {
            f.write_str(&self.0.join(", "))
        }
    }
}
