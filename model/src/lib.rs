//! The hardware: what a neural texture unit computes, to the bit, and how many cycles it takes.
//!
//! [`exec`] runs a microprogram on values, [`time`] runs the same microprogram on cycles, with the
//! addresses that the run on values touched. They meet only in a [`trace`].

pub mod exec;
pub mod request;
pub mod time;
pub mod trace;

pub use request::{Request, RequestError};
