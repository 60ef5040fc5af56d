//! The unit in time: what makes its cycles believable.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod any;
mod bounds;
mod classics;
mod declared;
mod fixture;
mod monotone;
mod page;
mod passage;
mod steps;
