//! What `ntmu encode` does in a build that has the trainer.

use super::Encode;
use super::watcher::Watcher;
use crate::Verdict;
use crate::{console, files};
use anyhow::Context as _;
use ntmu::built_in;
use ntmu::decoded::Decoded;
use ntmu::quality::{self, Quality};
use ntmu::texture_set::TextureSet;
use ntmu::trainer::{self, Backend, Memory, TrainError};
use ntmu::training_source::training_source;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

impl Encode {
    pub(crate) fn run(self, json: bool) -> anyhow::Result<Verdict> {
        let config = self.config()?;
        let device = Backend::by_name(&self.backend)?.open()?;
        if let Some(adapter) = device.adapter() {
            console::note(&format!("{}: {adapter}", device.backend().name()));
        }
        let set = match &self.source {
            Some(path) if !self.built_in => TextureSet::read(path)?,
            _ => built_in::source(),
        };
        for skipped in &set.skipped {
            console::note(&format!("left out {}: {}", skipped.file, skipped.reason));
        }
        let checkpoint = self.checkpoint_path();
        self.check_places(&checkpoint)?;
        let mut source = training_source(&set);
        // The largest thing in memory, and no longer needed.
        drop(set);
        self.prepare(&mut source)?;
        let config = self.config_for(&source, config, &device)?;
        let memory = Memory::of(&source, &config)?;
        let started = Instant::now();
        let stop = stop_on_interrupt()?;
        let mut watcher = Watcher::new(&self, Arc::clone(&stop))?;
        let trained = trainer::watched(
            &source,
            &config,
            &device,
            Some(&checkpoint),
            self.resume,
            &stop,
            &mut watcher,
        );
        watcher.line.finish();
        let trained = match (trained, watcher.failure) {
            (Ok(trained), None) => trained,
            (Err(stopped @ TrainError::Stopped { .. }), Some(failure)) => {
                return Err(failure.context(stopped));
            }
            (Ok(_), Some(failure)) => return Err(failure),
            (Err(error @ TrainError::Stopped { .. }), None) => {
                console::note(&format!(
                    "{error}\nthe same command with --resume continues"
                ));
                return Ok(Verdict::Failed);
            }
            (Err(error), _) => return Err(error.into()),
        };
        files::write(&self.output, &trained.asset.to_bytes())?;
        remove(&checkpoint)?;
        let reals = Decoded::of(&trained.asset, |_| ()).reals(&trained.asset.shape);
        let quality = Quality::measure(&source.mips, &reals, &quality::maps_of(&trained.asset))?;
        self.report(json, &trained, &quality, memory, started.elapsed())?;
        if trained.report.reached == Some(false) {
            console::note(&format!(
                "--target-psnr: the asset has {:.2} dB, less than {:.2}; it was written",
                trained.report.psnr_quantised,
                config.target_psnr.unwrap_or_default()
            ));
            return Ok(Verdict::Failed);
        }
        Ok(Verdict::Fine)
    }
}

/// Removes the checkpoint of a finished run, and what a killed process left of one.
fn remove(checkpoint: &Path) -> anyhow::Result<()> {
    let mut half_written = checkpoint.as_os_str().to_owned();
    half_written.push(".part");
    for path in [checkpoint, Path::new(&half_written)] {
        if path.exists() {
            std::fs::remove_file(path)
                .with_context(|| format!("cannot remove {}", path.display()))?;
        }
    }
    Ok(())
}

/// The first interrupt asks the trainer to stop, which leaves a checkpoint; a second ends the
/// program at once.
fn stop_on_interrupt() -> anyhow::Result<Arc<AtomicBool>> {
    let stop = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&stop);
    ctrlc::set_handler(move || {
        if flag.swap(true, Ordering::SeqCst) {
            std::process::abort();
        }
        console::note("\nstopping; once more to stop without a checkpoint");
    })
    .context("cannot watch for interrupts")?;
    Ok(stop)
}
