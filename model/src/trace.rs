//! Trace: the addresses that a run on values touched, for the run on cycles.
//!
//! This is the only wire between [`exec`](crate::exec) and `time`; neither imports the other.

use crate::place::Place;

/// One `fetch` instruction of one texel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fetch {
    /// Grid 0 or 1.
    pub grid: u8,
    /// The address of the first byte of each corner's cell: (0,0), (1,0), (0,1), (1,1).
    pub addresses: [u64; 4],
    /// Bytes of a cell, or of its part in one plane.
    pub cell_bytes: u32,
    /// Planes that a cell lies in: 1 where its channels are stored together.
    pub planes: u32,
    /// From a cell's part in one plane to its part in the next, in bytes.
    pub plane_bytes: u64,
}

/// Where a decode touches memory: what a run on values tells a run on cycles.
pub trait Addresses {
    /// Adds the fetches that the decode of a place makes, in the order of the program.
    fn fetches(&self, place: &Place, fetches: &mut Vec<Fetch>);

    /// Bytes from address 0 on that fetches can touch.
    fn bytes(&self) -> u64;

    /// Columns and rows of a mip's texels.
    fn mip_size(&self, mip: u8) -> (u32, u32);
}

/// The fetches of a run of texels, in request order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Trace {
    fetches: Vec<Fetch>,
    /// Where each texel's fetches end.
    ends: Vec<usize>,
}

impl Trace {
    /// A trace of no texels.
    #[must_use]
    pub fn new() -> Trace {
        Trace::default()
    }

    /// Records a fetch of the texel under way.
    pub fn fetch(&mut self, fetch: Fetch) {
        self.fetches.push(fetch);
    }

    /// Ends the texel under way.
    pub fn end_texel(&mut self) {
        self.ends.push(self.fetches.len());
    }

    /// Texels recorded.
    #[must_use]
    pub fn texel_count(&self) -> usize {
        self.ends.len()
    }

    /// The fetches of one texel. `texel` is below [`Trace::texel_count`].
    #[must_use]
    pub fn texel(&self, texel: usize) -> &[Fetch] {
        let start = if texel == 0 { 0 } else { self.ends[texel - 1] };
        &self.fetches[start..self.ends[texel]]
    }

    /// The fetches texel by texel.
    pub fn texels(&self) -> impl Iterator<Item = &[Fetch]> {
        (0..self.texel_count()).map(|texel| self.texel(texel))
    }
}
