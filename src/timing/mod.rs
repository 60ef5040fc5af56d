//! Timing: what the unit in time says about texture sets, beyond a single run.
//!
//! | module | answers |
//! |---|---|
//! | [`table`] | what a texel block costs: every preset on every unit, with textures of today beside them |

pub mod table;
