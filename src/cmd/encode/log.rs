//! Log: a line of JSON for every observation of a run.

use anyhow::Context as _;
use ntmu::trainer::{Progress, Round};
use serde_json::{Value, json};
use std::fs::{File, OpenOptions};
use std::io::{BufWriter, Write as _};
use std::path::{Path, PathBuf};

/// The file of a run. A run that is resumed goes on in it; what an interrupted process wrote after
/// its checkpoint is replaced by what the resumed one writes.
pub(super) struct Log {
    path: PathBuf,
    /// Lines of earlier processes, until the first of this one says which of them hold.
    earlier: Option<Vec<Value>>,
    file: BufWriter<File>,
}

impl Log {
    pub(super) fn open(path: &Path, resume: bool) -> anyhow::Result<Log> {
        let found = || format!("log {}", path.display());
        let earlier = if resume && path.exists() {
            let text = std::fs::read_to_string(path).with_context(found)?;
            // The last line may have been cut off with the process that wrote it.
            let lines = text.lines().map(serde_json::from_str).map_while(Result::ok);
            Some(lines.collect())
        } else {
            None
        };
        let file = OpenOptions::new()
            .write(true)
            .create(true)
            .truncate(earlier.is_none())
            .open(path)
            .with_context(found)?;
        Ok(Log {
            path: path.to_owned(),
            earlier,
            file: BufWriter::new(file),
        })
    }

    pub(super) fn write(&mut self, progress: &Progress) -> anyhow::Result<()> {
        let found = || format!("log {}", self.path.display());
        if let Some(earlier) = self.earlier.take() {
            let file = File::create(&self.path).with_context(found)?;
            self.file = BufWriter::new(file);
            let before = |line: &&Value| line["done"].as_u64().is_some_and(|d| d < progress.done);
            for line in earlier.iter().filter(before) {
                writeln!(self.file, "{line}").with_context(found)?;
            }
        }
        let line = json!({
            "stage": progress.stage.name(),
            "index": progress.stage.index,
            "step": progress.step,
            "steps": progress.stage_steps,
            "done": progress.done,
            "total": progress.total,
            "seconds": progress.seconds,
            "loss": progress.loss,
            "psnr": progress.psnr,
            "deployed_psnr": progress.deployed_psnr,
            "rates": progress.rates,
        });
        self.put(&line)
    }

    /// A round of settling: a resumed run goes through all of them again.
    pub(super) fn write_round(&mut self, round: &Round) -> anyhow::Result<()> {
        let Round { moved, psnr } = round;
        self.put(&json!({ "stage": "settling", "moved": moved, "deployed_psnr": psnr }))
    }

    fn put(&mut self, line: &Value) -> anyhow::Result<()> {
        let found = || format!("log {}", self.path.display());
        writeln!(self.file, "{line}").with_context(found)?;
        // A line is there for whoever follows the file, and for whoever resumes the run.
        self.file.flush().with_context(found)
    }
}
