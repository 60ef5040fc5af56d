//! `ntmu throughput`: what a texel block costs.

use super::unit::{find, find_table};
use crate::Verdict;
use crate::console;
use anyhow::bail;
use ntmu::isa::layout::Layout;
use ntmu::isa::preset::Preset;
use ntmu::model::stream::AccessSpec;
use ntmu::timing::table::document::COLUMNS;
use ntmu::timing::table::{self, Plan, SCREEN, SIZE, Table};

#[derive(clap::Args)]
pub(crate) struct Throughput {
    /// A unit: a preset's name, or a TOML file. May be given more than once; without it all presets,
    /// and the largest with multipliers that split.
    #[arg(long = "unit", value_name = "UNIT")]
    units: Vec<String>,
    /// The shape of this preset. May be given more than once; all without it.
    #[arg(long = "preset", value_name = "PRESET")]
    presets: Vec<String>,
    /// Texels along both sides of the sets.
    #[arg(long, value_name = "TEXELS", default_value_t = SIZE)]
    size: u32,
    /// A stream of demands: raster, blocks, zorder, random, quad, plane or sphere, each with
    /// `:KEY=VALUE,…`. May be given more than once; a texel scan and a floor without it.
    #[arg(long = "access", value_name = "STREAM")]
    accesses: Vec<AccessSpec>,
    /// Pixels of the screen of quad, plane and sphere.
    #[arg(long, value_names = ["WIDTH", "HEIGHT"], num_args = 2, default_values_t = SCREEN)]
    screen: Vec<u32>,
    /// Where memory keeps the grids.
    #[arg(long, default_value_t = Layout::TILED)]
    layout: Layout,
    /// The table of energies: a built-in one (energy, energy-7nm), or a TOML file.
    #[arg(long, value_name = "TABLE", default_value = "energy")]
    energy: String,
    /// Print a page of Markdown that says how the rows were made.
    #[arg(long, conflicts_with = "json")]
    markdown: bool,
}

impl Throughput {
    pub(crate) fn run(self, json: bool) -> anyhow::Result<Verdict> {
        let plan = self.plan()?;
        let bar = console::progress(plan.rows(), "timing");
        let table = table::run(&plan, |done| bar.set_position(done))?;
        bar.finish_and_clear();
        if json {
            console::print_json(&table)?;
        } else if self.markdown {
            console::print(&table.markdown());
        } else {
            print(&table);
        }
        Ok(Verdict::Fine)
    }

    fn plan(&self) -> anyhow::Result<Plan> {
        let units = self.units.iter().map(|name| find(name));
        let mut plan = Plan::usual(units.collect::<anyhow::Result<_>>()?)?;
        if !self.presets.is_empty() {
            plan.presets = self
                .presets
                .iter()
                .map(|name| preset(name))
                .collect::<anyhow::Result<_>>()?;
        }
        if !self.accesses.is_empty() {
            plan.accesses.clone_from(&self.accesses);
        }
        if let [width, height] = *self.screen {
            plan.screen = [width, height];
        }
        plan.size = self.size;
        plan.layout = self.layout;
        plan.energy = find_table(&self.energy)?;
        Ok(plan)
    }
}

fn preset(name: &str) -> anyhow::Result<Preset> {
    let Some(preset) = Preset::by_name(name) else {
        let names = Preset::ALL.map(|preset| preset.name).join(", ");
        bail!("--preset: found {name:?}; allowed: {names}");
    };
    Ok(preset)
}

fn print(table: &Table) {
    let header: Vec<&str> = COLUMNS.iter().map(|(name, _)| *name).collect();
    let mut text = format!(
        "{size}×{size} texels, {} channels, layout {}, {}; picojoules of the table rank designs and are no estimate of power\n",
        table.channels,
        table.layout,
        table.energy,
        size = table.size,
    );
    for section in table.sections() {
        let mut rows = console::table(&header);
        for row in section.rows {
            rows.add_row(COLUMNS.iter().map(|(_, cell)| cell(row)));
        }
        let profile = section.rows.iter().map(|row| &row.subject.profile);
        let profile = profile.into_iter().find(|p| !p.is_empty());
        let profile = profile.map_or("", String::as_str);
        text += &format!(
            "\n{} on {}, profile {profile}\n\n{rows}\n",
            section.access, section.unit
        );
    }
    console::print(&text);
}
