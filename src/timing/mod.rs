//! Timing: materials, demands and a unit brought together, and what comes out as plain numbers.
//!
//! | module | answers |
//! |---|---|
//! | [`setup`] | what is run: unit, materials, layout, access; all checked |
//! | [`source`] | its demands, as often as they are wanted, whole or in parts |
//! | [`bracket`] | a whole run, beside the same without a cache and with an infinite one |
//! | [`sampling`] | the same estimated from segments |
//! | [`estimate`](mod@estimate) | a mean with its interval |
//! | [`counts`] | what adds up |
//! | [`summary`] | what people read |

pub mod bracket;
pub mod counts;
pub mod estimate;
pub mod sampling;
pub mod setup;
pub mod source;
pub mod summary;
