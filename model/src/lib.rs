//! The hardware: what a neural texture unit computes, to the bit, and how many cycles it takes.
//!
//! [`exec`] runs a microprogram on values, [`time`] runs the same microprogram on cycles, with the
//! addresses that the run on values touched. They meet only in a [`trace`]. [`sampler`] stands before
//! both: it turns a sample by normalised coordinates into decodes, and their codes into one.

#![deny(unsafe_code)]

pub mod control;
pub mod demand;
pub mod engine;
pub mod exec;
mod footprint;
pub mod material;
pub mod place;
pub mod request;
pub mod sampler;
pub mod stream;
pub mod time;
pub mod trace;

pub use demand::{Demand, Demands};
pub use material::Material;
pub use place::{Place, PlaceError};
pub use request::{Request, RequestError};
