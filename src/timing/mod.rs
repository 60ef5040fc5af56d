//! Timing: what is made of a unit's run.

pub mod heat;
pub mod waves;
