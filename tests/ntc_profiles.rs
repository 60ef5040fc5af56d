//! The committed table of NTC's profiles is what the example makes.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

#[path = "../examples/ntc_profiles.rs"]
#[allow(dead_code, reason = "the example's main writes the table")]
mod ntc_profiles;

const DOCUMENT: &str = include_str!("../docs/src/ntc_profiles.md");

#[test]
fn the_committed_table_is_what_the_example_makes() {
    let (_, committed, _) = ntc_profiles::parts(DOCUMENT).unwrap();
    assert_eq!(committed, ntc_profiles::table().unwrap());
}
