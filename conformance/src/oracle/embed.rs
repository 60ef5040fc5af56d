//! What enters the synthesizer, in reals: latents, waves, level.
//!
//! Paper, sections "Grid Constructors" (range of a latent), "Grid sampler" (concatenation of grid 0,
//! interpolation of grid 1) and "Text synthesis" (normalised mip, positional encoding).

use super::position::RealAxis;
use ntmu_isa::shape::Shape;
use ntmu_model::Request;

/// An input of 1.0 is 128 units.
const UNITS: f64 = 128.0;

/// All inputs of a texel in units of 1/128: the corners of grid 0 one after the other, grid 1
/// interpolated, the waves, the level; clamped to −128..=127.
///
/// `grids` are the codes as an asset keeps them: rows of cells, cells of channels.
#[must_use]
pub fn inputs(shape: &Shape, grids: &[Vec<u8>; 2], request: Request) -> Vec<f64> {
    let mut lanes = Vec::with_capacity(shape.input_count() as usize);
    for (_, latents) in corners(shape, grids, 0, request) {
        lanes.extend(latents);
    }
    let mut interpolated = vec![0.0; usize::from(shape.grids[1].channels)];
    for (weight, latents) in corners(shape, grids, 1, request) {
        for (sum, latent) in interpolated.iter_mut().zip(latents) {
            *sum += weight * latent;
        }
    }
    lanes.extend(interpolated);
    for octave in 0..shape.octaves {
        for texel in [request.x(), request.y()] {
            lanes.push(wave(texel, request.mip(), octave, 0.0));
            lanes.push(wave(texel, request.mip(), octave, 0.25));
        }
    }
    lanes.push(level(request.mip(), shape.mip_count));
    lanes
        .iter()
        .map(|real| (real * UNITS).clamp(-128.0, 127.0))
        .collect()
}

/// The weight and the real latents of the corners (0,0), (1,0), (0,1), (1,1) of a grid.
fn corners(
    shape: &Shape,
    grids: &[Vec<u8>; 2],
    grid: usize,
    request: Request,
) -> Vec<(f64, Vec<f64>)> {
    let scale = shape.grids[grid].scale_log2;
    let (cells_x, cells_y) = shape.grid_size(grid);
    let x = RealAxis::of(request.x(), request.mip(), scale, shape.snap);
    let y = RealAxis::of(request.y(), request.mip(), scale, shape.snap);
    let columns = x.cells(cells_x, shape.address_mode);
    let rows = y.cells(cells_y, shape.address_mode);
    let weights_x = [1.0 - x.fraction, x.fraction];
    let weights_y = [1.0 - y.fraction, y.fraction];
    let channels = usize::from(shape.grids[grid].channels);
    let bits = shape.grids[grid].format.bits();
    [(0, 0), (1, 0), (0, 1), (1, 1)]
        .into_iter()
        .map(|(right, below)| {
            let cell = rows[below] as usize * cells_x as usize + columns[right] as usize;
            let codes = &grids[grid][cell * channels..(cell + 1) * channels];
            let latents = codes.iter().map(|&code| latent(code, bits)).collect();
            (weights_x[right] * weights_y[below], latents)
        })
        .collect()
}

/// The real of a code of B bits: (code − z) / 2^B with z = 2^(B−1) − 1, which is the paper's range
/// −(2^B − 1)/2^(B+1) to ½ with zero representable.
#[must_use]
pub fn latent(code: u8, bits: u8) -> f64 {
    let steps = 2_f64.powi(i32::from(bits));
    (f64::from(code) - (steps / 2.0 - 1.0)) / steps
}

/// The triangle wave 4·|f − ½| − 1 of the texel's place in its 8×8 tile of mip 0.
#[must_use]
pub fn wave(texel: u32, mip: u8, octave: u8, phase: f64) -> f64 {
    let place = (f64::from(texel) + 0.5) * 2_f64.powi(i32::from(mip)) / 8.0;
    let turns = place * 2_f64.powi(i32::from(octave)) + phase;
    let f = turns - turns.floor();
    4.0 * (f - 0.5).abs() - 1.0
}

/// The normalised mip m/M, scaled so that the last mip is the largest input, 127/128.
#[must_use]
pub fn level(mip: u8, mip_count: u8) -> f64 {
    if mip_count == 1 {
        0.0
    } else {
        127.0 * f64::from(mip) / f64::from(mip_count - 1) / UNITS
    }
}
