//! What is promised to others: how far the model may lie from the truth, and vectors that tell a
//! decoder's author which rule was broken.
//!
//! | module | answers |
//! |---|---|
//! | [`oracle`] | what the real-number decode of a texel is |
//! | [`bound`] | how far rounding may move the model away from it, derived from the profile |
//! | [`histogram`] | how far it did move |
//! | [`naive`] | what every bit must be: the specification evaluated once more, on wide integers |
//! | [`claims`] | what is promised of the model, held against what was observed |
//! | [`certificate`] | what the weights alone prove: ranges, accumulator widths, safe rescalings |
//! | [`synthetic`] | assets that exercise every rule, from a seed |
//! | [`stage`] | the names of the intermediate values, and where two runs part |
//! | [`vector`], [`flag`], [`emit`] | the vector file: its records, its explanations, its bytes |
//! | [`suite`] | the vectors themselves |
//! | [`device`], [`runner`] | a device under test, and what it did with the vectors |

#![forbid(unsafe_code)]

pub mod bound;
pub mod certificate;
pub mod claims;
pub mod device;
pub mod emit;
pub mod flag;
pub mod histogram;
pub mod naive;
pub mod names;
pub mod oracle;
pub mod runner;
pub mod stage;
pub mod suite;
pub mod synthetic;
pub mod vector;

pub use device::{Device, DeviceError, ModelDevice};
pub use oracle::Oracle;
pub use runner::{Summary, run};
pub use stage::{Stage, Taps};
