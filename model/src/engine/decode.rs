//! Decode: what the sampler asks for, texels and places anywhere, a tile at a time.

use super::kernel::TILE;
use super::tile::TileScratch;
use super::{Engine, Inputs};
use crate::place::Place;
use crate::request::Request;
use crate::sampler::Decode;
use ntmu_isa::limits::MAX_LANES;
use ntmu_isa::profile::Profile;
use ntmu_isa::shape::Shape;

impl Engine<'_> {
    /// The channel codes of any place: those of `exec::Decoder::place`. The place must come from the
    /// asset's own shape.
    #[must_use]
    pub fn place(&self, place: &Place) -> Vec<i32> {
        let mut codes = self.places(std::slice::from_ref(place));
        codes.pop().unwrap_or_default()
    }

    /// The codes of items that `put` embeds as a texel of a tile.
    fn tiles<T>(&self, items: &[T], put: impl Fn(&mut TileScratch, usize, &T)) -> Vec<Vec<i32>> {
        let channels = self.asset.shape.outputs.len();
        let mut scratch = TileScratch::new(self);
        let mut codes = Vec::with_capacity(items.len());
        for items in items.chunks(TILE) {
            for (at, item) in items.iter().enumerate() {
                put(&mut scratch, at, item);
            }
            self.tile(&mut scratch);
            let rows = &scratch.codes()[..channels];
            codes.extend((0..items.len()).map(|at| rows.iter().map(|row| row.0[at]).collect()));
        }
        codes
    }

    /// Embeds one place.
    fn put_place(&self, scratch: &mut TileScratch, at: usize, place: &Place) {
        let count = self.asset.shape.input_count() as usize;
        match &self.inputs {
            Inputs::Bytes(embed) => {
                let mut lanes = [0; MAX_LANES as usize];
                embed.place(self.asset, place, &mut lanes[..count]);
                scratch.put_bytes(at, &lanes[..count]);
            }
            Inputs::Words(embed) => {
                let mut lanes = [0; MAX_LANES as usize];
                embed.place(self.asset, place, &mut lanes[..count]);
                scratch.put_words(at, &lanes[..count]);
            }
        }
    }
}

impl Decode for Engine<'_> {
    fn shape(&self) -> &Shape {
        &self.asset.shape
    }

    fn profile(&self) -> &Profile {
        &self.asset.profile
    }

    fn texels(&self, requests: &[Request]) -> Vec<Vec<i32>> {
        self.tiles(requests, |scratch, at, request| {
            self.put_texel(scratch, at, (request.x(), request.y(), request.mip()));
        })
    }

    fn places(&self, places: &[Place]) -> Vec<Vec<i32>> {
        self.tiles(places, |scratch, at, place| {
            self.put_place(scratch, at, place)
        })
    }
}
