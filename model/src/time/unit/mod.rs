//! Unit: one hardware configuration, as data.
//!
//! A [`Configuration`] is a table of numbers and choices; a [`Unit`] is the proof that one can be
//! built. The presets are the files of `units/`, and anybody's file is read like them.

mod bracket;
mod configuration;
mod consistent;
mod error;
mod file;
mod identity;
#[cfg(test)]
mod tests;

pub use configuration::{Configuration, FIELDS, Field, Range, Value};
pub use error::UnitError;
pub(super) use identity::hexadecimal;

use std::collections::BTreeMap;
use std::fmt;

/// One hardware configuration, validated. Its fields are read through it: `unit.mac_rows`.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Unit {
    name: String,
    about: String,
    configuration: Configuration,
    reasons: BTreeMap<&'static str, String>,
}

impl std::ops::Deref for Unit {
    type Target = Configuration;

    fn deref(&self) -> &Configuration {
        &self.configuration
    }
}

impl Unit {
    /// The configuration, checked. It gives no reasons.
    ///
    /// # Errors
    /// The first field that is out of range or contradicts another.
    pub fn new(name: impl Into<String>, configuration: Configuration) -> Result<Unit, UnitError> {
        consistent::check(&configuration)?;
        Ok(Unit {
            name: name.into(),
            about: String::new(),
            configuration,
            reasons: BTreeMap::new(),
        })
    }

    /// Its name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// What it stands for, in a line; empty if nobody said.
    #[must_use]
    pub fn about(&self) -> &str {
        &self.about
    }

    /// Its numbers, for building another unit from them.
    #[must_use]
    pub fn configuration(&self) -> &Configuration {
        &self.configuration
    }

    /// Why its fields have their values, as far as its file says so. A preset gives a reason for
    /// every field. A reason stays with its value: a changed field has lost it.
    #[must_use]
    pub fn reasons(&self) -> &BTreeMap<&'static str, String> {
        &self.reasons
    }

    /// The same unit with another configuration, and the reasons of what stayed.
    fn changed(&self, change: &str, configuration: Configuration) -> Unit {
        let mut reasons = self.reasons.clone();
        for (before, after) in self.fields().into_iter().zip(configuration.fields()) {
            if before != after {
                reasons.remove(before.0.name);
            }
        }
        Unit {
            name: format!("{}, {change}", self.name),
            about: String::new(),
            configuration,
            reasons,
        }
    }
}

impl fmt::Display for Unit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", self.name)?;
        for (field, value) in self.fields() {
            writeln!(f, "  {:<28} {value:>10} {}", field.name, field.unit)?;
        }
        Ok(())
    }
}
