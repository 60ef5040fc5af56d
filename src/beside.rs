//! Beside: results are written beside their place and renamed, so that they are there whole or not
//! at all.

use std::path::Path;
use tempfile::NamedTempFile;

/// A temporary file in the folder of `path`; persisting it at `path` is a rename.
///
/// # Errors
/// When the folder is missing or cannot be written.
pub fn file_for(path: &Path) -> std::io::Result<NamedTempFile> {
    let folder = path
        .parent()
        .filter(|p| !p.as_os_str().is_empty())
        .unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    builder.prefix(".ntmu-").suffix(".part");
    // Temporary files are private by default; this one becomes an ordinary file, under the umask.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    builder.tempfile_in(folder)
}
