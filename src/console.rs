//! The console: data to stdout, everything else to stderr.

use comfy_table::{CellAlignment, Table, presets};
use indicatif::{ProgressBar, ProgressStyle};
use std::io::Write as _;

/// Writes `text` and a line end to stdout. A reader that has gone away (`| head`) ends the
/// program's interest in output, not the program.
pub(crate) fn print(text: &str) {
    let mut stdout = std::io::stdout().lock();
    if writeln!(stdout, "{}", text.trim_end())
        .and_then(|()| stdout.flush())
        .is_err()
    {
        // Nobody reads; there is nobody to tell.
    }
}

/// Writes a value to stdout as JSON.
pub(crate) fn print_json(value: &impl serde::Serialize) -> anyhow::Result<()> {
    print(&serde_json::to_string_pretty(value)?);
    Ok(())
}

/// Writes a note to stderr.
pub(crate) fn note(text: &str) {
    let mut stderr = std::io::stderr().lock();
    if writeln!(stderr, "{text}").is_err() {
        // Nobody reads; there is nobody to tell.
    }
}

/// Writes an error and its causes to stderr.
pub(crate) fn complain(error: &anyhow::Error) {
    note(&format!("ntmu: {error:#}"));
}

/// A Markdown table, so that it can be pasted; its first column is left-aligned, the others
/// right-aligned.
pub(crate) fn table(header: &[&str]) -> Table {
    let mut table = Table::new();
    table
        .load_preset(presets::ASCII_MARKDOWN)
        .set_header(header.to_vec());
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}

/// A progress bar on stderr that counts to `length`; silent where stderr is no terminal.
pub(crate) fn progress(length: u64, what: &'static str) -> ProgressBar {
    let bar = ProgressBar::new(length).with_message(what);
    if let Ok(style) = ProgressStyle::with_template("{msg:24} {bar:32} {pos}/{len} {eta}") {
        bar.set_style(style);
    }
    bar
}
