//! Demand: what the shader asks of the unit, pixel by pixel.
//!
//! A demand is what is left of a sample when its coordinates have become places: which material,
//! which decodes, and how many weighted codes the filter adds up. [`time`](crate::time) counts its
//! cycles; where it came from, a generated scene or a file, it does not know.

use crate::place::Place;
use std::convert::Infallible;

/// What one pixel asks of the unit.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Demand {
    /// Column and row on the screen, for pictures.
    pub pixel: [u32; 2],
    /// Which of the unit's materials, from 0.
    pub material: u16,
    /// The decodes that it needs, each place once.
    pub places: Vec<Place>,
    /// Codes that the filter weighs and adds, for each channel: a place counts as often as a probe
    /// reads it. 1 is a single texel, which passes the filter as it is.
    pub weights: u32,
}

/// Demands one after the other, in the order in which the shader asks.
pub trait Demands {
    /// Why the next demand cannot be read.
    type Error;

    /// Puts the next demand in the place of `demand`, whose memory is used again; false, and
    /// `demand` is left as it is, at the end.
    ///
    /// # Errors
    /// When what stands behind the demands is damaged or cannot be read.
    fn advance(&mut self, demand: &mut Demand) -> Result<bool, Self::Error>;
}

/// Demands that exist already.
impl<I: Iterator<Item = Demand>> Demands for I {
    type Error = Infallible;

    fn advance(&mut self, demand: &mut Demand) -> Result<bool, Infallible> {
        let next = self.next();
        Ok(next.map(|next| *demand = next).is_some())
    }
}
