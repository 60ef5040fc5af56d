//! What several test binaries share.

use std::path::PathBuf;

/// Whether a missing adapter or folder must fail instead of being skipped.
pub fn must_not_skip() -> bool {
    std::env::var_os("NTMU_REQUIRE_ALL").is_some_and(|value| value == "1")
}

/// Says that a test is skipped and why, or fails where nothing may be skipped.
pub fn skip(why: &str) {
    assert!(!must_not_skip(), "NTMU_REQUIRE_ALL=1 and {why}");
    println!("SKIPPED: {why}");
}

/// The folder of real texture sets, if there is one.
#[allow(dead_code, reason = "not every test binary reads texture sets")]
pub fn textures() -> Option<PathBuf> {
    let folder = std::env::var_os("NTMU_TEXTURES").map(PathBuf::from);
    if folder.is_none() {
        // The sets are not part of the repository, so even a strict run may lack them.
        println!("SKIPPED: NTMU_TEXTURES is not set");
    }
    folder
}
