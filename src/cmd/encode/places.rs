//! Places: where a run writes, looked at before the work.

use super::Encode;
use crate::console;
use anyhow::Context as _;
use ntmu::beside;
use std::path::{Path, PathBuf};

impl Encode {
    /// Finds out before the work what would be in the way after it.
    pub(super) fn check_places(&self, checkpoint: &Path) -> anyhow::Result<()> {
        for path in [self.output.as_path(), checkpoint] {
            beside::file_for(path).with_context(|| format!("cannot write {}", path.display()))?;
            anyhow::ensure!(
                !path.is_dir(),
                "{}: found a folder; allowed: a file",
                path.display()
            );
        }
        if let Some(folder) = &self.preview {
            crate::files::make_folder(folder)?;
            let inside = folder.join("preview");
            beside::file_for(&inside)
                .with_context(|| format!("cannot write into {}", folder.display()))?;
        }
        let place = checkpoint.display();
        match (self.resume, checkpoint.exists()) {
            (true, false) => anyhow::bail!("--resume: found no checkpoint at {place}"),
            (false, true) => {
                console::note(&format!(
                    "starting anew over {place}; --resume would continue it"
                ));
            }
            (true, true) | (false, false) => {}
        }
        Ok(())
    }

    pub(super) fn checkpoint_path(&self) -> PathBuf {
        self.checkpoint.clone().unwrap_or_else(|| {
            let mut name = self.output.clone().into_os_string();
            name.push(".checkpoint");
            PathBuf::from(name)
        })
    }
}
