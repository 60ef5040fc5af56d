//! The files that a run can leave. Another option is a field of [`Outputs`] and of [`Files`], a line
//! in each of their functions, and a member of [`Watches`].

use anyhow::Context as _;
use ntmu::model::time::Unit;
use ntmu::timing::heat::{HeatValue, MissMap};
use ntmu::timing::waves::{
    Konata, Perfetto, Ramulator, RamulatorFormat, Summary, Vcd, VcdTime, Window,
};
use std::fs::File;
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;

#[derive(clap::Args)]
pub(super) struct Outputs {
    /// Write the unit's signals as a value change dump, for GTKWave or Surfer.
    #[arg(long, value_name = "FILE")]
    vcd: Option<PathBuf>,
    /// Write a timeline as trace events, for ui.perfetto.dev.
    #[arg(long, value_name = "FILE")]
    perfetto: Option<PathBuf>,
    /// Write groups, jobs and layers as a pipeline, for Konata.
    #[arg(long, value_name = "FILE")]
    konata: Option<PathBuf>,
    /// Write the lines asked of memory as a load-store trace for Ramulator 2.
    #[arg(long, value_name = "FILE")]
    ramulator: Option<PathBuf>,
    /// Write where on the screen lines were missed, as a PNG.
    #[arg(long, value_name = "FILE")]
    heatmap: Option<PathBuf>,
    /// The cycles that the signals, the timeline and the pipeline show [default: 0..1000000]
    #[arg(long, value_name = "FROM..TO", value_parser = cycles)]
    cycles: Option<Window>,
}

/// `1000..2000`.
fn cycles(text: &str) -> Result<Window, String> {
    let parts = text
        .split_once("..")
        .map(|(from, to)| (from.parse(), to.parse()));
    match parts {
        Some((Ok(from), Ok(to))) if from < to => Ok(Window { from, to }),
        Some(_) | None => Err(format!("found `{text}`; allowed: FROM..TO, 0..1000000")),
    }
}

type Writer = BufWriter<File>;

/// Whoever watches the run for its files.
pub(super) type Watches = (
    (Option<Vcd<Writer>>, Option<Perfetto<Writer>>),
    (
        (Option<Konata<Writer>>, Option<Ramulator<Writer>>),
        Option<MissMap>,
    ),
);

/// The files of a run while it runs, beside their places.
pub(super) struct Files {
    pub(super) watches: Watches,
    vcd: Option<Beside>,
    perfetto: Option<Beside>,
    konata: Option<Beside>,
    ramulator: Option<Beside>,
    heatmap: Option<(Writer, Beside)>,
}

/// A file beside its place.
struct Beside {
    file: NamedTempFile,
    path: PathBuf,
}

impl Outputs {
    /// The first option that was given: it needs the whole run.
    pub(super) fn given(&self) -> Option<&'static str> {
        let options = [
            ("--vcd", &self.vcd),
            ("--perfetto", &self.perfetto),
            ("--konata", &self.konata),
            ("--ramulator", &self.ramulator),
            ("--heatmap", &self.heatmap),
        ];
        let mut given = options.iter().filter(|(_, path)| path.is_some());
        given.next().map(|(option, _)| *option)
    }

    /// Opens the files of a run of `unit` beside their places.
    pub(super) fn open(&self, unit: &Unit) -> anyhow::Result<Files> {
        let window = self.cycles.unwrap_or_default();
        let (vcd, vcd_file) = begin(self.vcd.as_deref())?.unzip();
        let (perfetto, perfetto_file) = begin(self.perfetto.as_deref())?.unzip();
        let (konata, konata_file) = begin(self.konata.as_deref())?.unzip();
        let (ramulator, ramulator_file) = begin(self.ramulator.as_deref())?.unzip();
        let loads = |writer| {
            let format = RamulatorFormat::LoadStore;
            Ramulator::new(writer, unit, Window::ALL, format, unit.line_bytes)
        };
        let map = self.heatmap.as_ref().map(|_| MissMap::new(CELL_PIXELS));
        Ok(Files {
            watches: (
                (
                    vcd.map(|writer| Vcd::new(writer, unit, window, VcdTime::Cycles)),
                    perfetto.map(|writer| Perfetto::new(writer, unit, window)),
                ),
                (
                    (
                        konata.map(|writer| Konata::new(writer, unit, window)),
                        ramulator.map(loads),
                    ),
                    map,
                ),
            ),
            vcd: vcd_file,
            perfetto: perfetto_file,
            konata: konata_file,
            ramulator: ramulator_file,
            heatmap: begin(self.heatmap.as_deref())?,
        })
    }
}

/// Pixels along the side of a heat map's cell: a quad.
const CELL_PIXELS: u32 = 2;

impl Files {
    /// Puts the files in their places. What lay outside the cycles that a file shows, by its path.
    pub(super) fn keep(self) -> anyhow::Result<Vec<(PathBuf, Summary)>> {
        let ((vcd, perfetto), ((konata, ramulator), map)) = self.watches;
        let mut cut = Vec::new();
        for (beside, finished) in [
            (self.vcd, vcd.map(Vcd::finish)),
            (self.perfetto, perfetto.map(Perfetto::finish)),
            (self.konata, konata.map(Konata::finish)),
            (self.ramulator, ramulator.map(Ramulator::finish)),
        ] {
            if let (Some(beside), Some(finished)) = (beside, finished) {
                let path = beside.path.clone();
                let summary = finished.with_context(|| cannot(&path))?;
                end(beside)?;
                if summary.left_out > 0 {
                    cut.push((path, summary));
                }
            }
        }
        if let (Some((writer, beside)), Some(map)) = (self.heatmap, map) {
            let written = map.write_png(writer, HeatValue::Misses);
            written.with_context(|| cannot(&beside.path))?;
            end(beside)?;
        }
        Ok(cut)
    }
}

/// Opens a file beside its place, for whoever writes it.
fn begin(path: Option<&Path>) -> anyhow::Result<Option<(Writer, Beside)>> {
    let open = |path: &Path| -> io::Result<(Writer, Beside)> {
        let file = ntmu::beside::file_for(path)?;
        let writer = BufWriter::new(file.as_file().try_clone()?);
        let path = path.to_owned();
        Ok((writer, Beside { file, path }))
    };
    let open = |path: &Path| open(path).with_context(|| cannot(path));
    path.map(open).transpose()
}

/// Puts a file that is written in its place.
fn end(beside: Beside) -> anyhow::Result<()> {
    let Beside { file, path } = beside;
    file.as_file().sync_all().with_context(|| cannot(&path))?;
    file.persist(&path).with_context(|| cannot(&path))?;
    Ok(())
}

fn cannot(path: &Path) -> String {
    format!("cannot write {}", path.display())
}
