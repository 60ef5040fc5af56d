//! The model against its GPU twin.

use serde::Serialize;

/// What came of running the twin.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "status", rename_all = "kebab-case")]
pub enum TwinStudy {
    /// It ran.
    Ran {
        /// The adapter's name and driver.
        adapter: String,
        /// Codes compared.
        codes: u64,
        /// Codes that differ.
        differing: u64,
        /// The first that differs: mip, channel, row, column, the model's code, the twin's.
        first: Option<(u8, usize, usize, usize, i32, i32)>,
    },
    /// It did not run, and why.
    Skipped {
        /// Why.
        reason: String,
    },
}

impl TwinStudy {
    /// No code differs, as far as the twin ran.
    #[must_use]
    pub fn holds(&self) -> bool {
        match self {
            TwinStudy::Ran { differing, .. } => *differing == 0,
            TwinStudy::Skipped { .. } => true,
        }
    }
}
