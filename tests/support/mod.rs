//! What several test binaries share.
#![allow(dead_code, reason = "not every test binary uses all of it")]

pub(crate) mod command;
#[cfg(feature = "train")]
pub(crate) mod source;

/// Says that a test is skipped and why, or fails where nothing, or no adapter, may be missing.
pub(crate) fn skip(why: &str) {
    let demanded = ["NTMU_REQUIRE_ALL", "NTMU_REQUIRE_ADAPTER"]
        .iter()
        .find(|name| std::env::var_os(name).is_some_and(|value| value == "1"));
    assert!(demanded.is_none(), "{demanded:?} is 1 and {why}");
    eprintln!("SKIPPED: {why}");
}
