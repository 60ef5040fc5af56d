//! BC: what desktop GPUs decode. BC7 for three and four channels, BC5 for two (normals above all),
//! BC4 for one.
//!
//! Encoder and decoder are those of the crate `block_compression`, a port of Intel's ISPC texture
//! compressor, at its slowest setting. Codes go in and come out at 8 bits, as with hardware's BC7;
//! hardware keeps more bits of an interpolated BC4 or BC5 value, which is not modelled. A map of more
//! than 8 bits is rounded first.

use super::Coded;
use super::packing::{Packing, Scalars};
use crate::texture_set::TextureSet;
use block_compression::decode::decompress_blocks_as_rgba8;
use block_compression::encode::compress_rgba8;
use block_compression::{BC7Settings, CompressionVariant};
use ndarray::{Array3, ArrayView3};
use rayon::prelude::*;
use std::time::Instant;

/// Texels along a block's side.
const SIDE: usize = 4;

/// The encoder, as results name it.
pub const ENCODER: &str = "block_compression 0.11, slow";

/// The format for an image of 1 to 4 channels.
fn format(channels: usize) -> CompressionVariant {
    match channels {
        1 => CompressionVariant::BC4,
        2 => CompressionVariant::BC5,
        3 => CompressionVariant::BC7(BC7Settings::opaque_slow()),
        _ => CompressionVariant::BC7(BC7Settings::alpha_slow()),
    }
}

/// Codes a set and decodes it again. `after_image` hears of the images done and of all there are.
#[must_use]
pub fn code(
    set: &TextureSet,
    scalars: Scalars,
    after_image: &mut dyn FnMut(usize, usize),
) -> Coded {
    let packing = Packing::of(set, scalars);
    let total = packing.packs.len() * set.texels.len();
    let mut coded = Coded {
        mips: Vec::with_capacity(set.texels.len()),
        bits: Vec::with_capacity(set.texels.len()),
        packs: packing.words(),
        encoder: ENCODER.to_owned(),
        encode_seconds: 0.0,
        decode_seconds: 0.0,
    };
    let mut done = 0;
    for mip in &set.texels {
        let (_, height, width) = mip.dim();
        let mut images = Vec::with_capacity(packing.packs.len());
        let mut bits = 0;
        for pack in &packing.packs {
            let format = format(pack.channels.len());
            let started = Instant::now();
            let blocks = encode(pack.image(mip.view()).view(), format);
            coded.encode_seconds += started.elapsed().as_secs_f64();
            bits += 8 * blocks.iter().map(|row| row.len() as u64).sum::<u64>();
            let started = Instant::now();
            images.push(decode(&blocks, format, (height, width)));
            coded.decode_seconds += started.elapsed().as_secs_f64();
            done += 1;
            after_image(done, total);
        }
        coded.mips.push(packing.assemble(&images, (height, width)));
        coded.bits.push(bits);
    }
    coded
}

/// The blocks of an image, row of blocks by row of blocks. Blocks that lie across the right or lower
/// edge are filled with the edge's texels.
fn encode(image: ArrayView3<'_, f32>, format: CompressionVariant) -> Vec<Vec<u8>> {
    let (channels, height, width) = image.dim();
    let padded = width.next_multiple_of(SIDE);
    let rows = (0..height.div_ceil(SIDE)).into_par_iter();
    let blocks = rows.map(|row| {
        let mut codes = Vec::with_capacity(SIDE * padded * 4);
        for y in SIDE * row..SIDE * (row + 1) {
            for x in 0..padded {
                let at = |channel: usize| image[[channel, y.min(height - 1), x.min(width - 1)]];
                // Without an alpha, a block is opaque.
                codes.extend([0, 1, 2, 3].map(|channel| match channel < channels {
                    true => (at(channel) * 255.0).round() as u8,
                    false if channel == 3 => 255,
                    false => 0,
                }));
            }
        }
        let (width, height) = (padded as u32, SIDE as u32);
        let mut blocks = vec![0; format.blocks_byte_size(width, height)];
        compress_rgba8(format, &codes, &mut blocks, width, height, 4 * width);
        blocks
    });
    blocks.collect()
}

/// The image of these blocks: red, green, blue, alpha.
fn decode(
    blocks: &[Vec<u8>],
    format: CompressionVariant,
    (height, width): (usize, usize),
) -> Array3<f32> {
    let padded = width.next_multiple_of(SIDE);
    let rows: Vec<Vec<u8>> = blocks
        .par_iter()
        .map(|blocks| {
            let mut codes = vec![0; SIDE * padded * 4];
            decompress_blocks_as_rgba8(format, padded as u32, SIDE as u32, blocks, &mut codes);
            codes
        })
        .collect();
    Array3::from_shape_fn((4, height, width), |(channel, y, x)| {
        let texel = (y % SIDE) * padded + x;
        f32::from(rows[y / SIDE][4 * texel + channel]) / 255.0
    })
}
