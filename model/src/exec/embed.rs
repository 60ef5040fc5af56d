//! Embed: corners, waves and level as inputs of the synthesizer.

use crate::place::Place;
use ntmu_isa::Asset;
use ntmu_isa::embed::{Wave, corner_input, level_at, wave_at};
use ntmu_isa::shape::Shape;

/// Writes the four corners one after the other; gives the number of inputs.
pub(super) fn concat(asset: &Asset, grid: usize, codes: &[u8], lanes: &mut [i16]) -> usize {
    let (format, bits) = (asset.shape.grids[grid].format, asset.shape.input_bits);
    for (lane, &code) in lanes.iter_mut().zip(codes) {
        *lane = corner_input(format.value(code), format, bits, asset.profile.input) as i16;
    }
    codes.len()
}

/// Writes the waves: octave by octave, x then y, phase 0 then a quarter; gives their number.
pub(super) fn waves(
    wave: Wave,
    shape: &Shape,
    place: &Place,
    octaves: u16,
    lanes: &mut [i16],
) -> usize {
    let (bits, mip) = (place.bits(), place.mip());
    let mut written = 0;
    for octave in 0..octaves as u8 {
        for coordinate in [place.x(), place.y()] {
            for quarter in [false, true] {
                let input = wave_at(
                    wave,
                    coordinate,
                    bits,
                    mip,
                    octave,
                    quarter,
                    shape.input_bits,
                );
                lanes[written] = input as i16;
                written += 1;
            }
        }
    }
    written
}

pub(super) fn level(shape: &Shape, place: &Place) -> i16 {
    let (lod, lod_bits) = (place.lod(), place.lod_bits());
    level_at(lod, lod_bits, shape.mip_count, shape.input_bits) as i16
}
