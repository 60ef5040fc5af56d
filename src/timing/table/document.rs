//! Document: the table as Markdown, `docs/src/throughput.md`.

use super::{Figures, Row, SEED, Table};
use std::fmt::Write as _;

/// What stands in a column.
type Cell = fn(&Row) -> String;

/// The columns: the name, and what stands there.
pub const COLUMNS: [(&str, Cell); 18] = [
    ("set", |row| row.subject.name.clone()),
    ("layers", |row| row.subject.precision.clone()),
    ("cycles/block", |row| number(row.figures.cycles_per_block)),
    ("p50", |row| number(row.figures.block_cycles_p50)),
    ("p99", |row| number(row.figures.block_cycles_p99)),
    ("Gtexel/s", |row| number(row.figures.gigatexels_per_second)),
    ("bytes/block", |row| number(row.figures.bytes_per_block)),
    ("MAC use", |row| percent(row.figures.mac_utilisation)),
    ("binds", |row| row.figures.binds.clone()),
    ("largest stall", |row| stall(&row.figures)),
    ("closed form", |row| {
        number(row.figures.closed_form_per_block)
    }),
    ("ideal memory", |row| {
        number(row.figures.ideal_memory_per_block)
    }),
    ("infinite cache", |row| {
        number(row.figures.infinite_cache_per_block)
    }),
    ("no cache", |row| number(row.figures.no_cache_per_block)),
    ("pJ/block", |row| number(row.figures.picojoules_per_block)),
    ("cycles × BC7", |row| number(row.to_control.cycles)),
    ("bytes × BC7", |row| number(row.to_control.bytes)),
    ("pJ × BC7", |row| number(row.to_control.picojoules)),
];

/// Three significant digits, or all of a larger whole number.
fn number(value: f64) -> String {
    let digits = [100.0, 10.0, 1.0, 0.1, 0.01, 0.001];
    let digits = digits.iter().take_while(|&&limit| value < limit).count();
    if value == 0.0 {
        "0".to_owned()
    } else {
        format!("{value:.digits$}")
    }
}

fn percent(share: f64) -> String {
    format!("{:.1} %", 100.0 * share)
}

fn stall(figures: &Figures) -> String {
    if figures.largest_stall.is_empty() {
        "none".to_owned()
    } else {
        format!(
            "{} {}",
            figures.largest_stall,
            percent(figures.largest_stall_share)
        )
    }
}

/// The rows of one unit in one scene.
#[derive(Clone, Copy, Debug)]
pub struct Section<'t> {
    /// The stream, in full.
    pub access: &'t str,
    /// The unit's identity.
    pub unit: &'t str,
    /// Its rows, the control first.
    pub rows: &'t [Row],
}

impl Section<'_> {
    /// Its heading.
    #[must_use]
    pub fn heading(&self) -> String {
        format!("## `{}` on {}", self.access, self.unit)
    }

    /// A line of Markdown for each row.
    pub fn lines(&self) -> impl Iterator<Item = String> {
        self.rows.iter().map(|row| {
            let cells: Vec<String> = COLUMNS.iter().map(|(_, cell)| cell(row)).collect();
            format!("| {} |", cells.join(" | "))
        })
    }
}

impl Table {
    /// The rows of one unit in one scene after those of another.
    pub fn sections(&self) -> impl Iterator<Item = Section<'_>> {
        let same = |a: &Row, b: &Row| a.access == b.access && a.unit == b.unit;
        self.rows.chunk_by(same).map(|rows| Section {
            access: &rows[0].access,
            unit: &rows[0].unit,
            rows,
        })
    }

    /// What stands before the rows: how they were made, and what the columns mean.
    #[must_use]
    pub fn introduction(&self) -> String {
        let profile = self.rows.iter().map(|row| row.subject.profile.as_str());
        let profile = profile.into_iter().find(|p| !p.is_empty()).unwrap_or("");
        let [columns, rows] = self.screen;
        let mut scenes: Vec<String> = self
            .sections()
            .map(|section| format!("`{}`", section.access))
            .collect();
        scenes.dedup();
        include_str!("throughput.md")
            .replace("{size}", &self.size.to_string())
            .replace("{channels}", &self.channels.to_string())
            .replace("{maps}", &self.channels.div_ceil(4).to_string())
            .replace("{screen}", &format!("{columns}×{rows}"))
            .replace("{layout}", &self.layout)
            .replace("{profile}", profile)
            .replace("{energy}", &self.energy)
            .replace("{seed}", &SEED.to_string())
            .replace("{scenes}", &scenes.join(", "))
    }

    /// The extremes of each unit and scene.
    fn summary(&self) -> String {
        let mut text = String::from(
            "\n## Extremes\n\nThe set with the fewest and the one with the most cycles per block, and their multiples of BC7's.\n\n\
             | scene | unit | BC7 | fewest | × BC7 | most | × BC7 |\n|---|---|--:|---|--:|---|--:|\n",
        );
        for section in self.sections() {
            let Some((control, sets)) = section.rows.split_first() else {
                continue;
            };
            let by_cycles = |a: &&Row, b: &&Row| {
                let cycles = |row: &Row| row.figures.cycles;
                cycles(a).cmp(&cycles(b))
            };
            let (Some(fewest), Some(most)) =
                (sets.iter().min_by(by_cycles), sets.iter().max_by(by_cycles))
            else {
                continue;
            };
            let described = |row: &Row| {
                let Row {
                    subject, figures, ..
                } = row;
                let cycles = number(figures.cycles_per_block);
                format!("{} {}: {cycles}", subject.name, subject.precision)
            };
            let line = [
                format!("`{}`", section.access),
                section.unit.to_owned(),
                number(control.figures.cycles_per_block),
                described(fewest),
                number(fewest.to_control.cycles),
                described(most),
                number(most.to_control.cycles),
            ];
            let _ = writeln!(text, "| {} |", line.join(" | "));
        }
        text
    }

    /// The whole as Markdown.
    #[must_use]
    pub fn markdown(&self) -> String {
        let names: Vec<&str> = COLUMNS.iter().map(|(name, _)| *name).collect();
        let rules: Vec<&str> = COLUMNS
            .iter()
            .map(|(name, _)| match *name {
                "set" | "layers" | "binds" | "largest stall" => "---",
                _ => "--:",
            })
            .collect();
        let mut text = self.introduction();
        text += &self.summary();
        for section in self.sections() {
            let header = format!("| {} |\n|{}|", names.join(" | "), rules.join("|"));
            let lines: Vec<String> = section.lines().collect();
            let _ = write!(
                text,
                "\n{}\n\n{header}\n{}\n",
                section.heading(),
                lines.join("\n")
            );
        }
        text
    }
}
