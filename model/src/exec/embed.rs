//! Embed: corners, waves and level as inputs of the synthesizer.

use crate::request::Request;
use ntmu_isa::Asset;
use ntmu_isa::embed::{corner_input, level_input, wave_input};

/// Writes the four corners one after the other; gives the number of inputs.
pub(super) fn concat(asset: &Asset, grid: usize, codes: &[u8], lanes: &mut [i16]) -> usize {
    let format = asset.shape.grids[grid].format;
    for (lane, &code) in lanes.iter_mut().zip(codes) {
        *lane = corner_input(format.value(code), format, asset.profile.input) as i16;
    }
    codes.len()
}

/// Writes the waves: octave by octave, x then y, phase 0 then a quarter; gives their number.
pub(super) fn waves(request: Request, octaves: u16, lanes: &mut [i16]) -> usize {
    let mut written = 0;
    for octave in 0..octaves as u8 {
        for texel in [request.x(), request.y()] {
            for quarter in [false, true] {
                lanes[written] = wave_input(texel, request.mip(), octave, quarter) as i16;
                written += 1;
            }
        }
    }
    written
}

pub(super) fn level(request: Request, mip_count: u8) -> i16 {
    level_input(request.mip(), mip_count) as i16
}
