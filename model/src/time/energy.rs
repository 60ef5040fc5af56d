//! Energy: what a run did, as plain counts.

mod operations;

pub use operations::{Operation, Operations};
