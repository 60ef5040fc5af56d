//! Batch: the synthesizer alone, on inputs that the caller brings.

use super::kernel::{Sums, TILE};
use super::lane::Lane;
use super::register::Register;
use super::tile::TileScratch;
use super::{Engine, Inputs};
use ntmu_isa::limits::MAX_LANES;
use rayon::prelude::*;

/// Tiles that one thread computes at a time.
const CHUNK_TILES: usize = 32;

/// Inputs of the synthesizer in the order in which the engine reads them.
#[derive(Clone, Debug)]
pub struct Blocked {
    tiles: Vec<Register>,
    texels: usize,
}

/// Channel codes in the order in which the engine makes them: tiles of 64 texels, channel after
/// channel, and the texels of a channel side by side. What the last tile has too many is no code.
#[derive(Clone, Debug)]
pub struct Planar {
    /// \[tile\]\[channel\].
    pub tiles: Vec<Sums>,
    /// Channels.
    pub channels: usize,
}

mod sealed {
    pub trait Sealed {}
    impl Sealed for i8 {}
    impl Sealed for i16 {}
}

/// What an input of the synthesizer may come as: `i8` or `i16`.
pub trait Input: sealed::Sealed + Copy + Sync {
    /// The number.
    fn value(self) -> i32;

    /// The same numbers, if they are bytes.
    fn as_bytes(inputs: &[Self]) -> Option<&[i8]>;
}

impl Input for i8 {
    fn value(self) -> i32 {
        i32::from(self)
    }

    fn as_bytes(inputs: &[i8]) -> Option<&[i8]> {
        Some(inputs)
    }
}

impl Input for i16 {
    fn value(self) -> i32 {
        i32::from(self)
    }

    fn as_bytes(_: &[i16]) -> Option<&[i8]> {
        None
    }
}

impl Engine<'_> {
    /// Writes the channel codes, \[texel\]\[channel\], of synthesizer inputs, \[texel\]\[input\],
    /// which are within the shape's input bits.
    ///
    /// # Panics
    /// When the inputs are no whole number of texels, or the codes not those of as many.
    pub fn synthesize<I: Input>(&self, inputs: &[I], codes: &mut [i32]) {
        let count = self.asset.shape.input_count() as usize;
        let channels = self.asset.shape.outputs.len();
        assert_eq!(inputs.len() % count, 0, "inputs of whole texels");
        assert_eq!(inputs.len() / count * channels, codes.len(), "codes");
        inputs
            .par_chunks(CHUNK_TILES * TILE * count)
            .zip(codes.par_chunks_mut(CHUNK_TILES * TILE * channels))
            .for_each(|(inputs, codes)| self.chunk(inputs, codes));
    }

    fn chunk<I: Input>(&self, inputs: &[I], codes: &mut [i32]) {
        let count = self.asset.shape.input_count() as usize;
        let channels = self.asset.shape.outputs.len();
        let mut scratch = TileScratch::new(self);
        let tiles = inputs.chunks(TILE * count);
        for (inputs, codes) in tiles.zip(codes.chunks_mut(TILE * channels)) {
            self.bring(inputs, scratch.inputs());
            self.tile(&mut scratch);
            // A channel's codes lie side by side in the tile, a texel's in the result.
            for (texel, codes) in codes.chunks_exact_mut(channels).enumerate() {
                for (code, sums) in codes.iter_mut().zip(scratch.codes()) {
                    *code = sums.0[texel];
                }
            }
        }
    }

    /// The inputs of up to a tile of texels.
    fn bring<I: Input>(&self, inputs: &[I], register: &mut Register) {
        let count = self.asset.shape.input_count() as usize;
        match (&self.inputs, I::as_bytes(inputs)) {
            (Inputs::Bytes(_), Some(bytes)) => {
                self.kernels.bring(bytes, count, &mut register.quads)
            }
            (Inputs::Bytes(_), None) => bring::<u8, I>(inputs, count, &mut register.quads),
            (Inputs::Words(_), _) => bring::<i16, I>(inputs, count, &mut register.pairs),
        }
    }

    /// Inputs, \[texel\]\[input\], in the engine's own order.
    ///
    /// # Panics
    /// When the inputs are no whole number of texels.
    #[must_use]
    pub fn block_inputs<I: Input>(&self, inputs: &[I]) -> Blocked {
        let count = self.asset.shape.input_count() as usize;
        assert_eq!(inputs.len() % count, 0, "inputs of whole texels");
        let tiles = inputs.chunks(TILE * count).map(|inputs| {
            let mut register = Register::inputs(self.widths);
            self.bring(inputs, &mut register);
            register
        });
        Blocked {
            tiles: tiles.collect(),
            texels: inputs.len() / count,
        }
    }

    /// Room for the codes of [`Engine::synthesize_blocked`].
    #[must_use]
    pub fn planar(&self, inputs: &Blocked) -> Planar {
        let channels = self.asset.shape.outputs.len();
        Planar {
            tiles: vec![Sums::ZERO; inputs.tiles.len() * channels],
            channels,
        }
    }

    /// The codes of inputs, both in the engine's own order: what a renderer that keeps to that order
    /// pays.
    ///
    /// # Panics
    /// When the codes have not the room that [`Engine::planar`] makes for these inputs.
    pub fn synthesize_blocked(&self, inputs: &Blocked, codes: &mut Planar) {
        let channels = self.asset.shape.outputs.len();
        assert_eq!(codes.tiles.len(), inputs.tiles.len() * channels, "codes");
        inputs
            .tiles
            .par_chunks(CHUNK_TILES)
            .zip(codes.tiles.par_chunks_mut(CHUNK_TILES * channels))
            .for_each(|(tiles, codes)| {
                let mut scratch = TileScratch::new(self);
                for (tile, codes) in tiles.iter().zip(codes.chunks_exact_mut(channels)) {
                    scratch.inputs().copy(tile);
                    self.tile(&mut scratch);
                    codes.copy_from_slice(&scratch.codes()[..channels]);
                }
            });
    }
}

impl Blocked {
    /// Texels.
    #[must_use]
    pub fn texels(&self) -> usize {
        self.texels
    }
}

impl Planar {
    /// One code.
    ///
    /// # Panics
    /// When there is no such texel or channel.
    #[must_use]
    pub fn code(&self, texel: usize, channel: usize) -> i32 {
        self.tiles[texel / TILE * self.channels + channel].0[texel % TILE]
    }
}

/// Writes the inputs of texels in order, as lanes of a tile.
fn bring<L: Lane, I: Input>(inputs: &[I], count: usize, groups: &mut [L::Group]) {
    let mut lanes = [L::ZERO; MAX_LANES as usize];
    let lanes = &mut lanes[..count];
    for (texel, inputs) in inputs.chunks_exact(count).enumerate() {
        for (lane, &input) in lanes.iter_mut().zip(inputs) {
            *lane = L::of(input.value());
        }
        L::put(groups, texel, lanes);
    }
}
