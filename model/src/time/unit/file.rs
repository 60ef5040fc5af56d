//! File: a unit as TOML, and changes to one on a command line.
//!
//! A file is `about`, and for each field a plain value or `{ value = …, why = "…" }`. With `base`
//! it may leave out what the base has; without, every field is there.

use super::configuration::field;
use super::consistent::idle;
use super::{Configuration, FIELDS, Field, Range, Unit, UnitError, Value};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use toml::Value as Toml;

const ENTRY: &str = "a value, or { value = …, why = \"…\" } with a reason that is not empty";

impl Unit {
    /// The unit in a file's text, under a name of the caller's.
    ///
    /// # Errors
    /// When a key is missing, unknown, of another kind or out of its range, when fields contradict
    /// each other, and when a field is changed that has no effect.
    pub fn from_toml(name: impl Into<String>, text: &str) -> Result<Unit, UnitError> {
        read(name.into(), text, Unit::by_name)
    }

    /// A file's text that must be complete, so that reading it reads no other.
    pub(in crate::time) fn from_complete_toml(name: &str, text: &str) -> Result<Unit, UnitError> {
        read(name.to_owned(), text, |_| {
            Err(UnitError::Entry {
                field: "base",
                found: "a base".to_owned(),
                allowed: "none in a preset",
            })
        })
    }

    /// The effective configuration with its reasons, as a complete file. [`Unit::from_toml`] makes
    /// the same unit of it.
    #[must_use]
    pub fn to_toml(&self) -> String {
        let quoted = |text: &str| Toml::String(text.to_owned()).to_string();
        let mut text = String::new();
        if !self.about().is_empty() {
            // Writing to a string cannot fail.
            let _ = writeln!(text, "about = {}", quoted(self.about()));
        }
        for (field, value) in self.fields() {
            let value = match value {
                Value::Number(number) => number.to_string(),
                Value::Choice(name) => quoted(name),
            };
            let _ = match self.reasons().get(field.name) {
                None => writeln!(text, "{} = {value}", field.name),
                Some(why) => {
                    let why = quoted(why);
                    writeln!(text, "{} = {{ value = {value}, why = {why} }}", field.name)
                }
            };
        }
        text
    }

    /// The same unit with some fields changed, each given by its name and its value as text. The
    /// changes become part of the name.
    ///
    /// # Errors
    /// As [`Unit::from_toml`]; also when a field is changed twice.
    pub fn with(&self, changes: &[(&str, &str)]) -> Result<Unit, UnitError> {
        if changes.is_empty() {
            return Ok(self.clone());
        }
        let mut configuration = *self.configuration();
        let mut changed: Vec<&'static Field> = Vec::new();
        for &(name, text) in changes {
            let field = field(name)?;
            if changed.contains(&field) {
                return Err(UnitError::Twice { field: field.name });
            }
            let value = match field.range {
                Range::Choice(_) => Toml::String(text.to_owned()),
                Range::Number { .. } => match text.parse() {
                    Ok(number) => Toml::Integer(number),
                    Err(_) => return Err(kind(field, &Toml::String(text.to_owned()))),
                },
            };
            set(&mut configuration, field, &value)?;
            changed.push(field);
        }
        let pairs: Vec<String> = changes.iter().map(|(n, v)| format!("{n} = {v}")).collect();
        super::consistent::check(&configuration)?;
        refuse_idle(&configuration, &changed)?;
        Ok(self.changed(&pairs.join(", "), configuration))
    }
}

