//! Timing: what the unit in time takes for assets and streams.

pub mod lab;
