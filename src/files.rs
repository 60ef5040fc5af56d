//! Files: assets in, results out. A result is written beside its place and renamed.

use anyhow::Context as _;
use ntmu::isa::Asset;
use std::io::Write as _;
use std::path::Path;

/// The largest file that is read as an asset: four times the largest that the format allows.
const MAX_ASSET_BYTES: u64 = 4 << 30;

/// Reads and validates an asset.
pub(crate) fn read_asset(path: &Path) -> anyhow::Result<Asset> {
    let found = || format!("{}", path.display());
    let size = std::fs::metadata(path).with_context(found)?.len();
    anyhow::ensure!(
        size <= MAX_ASSET_BYTES,
        "{}: {size} bytes; an asset has at most {MAX_ASSET_BYTES}",
        path.display()
    );
    let bytes = std::fs::read(path).with_context(found)?;
    Asset::from_bytes(&bytes).with_context(found)
}

/// Writes a file so that it is there whole or not at all.
pub(crate) fn write(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    let found = || format!("cannot write {}", path.display());
    let mut beside = ntmu::beside::file_for(path).with_context(found)?;
    beside.write_all(bytes).with_context(found)?;
    beside.as_file().sync_all().with_context(found)?;
    beside.persist(path).with_context(found)?;
    Ok(())
}

/// Makes a folder for results.
pub(crate) fn make_folder(path: &Path) -> anyhow::Result<()> {
    std::fs::create_dir_all(path).with_context(|| format!("cannot make {}", path.display()))
}