fn read(
    name: String,
    text: &str,
    base: impl FnOnce(&str) -> Result<Unit, UnitError>,
) -> Result<Unit, UnitError> {
    let table: toml::Table = text
        .parse()
        .map_err(|error: toml::de::Error| UnitError::Syntax {
            found: error.to_string(),
        })?;
    let mut about = String::new();
    let mut on = None;
    let mut given: Vec<(&'static Field, &Toml, Option<&str>)> = Vec::new();
    for (key, value) in &table {
        match key.as_str() {
            "about" => about = text_of("about", value)?.to_owned(),
            "base" => on = Some(text_of("base", value)?),
            _ => given.push(entry(field(key)?, value)?),
        }
    }
    let mut unit = match on {
        Some(on) => base(on)?,
        None => nothing(&given)?,
    };
    for &(field, value, why) in &given {
        let before = unit.configuration.value(field);
        set(&mut unit.configuration, field, value)?;
        if let Some(why) = why {
            unit.reasons.insert(field.name, why.to_owned());
        } else if unit.configuration.value(field) != before {
            unit.reasons.remove(field.name);
        }
    }
    super::consistent::check(&unit.configuration)?;
    if on.is_some() {
        let fields: Vec<&'static Field> = given.iter().map(|(field, ..)| *field).collect();
        refuse_idle(&unit.configuration, &fields)?;
    }
    Ok(Unit {
        name,
        about,
        ..unit
    })
}

/// What a complete file starts from. Every value of it is replaced.
fn nothing(given: &[(&'static Field, &Toml, Option<&str>)]) -> Result<Unit, UnitError> {
    let is_given = |field: &Field| given.iter().any(|(f, ..)| f.name == field.name);
    let fields: Vec<&'static str> = FIELDS
        .iter()
        .filter(|field| !is_given(field))
        .map(|field| field.name)
        .collect();
    if !fields.is_empty() {
        return Err(UnitError::Missing { fields });
    }
    Ok(Unit {
        name: String::new(),
        about: String::new(),
        configuration: Configuration::LOWEST,
        reasons: BTreeMap::new(),
    })
}

/// A field's value and reason.
fn entry<'a>(
    field: &'static Field,
    value: &'a Toml,
) -> Result<(&'static Field, &'a Toml, Option<&'a str>), UnitError> {
    let refused = |found: String| {
        Err(UnitError::Entry {
            field: field.name,
            found,
            allowed: ENTRY,
        })
    };
    let Toml::Table(table) = value else {
        return Ok((field, value, None));
    };
    if let Some(key) = table
        .keys()
        .find(|key| !["value", "why"].contains(&&***key))
    {
        return refused(format!("the key {key:?}"));
    }
    match (table.get("value"), table.get("why")) {
        (Some(value), Some(Toml::String(why))) if !why.trim().is_empty() => {
            Ok((field, value, Some(why)))
        }
        (None, _) => refused("no value".to_owned()),
        (_, None) => refused("no why".to_owned()),
        (_, Some(why)) => refused(format!("why = {why}")),
    }
}

fn text_of<'a>(field: &'static str, value: &'a Toml) -> Result<&'a str, UnitError> {
    value.as_str().ok_or_else(|| UnitError::Entry {
        field,
        found: value.to_string(),
        allowed: "a text",
    })
}

fn kind(field: &'static Field, found: &Toml) -> UnitError {
    UnitError::Entry {
        field: field.name,
        found: found.to_string(),
        allowed: match field.range {
            Range::Number { .. } => "a whole number",
            Range::Choice(_) => "a text",
        },
    }
}

/// Puts a value into a field, if it is of its kind and in its range.
fn set(
    configuration: &mut Configuration,
    field: &'static Field,
    value: &Toml,
) -> Result<(), UnitError> {
    match (field.range, value) {
        (Range::Number { low, high }, &Toml::Integer(found)) => match u32::try_from(found) {
            Ok(number) if (low..=high).contains(&number) => configuration.set(field.name, number),
            Ok(_) | Err(_) => Err(UnitError::Range {
                field: field.name,
                found,
                low,
                high,
            }),
        },
        (Range::Choice(_), Toml::String(name)) => configuration.choose(field.name, name),
        (Range::Number { .. } | Range::Choice(_), found) => Err(kind(field, found)),
    }
}

/// A change that has no effect is a mistake: of the change, or of what it relies on.
fn refuse_idle(configuration: &Configuration, changed: &[&'static Field]) -> Result<(), UnitError> {
    for field in changed {
        if let (Some(because), Some(found)) =
            (idle(configuration, field.name), configuration.value(field))
        {
            return Err(UnitError::Idle {
                field: field.name,
                found,
                because,
            });
        }
    }
    Ok(())
}
