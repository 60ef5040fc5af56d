//! Timing: materials, demands and a unit brought together, and what comes out.
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
//! | [`lab`] | experiments: queues, lines, working sets, materials, roofs, energy |
//! | [`table`] | what a texel block costs: every preset on every unit, with textures of today beside them |
//! | [`waves`] | a run for other people's tools |
//! | [`heat`] | where on the screen lines were missed |

pub mod bracket;
pub mod counts;
pub mod estimate;
pub mod heat;
pub mod lab;
pub mod sampling;
pub mod setup;
pub mod source;
pub mod summary;
pub mod table;
pub mod waves;
