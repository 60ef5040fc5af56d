//! Error: why something is no unit.

use super::{FIELDS, Value};
use std::fmt;

/// Why a configuration, or a text, is no unit.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum UnitError {
    /// A field is out of its range.
    Range {
        /// The field.
        field: &'static str,
        /// Its value.
        found: i64,
        /// The smallest value.
        low: u32,
        /// The largest value.
        high: u32,
    },
    /// A field is no power of two.
    PowerOfTwo {
        /// The field.
        field: &'static str,
        /// Its value.
        found: u32,
        /// Why it has to be; empty if it always has to.
        because: &'static str,
    },
    /// A field is no multiple of another.
    Multiple {
        /// The field.
        field: &'static str,
        /// Its value.
        found: u32,
        /// The other field.
        of: &'static str,
        /// The other's value.
        allowed: u32,
    },
    /// A queue cannot hold the smallest thing that enters it.
    Capacity {
        /// The field.
        field: &'static str,
        /// Its value.
        found: u32,
        /// What enters it.
        holds: &'static str,
        /// The smallest value.
        allowed: u32,
    },
    /// A field is more than another allows.
    Excess {
        /// The field.
        field: &'static str,
        /// Its value.
        found: u32,
        /// The largest value.
        allowed: u32,
        /// What allows no more.
        because: &'static str,
    },
    /// A field was changed that has no effect.
    Idle {
        /// The field.
        field: &'static str,
        /// Its new value.
        found: Value,
        /// Why it has none.
        because: &'static str,
    },
    /// A choice has no such name.
    Choice {
        /// The field.
        field: &'static str,
        /// The name found.
        found: String,
        /// The names that it has.
        allowed: &'static [&'static str],
    },
    /// No field has this name.
    Field {
        /// The name.
        found: String,
    },
    /// A field is changed twice.
    Twice {
        /// The field.
        field: &'static str,
    },
    /// A key holds something of another kind.
    Entry {
        /// The key.
        field: &'static str,
        /// What it holds.
        found: String,
        /// What it may hold.
        allowed: &'static str,
    },
    /// Fields are missing, and there is no base to take them from.
    Missing {
        /// Their names.
        fields: Vec<&'static str>,
    },
    /// A text is no TOML.
    Syntax {
        /// What the reader says, with the line.
        found: String,
    },
    /// No preset has this name.
    Preset {
        /// The name.
        found: String,
    },
}

impl fmt::Display for UnitError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            UnitError::Range {
                field,
                found,
                low,
                high,
            } => write!(f, "unit.{field}: found {found}; allowed: {low}..={high}"),
            UnitError::PowerOfTwo {
                field,
                found,
                because,
            } => write!(
                f,
                "unit.{field}: found {found}; allowed: a power of two{because}"
            ),
            UnitError::Multiple {
                field,
                found,
                of,
                allowed,
            } => write!(
                f,
                "unit.{field}: found {found}; allowed: a multiple of {allowed}, its {of}"
            ),
            UnitError::Capacity {
                field,
                found,
                holds,
                allowed,
            } => write!(
                f,
                "unit.{field}: found {found}; allowed: at least {allowed}, {holds}"
            ),
            UnitError::Excess {
                field,
                found,
                allowed,
                because,
            } => write!(
                f,
                "unit.{field}: found {found}; allowed: at most {allowed}, {because}"
            ),
            UnitError::Idle {
                field,
                found,
                because,
            } => write!(
                f,
                "unit.{field}: found {found}; allowed: no change, as {because} and so it has no effect"
            ),
            UnitError::Choice {
                field,
                found,
                allowed,
            } => {
                let names = allowed.join(", ");
                write!(f, "unit.{field}: found {found:?}; allowed: {names}")
            }
            UnitError::Field { found } => {
                let names: Vec<&str> = FIELDS.iter().map(|field| field.name).collect();
                write!(
                    f,
                    "unit field: found {found:?}; allowed: {}",
                    names.join(", ")
                )
            }
            UnitError::Twice { field } => {
                write!(f, "unit.{field}: found twice; allowed: once")
            }
            UnitError::Entry {
                field,
                found,
                allowed,
            } => write!(f, "unit.{field}: found {found}; allowed: {allowed}"),
            UnitError::Missing { fields } => write!(
                f,
                "unit: found no {}; allowed: every field, or a base that has them",
                fields.join(", ")
            ),
            UnitError::Syntax { found } => write!(f, "unit: no TOML: {}", found.trim_end()),
            UnitError::Preset { found } => {
                let names = crate::time::presets::NAMES.join(", ");
                write!(f, "unit: found {found:?}; allowed: {names}")
            }
        }
    }
}

impl std::error::Error for UnitError {}
