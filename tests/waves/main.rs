//! A run as files: what is read back from each equals what the run showed.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod failing;
mod heat;
mod konata;
mod perfetto;
mod ramulator;
mod run;
mod seen;
mod vcd;
