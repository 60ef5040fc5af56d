//! `ntmu unit`: hardware configurations, and what their operations cost.

use crate::Verdict;
use crate::console;
use anyhow::{Context as _, bail};
use comfy_table::CellAlignment;
use ntmu::model::time::energy::{Energy, EnergyError, EnergyTable, Operations};
use ntmu::model::time::unit::{Range, Unit, UnitError, Value};
use serde_json::{Map, json};
use std::path::Path;

#[derive(clap::Args)]
pub(crate) struct UnitVerb {
    /// Print this one with the reason for every number: a preset's name, or a TOML file. The
    /// presets are listed without it.
    name: Option<String>,
    /// Change a field of it first. May be given more than once.
    #[arg(long = "set", value_name = "FIELD=VALUE", requires = "name")]
    changes: Vec<String>,
    /// Print it as TOML, to start a file from.
    #[arg(long, requires = "name", conflicts_with_all = ["energy", "json"])]
    toml: bool,
    /// Print what each of its operations costs in a published table of energies: a built-in one
    /// (energy, energy-7nm), or a TOML file.
    #[arg(
        long,
        value_name = "TABLE",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "energy",
        requires = "name"
    )]
    energy: Option<String>,
}

/// A preset by its name, else a file. Its name is the file's, without the ending.
pub(crate) fn find(name: &str) -> anyhow::Result<Unit> {
    match Unit::by_name(name) {
        Err(error @ UnitError::Preset { .. }) => {
            let (stem, text) = read(name).context(error)?;
            Unit::from_toml(stem, &text).with_context(|| name.to_owned())
        }
        found => Ok(found?),
    }
}

/// A built-in table of energies by its name, else a file.
pub(crate) fn find_table(name: &str) -> anyhow::Result<EnergyTable> {
    match EnergyTable::by_name(name) {
        Err(error @ EnergyError::Unknown { .. }) => {
            let (stem, text) = read(name).context(error)?;
            EnergyTable::from_toml(stem, &text).with_context(|| name.to_owned())
        }
        found => Ok(found?),
    }
}

/// A unit with changes as a command line gives them, `mshrs=32`.
pub(crate) fn change(unit: &Unit, changes: &[String]) -> anyhow::Result<Unit> {
    let mut pairs = Vec::new();
    for change in changes {
        match change.split_once('=') {
            Some((field, value)) => pairs.push((field.trim(), value.trim())),
            None => bail!("--set: found {change:?}; allowed: FIELD=VALUE"),
        }
    }
    Ok(unit.with(&pairs)?)
}

/// A file's name without its ending, and its text.
fn read(name: &str) -> anyhow::Result<(String, String)> {
    let path = Path::new(name);
    let stem = path.file_stem().map(|stem| stem.to_string_lossy());
    match stem {
        Some(stem) if path.is_file() => {
            let text = std::fs::read_to_string(path).with_context(|| name.to_owned())?;
            Ok((stem.into_owned(), text))
        }
        Some(_) | None => bail!("no such file"),
    }
}

impl UnitVerb {
    pub(crate) fn run(self, json: bool) -> anyhow::Result<Verdict> {
        let Some(name) = &self.name else {
            list(json)?;
            return Ok(Verdict::Fine);
        };
        let unit = change(&find(name)?, &self.changes)?;
        let energy = match &self.energy {
            None => None,
            Some(table) => Some(find_table(table)?.of(&Operations::ONE_OF_EACH, &unit)),
        };
        match (json, energy) {
            (true, energy) => {
                let mut described = describe(&unit);
                if let Some(energy) = energy {
                    described["energy"] = describe_energy(&energy);
                }
                console::print_json(&described)?;
            }
            (false, Some(energy)) => print_prices(&unit, &energy),
            (false, None) if self.toml => console::print(&unit.to_toml()),
            (false, None) => print_fields(&unit),
        }
        Ok(Verdict::Fine)
    }
}

fn list(json: bool) -> anyhow::Result<()> {
    let units = Unit::presets();
    if json {
        let described: Vec<_> = units.iter().map(describe).collect();
        return console::print_json(&described);
    }
    let header = [
        "unit",
        "hash",
        "MHz",
        "MACs/cycle",
        "cache KiB",
        "level 2 KiB",
    ];
    let mut table = console::table(&header);
    for unit in &units {
        table.add_row([
            unit.name().to_owned(),
            unit.hash(),
            unit.clock_mhz.to_string(),
            unit.macs_per_cycle().to_string(),
            (unit.cache_bytes() / 1024).to_string(),
            (unit.level2_bytes() / 1024).to_string(),
        ]);
    }
    console::print(&table.to_string());
    Ok(())
}

fn range(range: Range) -> String {
    match range {
        Range::Number { low, high } => format!("{low}..={high}"),
        Range::Choice(names) => names.join(", "),
    }
}

fn print_fields(unit: &Unit) {
    let mut table = console::table(&["field", "value", "unit", "range", "why"]);
    for column in table.column_iter_mut().skip(2) {
        column.set_cell_alignment(CellAlignment::Left);
    }
    for (field, value) in unit.fields() {
        let why = unit.reasons().get(field.name).map_or("", String::as_str);
        table.add_row([
            field.name.to_owned(),
            value.to_string(),
            field.unit.to_owned(),
            range(field.range),
            why.to_owned(),
        ]);
    }
    let about = match unit.about() {
        "" => String::new(),
        about => format!("{about}\n"),
    };
    console::print(&format!("{}\n{about}\n{table}", unit.identity()));
}

fn print_prices(unit: &Unit, energy: &Energy) {
    let header = ["operation", "pJ of the table", "formula", "source"];
    let mut table = console::table(&header);
    for column in table.column_iter_mut().skip(2) {
        column.set_cell_alignment(CellAlignment::Left);
    }
    for level in &energy.levels {
        table.add_row([
            level.operation.name().to_owned(),
            format!("{:.4}", level.picojoules_each),
            level.formula.clone(),
            level.source.clone(),
        ]);
    }
    console::print(&format!(
        "{} at {}\nThese prices rank designs; they are no estimate of power.\n\n{table}",
        unit.identity(),
        energy.table
    ));
}

fn describe(unit: &Unit) -> serde_json::Value {
    let fields: Map<String, serde_json::Value> = unit
        .fields()
        .into_iter()
        .map(|(field, value)| {
            let value = match value {
                Value::Number(number) => json!(number),
                Value::Choice(name) => json!(name),
            };
            let described = json!({
                "value": value,
                "unit": field.unit,
                "range": match field.range {
                    Range::Number { low, high } => json!([low, high]),
                    Range::Choice(names) => json!(names),
                },
                "why": unit.reasons().get(field.name),
            });
            (field.name.to_owned(), described)
        })
        .collect();
    json!({
        "name": unit.name(), "identity": unit.identity(), "about": unit.about(), "fields": fields,
    })
}

fn describe_energy(energy: &Energy) -> serde_json::Value {
    let operations: Map<String, serde_json::Value> = energy
        .levels
        .iter()
        .map(|level| {
            let described = json!({
                "picojoules": level.picojoules_each,
                "formula": level.formula,
                "source": level.source,
            });
            (level.operation.name().to_owned(), described)
        })
        .collect();
    json!({ "table": energy.table, "operations": operations })
}
