//! The files that a run can leave. Another option is a field of [`Outputs`], a line in each of its
//! functions, and a member of [`Watches`].

use super::ramulator::Ramulator;
use anyhow::Context as _;
use std::fs::File;
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;

#[derive(clap::Args)]
pub(super) struct Outputs {
    /// Write the lines asked of memory as a load-store trace for Ramulator 2.
    #[arg(long, value_name = "FILE")]
    ramulator: Option<PathBuf>,
}

/// Whoever writes the files of a run. Another option makes a pair of this and its own, and so on:
/// `(Option<A>, (Option<B>, Option<C>))` is a watch too.
pub(super) type Watches = Option<Ramulator<BufWriter<File>>>;

/// The files of a run while it runs, beside their places.
pub(super) struct Files {
    pub(super) watches: Watches,
    ramulator: Option<Beside>,
}

/// A file beside its place.
struct Beside {
    file: NamedTempFile,
    path: PathBuf,
}

impl Outputs {
    /// The first option that was given: it needs the whole run.
    pub(super) fn given(&self) -> Option<&'static str> {
        let options = [("--ramulator", self.ramulator.is_some())];
        let mut given = options.iter().filter(|(_, is_given)| *is_given);
        given.next().map(|(option, _)| *option)
    }

    /// Opens the files beside their places.
    pub(super) fn open(&self) -> anyhow::Result<Files> {
        let (ramulator, ramulator_file) = begin(self.ramulator.as_deref())?.unzip();
        Ok(Files {
            watches: ramulator.map(Ramulator::new),
            ramulator: ramulator_file,
        })
    }
}

impl Files {
    /// Puts the files in their places.
    pub(super) fn keep(self) -> anyhow::Result<()> {
        let ramulator = self.watches;
        end(self.ramulator, ramulator.map(Ramulator::finish))
    }
}

/// Opens a file beside its place, for whoever writes it.
fn begin(path: Option<&Path>) -> anyhow::Result<Option<(BufWriter<File>, Beside)>> {
    let open = |path: &Path| -> io::Result<(BufWriter<File>, Beside)> {
        let file = ntmu::beside::file_for(path)?;
        let writer = BufWriter::new(file.as_file().try_clone()?);
        let path = path.to_owned();
        Ok((writer, Beside { file, path }))
    };
    let open = |path: &Path| open(path).with_context(|| cannot(path));
    path.map(open).transpose()
}

/// Puts a file in its place when what watched has written all of it.
fn end<T>(beside: Option<Beside>, finished: Option<io::Result<T>>) -> anyhow::Result<()> {
    let (Some(Beside { file, path }), Some(finished)) = (beside, finished) else {
        return Ok(());
    };
    finished.with_context(|| cannot(&path))?;
    file.as_file().sync_all().with_context(|| cannot(&path))?;
    file.persist(&path).with_context(|| cannot(&path))?;
    Ok(())
}

fn cannot(path: &Path) -> String {
    format!("cannot write {}", path.display())
}
