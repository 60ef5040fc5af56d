//! What is refused when bytes or parts become an [`Asset`](crate::Asset).

use std::fmt;

/// Where, what was found, what is allowed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum AssetError {
    /// The bytes end too early.
    Truncated {
        /// The part of the file being read.
        section: &'static str,
        /// Bytes that the part needs.
        needed: u64,
        /// Bytes that are there.
        found: u64,
    },
    /// The first bytes are those of another format.
    Foreign {
        /// The first eight bytes (fewer in a shorter file).
        found: Vec<u8>,
        /// Those of an `.ntx` file.
        allowed: [u8; 8],
    },
    /// A version that this reader does not know.
    Version {
        /// Major and minor of the file.
        found: (u16, u16),
        /// Major, and the largest minor, of this reader.
        allowed: (u16, u16),
    },
    /// The bytes of a part are not those that were written.
    Checksum {
        /// The part.
        section: String,
        /// The CRC-32 that the file states.
        stated: u32,
        /// The CRC-32 of the bytes.
        computed: u32,
    },
    /// The table of sections does not describe the file.
    Table {
        /// The section concerned.
        section: String,
        /// What was found there.
        found: String,
        /// What is allowed there.
        allowed: String,
    },
    /// A field holds a value outside its range, or one that contradicts another field.
    Field {
        /// The section and field, `shape.width`.
        field: String,
        /// What was found.
        found: String,
        /// What is allowed.
        allowed: String,
    },
}

impl AssetError {
    pub(crate) fn field(
        field: impl Into<String>,
        found: impl fmt::Display,
        allowed: impl fmt::Display,
    ) -> AssetError {
        AssetError::Field {
            field: field.into(),
            found: found.to_string(),
            allowed: allowed.to_string(),
        }
    }
}

impl fmt::Display for AssetError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            AssetError::Truncated {
                section,
                needed,
                found,
            } => {
                write!(
                    f,
                    "{section}: ends after {found} bytes; {needed} are needed"
                )
            }
            AssetError::Foreign { found, allowed } => {
                write!(
                    f,
                    "not an .ntx file: it starts with {found:02x?}; allowed: {allowed:02x?}"
                )
            }
            AssetError::Version { found, allowed } => write!(
                f,
                "version {}.{}: this reader accepts {}.0 to {}.{}",
                found.0, found.1, allowed.0, allowed.0, allowed.1
            ),
            AssetError::Checksum {
                section,
                stated,
                computed,
            } => write!(
                f,
                "{section}: damaged: its CRC-32 is {computed:08x} and the file states {stated:08x}"
            ),
            AssetError::Table {
                section,
                found,
                allowed,
            } => {
                write!(f, "section {section}: found {found}; allowed: {allowed}")
            }
            AssetError::Field {
                field,
                found,
                allowed,
            } => {
                write!(f, "{field}: found {found}; allowed: {allowed}")
            }
        }
    }
}

impl std::error::Error for AssetError {}
