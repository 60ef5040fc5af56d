//! Watcher: everything that looks at a run while it works.

use super::Encode;
use super::log::Log;
use super::preview::Preview;
use super::progress::Line;
use ntmu::isa::Asset;
use ntmu::trainer::{Progress, Round, Watch};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// The progress line, the log and the preview. What cannot be written stops the run, which leaves a
/// checkpoint.
pub(super) struct Watcher {
    pub(super) line: Line,
    log: Option<Log>,
    preview: Option<Preview>,
    stop: Arc<AtomicBool>,
    /// What could not be written.
    pub(super) failure: Option<anyhow::Error>,
}

impl Watcher {
    pub(super) fn new(encode: &Encode, stop: Arc<AtomicBool>) -> anyhow::Result<Watcher> {
        let log = encode.log.as_ref();
        let preview = encode.preview.clone();
        Ok(Watcher {
            line: Line::new(),
            log: log.map(|path| Log::open(path, encode.resume)).transpose()?,
            preview: preview
                .map(|folder| Preview::new(folder, encode.preview_every, encode.preview_side)),
            stop,
            failure: None,
        })
    }

    fn note(&mut self, outcome: anyhow::Result<()>) {
        if let Err(error) = outcome {
            self.failure.get_or_insert(error);
            self.stop.store(true, Ordering::Relaxed);
        }
    }
}

impl Watch for Watcher {
    fn observe(&mut self, progress: &Progress) {
        self.line.show(progress);
        if let Some(log) = &mut self.log {
            let outcome = log.write(progress);
            self.note(outcome);
        }
    }

    fn settled(&mut self, round: &Round) {
        self.line.show_round(round);
        if let Some(log) = &mut self.log {
            let outcome = log.write_round(round);
            self.note(outcome);
        }
    }

    fn wants_asset(&mut self) -> bool {
        self.preview.as_ref().is_some_and(Preview::is_due)
    }

    fn asset(&mut self, _: &Progress, asset: &Asset) {
        if let Some(preview) = &mut self.preview {
            let outcome = preview.write(asset);
            self.note(outcome);
        }
    }
}
