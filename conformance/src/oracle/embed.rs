//! What enters the synthesizer, in reals: latents, waves, level, zeros.
//!
//! Paper, sections "Grid Constructors" (range of a latent), "Grid sampler" (concatenation of grid 0,
//! interpolation of grid 1) and "Text synthesis" (normalised mip, positional encoding). Which grid is
//! concatenated and which interpolated, and the form of the waves, is the asset's.

use super::number::signed;
use super::position::{RealAxis, RealLevel};
use ntmu_isa::embed::Wave;
use ntmu_isa::filter::FilterRule;
use ntmu_isa::profile::Profile;
use ntmu_isa::shape::{Sampling, Shape};
use ntmu_model::Request;

/// All inputs of a texel: both grids, the waves, the level, zeros; in units of 1/2^(A−1) for
/// inputs of A bits, clamped to A bits.
///
/// `grids` are the codes as an asset keeps them: levels of rows of cells, cells of channels. Of the profile
/// only the meaning of a fraction is taken, see [`fraction`].
#[must_use]
pub fn inputs(
    shape: &Shape,
    profile: &Profile,
    grids: &[Vec<u8>; 2],
    request: Request,
) -> Vec<f64> {
    let mut lanes = Vec::with_capacity(shape.input_count() as usize);
    for (grid, sizes) in shape.grids.iter().enumerate() {
        let square = Square::of(shape, grids, grid, request);
        match sizes.sampling {
            Sampling::Corners => lanes.extend(square.corners.iter().flatten()),
            Sampling::Interpolated => lanes.extend(square.interpolated(profile)),
        }
    }
    for octave in 0..shape.octaves {
        for texel in [request.x(), request.y()] {
            for phase in [0.0, 0.25] {
                lanes.push(wave(shape.wave, texel, request.mip(), octave, phase));
            }
        }
    }
    let (low, high) = signed(shape.input_bits);
    // The last mip is the largest input.
    lanes.push(level(request.mip(), shape.mip_count) * high / -low);
    lanes.extend(vec![0.0; usize::from(shape.padding)]);
    lanes
        .iter()
        .map(|real| (real * -low).clamp(low, high))
        .collect()
}

/// The four corners around a texel centre in one grid, of the level that serves its mip.
#[derive(Clone, Debug, PartialEq)]
pub struct Square {
    /// From the first towards the second corner, along x and y: sixteenths.
    pub fractions: [f64; 2],
    /// The real latents of the corners (0,0), (1,0), (0,1), (1,1).
    pub corners: [Vec<f64>; 4],
}

impl Square {
    /// The corners of a texel.
    #[must_use]
    pub fn of(shape: &Shape, grids: &[Vec<u8>; 2], grid: usize, request: Request) -> Square {
        let level = RealLevel::of(shape.pyramid, request.mip());
        let scale = level.scale_log2(shape, grid);
        let [cells_x, cells_y] = level.cells(shape, grid);
        let base = level.base(shape, grid);
        let x = RealAxis::of(request.x(), request.mip(), scale, shape.snap);
        let y = RealAxis::of(request.y(), request.mip(), scale, shape.snap);
        let columns = x.cells(cells_x, shape.address_mode);
        let rows = y.cells(cells_y, shape.address_mode);
        let channels = usize::from(shape.grids[grid].channels);
        let bits = shape.grids[grid].format.bits();
        let corners = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(right, below): (usize, usize)| {
            let cell = base + rows[below] as usize * cells_x as usize + columns[right] as usize;
            let codes = &grids[grid][cell * channels..(cell + 1) * channels];
            codes.iter().map(|&code| latent(code, bits)).collect()
        });
        Square {
            fractions: [x.fraction, y.fraction],
            corners,
        }
    }

    /// One latent a channel: the bilinear sum.
    #[must_use]
    pub fn interpolated(&self, profile: &Profile) -> Vec<f64> {
        let [x, y] = self.fractions.map(|f| fraction(profile, f));
        let weights = [(1.0 - x) * (1.0 - y), x * (1.0 - y), (1.0 - x) * y, x * y];
        (0..self.corners[0].len())
            .map(|channel| {
                let terms = weights.iter().zip(&self.corners);
                terms.map(|(weight, corner)| weight * corner[channel]).sum()
            })
            .collect()
    }
}

/// What a fraction means as a weight: itself; by the rule of all ones, in b bits, k / (2^b − 1).
/// That is how the rule defines its weights, no rounding of a result.
#[must_use]
pub fn fraction(profile: &Profile, fraction: f64) -> f64 {
    match profile.interpolate {
        FilterRule::Exact | FilterRule::Factored | FilterRule::Separable => fraction,
        FilterRule::AllOnes => {
            let steps = 2_f64.powi(i32::from(profile.subtexel_bits));
            fraction * steps / (steps - 1.0)
        }
    }
}

/// The real of a code of B bits: (code − z) / 2^B with z = 2^(B−1) − 1, which is the paper's range
/// −(2^B − 1)/2^(B+1) to ½ with zero representable.
#[must_use]
pub fn latent(code: u8, bits: u8) -> f64 {
    let steps = 2_f64.powi(i32::from(bits));
    (f64::from(code) - (steps / 2.0 - 1.0)) / steps
}

/// The wave of the texel's place in its 8×8 tile of mip 0: the triangle 4·|f − ½| − 1, or the saw
/// 2·f − 1.
#[must_use]
pub fn wave(form: Wave, texel: u32, mip: u8, octave: u8, phase: f64) -> f64 {
    let place = (f64::from(texel) + 0.5) * 2_f64.powi(i32::from(mip)) / 8.0;
    let turns = place * 2_f64.powi(i32::from(octave)) + phase;
    let f = turns - turns.floor();
    match form {
        Wave::Triangle => 4.0 * (f - 0.5).abs() - 1.0,
        Wave::Saw => 2.0 * f - 1.0,
    }
}

/// The normalised mip m/M; 0 where M is 0.
#[must_use]
pub fn level(mip: u8, mip_count: u8) -> f64 {
    if mip_count == 1 {
        0.0
    } else {
        f64::from(mip) / f64::from(mip_count - 1)
    }
}
