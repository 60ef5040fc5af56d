//! Presets: three units worth comparing, the files of `units/`.
//!
//! No product is described. Published numbers are used where there are some; the rest is chosen, by
//! a rule each. Either stands beside its number in the file: [`Unit::reasons`].

use super::unit::{Unit, UnitError};
use std::sync::LazyLock;

/// The names of the presets, smallest unit first.
pub const NAMES: [&str; 3] = ["mobile", "console", "desktop"];

/// Their files.
const FILES: [&str; 3] = [
    include_str!("../../../units/mobile.toml"),
    include_str!("../../../units/console.toml"),
    include_str!("../../../units/desktop.toml"),
];

static UNITS: LazyLock<[Unit; 3]> = LazyLock::new(|| [0, 1, 2].map(read));

fn read(index: usize) -> Unit {
    match Unit::from_complete_toml(NAMES[index], FILES[index]) {
        Ok(unit) => unit,
        // The files are part of the program, and a test reads each.
        Err(error) => unreachable!("units/{}.toml: {error}", NAMES[index]),
    }
}

impl Unit {
    /// A small unit: 256 multiplications a cycle, 8 KiB of latents.
    #[must_use]
    pub fn mobile() -> Unit {
        UNITS[0].clone()
    }

    /// A middle unit: 1024 multiplications a cycle, 16 KiB of latents.
    #[must_use]
    pub fn console() -> Unit {
        UNITS[1].clone()
    }

    /// A large unit: 4096 multiplications a cycle, 128 KiB of latents and a second level behind
    /// them.
    #[must_use]
    pub fn desktop() -> Unit {
        UNITS[2].clone()
    }

    /// The presets, smallest first.
    #[must_use]
    pub fn presets() -> [Unit; 3] {
        UNITS.clone()
    }

    /// The names of the presets, smallest unit first.
    #[must_use]
    pub fn names() -> &'static [&'static str] {
        &NAMES
    }

    /// The preset with this name.
    ///
    /// # Errors
    /// When there is none.
    pub fn by_name(name: &str) -> Result<Unit, UnitError> {
        let found = UNITS.iter().find(|unit| unit.name() == name);
        found.cloned().ok_or_else(|| UnitError::Preset {
            found: name.to_owned(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::unit::FIELDS;

    #[test]
    fn every_preset_is_found_by_its_name() {
        for (unit, name) in Unit::presets().iter().zip(NAMES) {
            assert_eq!(Unit::by_name(name).as_ref(), Ok(unit));
            assert!(!unit.about().is_empty());
        }
        let message = Unit::by_name("phone").unwrap_err().to_string();
        assert_eq!(
            message,
            "unit: found \"phone\"; allowed: mobile, console, desktop"
        );
    }

    #[test]
    fn every_preset_gives_a_reason_for_every_field() {
        for unit in Unit::presets() {
            for field in FIELDS {
                let why = &unit.reasons()[field.name];
                assert!(why.len() > 8, "{}.{}: {why:?}", unit.name(), field.name);
            }
        }
    }

    #[test]
    fn the_summaries_of_the_presets_hold() {
        let sizes = Unit::presets().map(|unit| {
            let kib = [unit.cache_bytes(), unit.level2_bytes()].map(|bytes| bytes / 1024);
            (unit.macs_per_cycle(), kib, unit.about().to_owned())
        });
        let expected = [
            (
                256,
                [8, 0],
                "a small unit: 256 multiplications a cycle, 8 KiB of latents",
            ),
            (
                1024,
                [16, 0],
                "a middle unit: 1024 multiplications a cycle, 16 KiB of latents",
            ),
            (
                4096,
                [128, 1024],
                "a large unit: 4096 multiplications a cycle, 128 KiB of latents, 1 MiB behind them",
            ),
        ];
        assert_eq!(sizes, expected.map(|(m, k, a)| (m, k, a.to_owned())));
    }
}
