// Embedding: the 8-bit integers that enter the synthesizer. See isa/src/embed.rs.

// A number with `fraction_bits` fractional bits, re-expressed with INPUT_FRACTION_BITS.
fn fixed_to_input(value: i32, fraction_bits: u32, mode: u32) -> i32 {
    var scaled = 0i;
    if (fraction_bits <= INPUT_FRACTION_BITS) {
        scaled = value << (INPUT_FRACTION_BITS - fraction_bits);
    } else {
        scaled = rounding_shift(mode, value, fraction_bits - INPUT_FRACTION_BITS);
    }
    return clamp(scaled, ACTIVATION_MIN, ACTIVATION_MAX);
}

fn corner_input(value: i32, bits: u32, mode: u32) -> i32 {
    return fixed_to_input(value, bits, mode);
}

fn lerp_input(sum: i32, bits: u32, mode: u32) -> i32 {
    return fixed_to_input(sum, bits + 2u * PHASE_BITS, mode);
}

// A triangle wave. An octave's period is 16 half-texels of mip 0, halved by each octave.
fn wave_input(texel: u32, mip: u32, octave: u32, quarter: bool) -> i32 {
    let place = (((texel << 1u) | 1u) << (mip + octave)) + select(0u, 4u, quarter);
    let distance = abs(bitcast<i32>(place & 15u) - 8);
    return clamp(distance * 32 - 128, ACTIVATION_MIN, ACTIVATION_MAX);
}

// 127·mip/(mip_count − 1), ties up; 0 in a chain of one mip.
fn level_input(mip: u32, mip_count: u32) -> i32 {
    if (mip_count <= 1u) {
        return 0;
    }
    let last = mip_count - 1u;
    return bitcast<i32>((254u * mip + last) / (2u * last));
}

// Writes the four corners of a grid one after the other; gives the lane after them.
fn concat(grid: u32, corners: Corners, lane: u32) -> u32 {
    let addresses = corner_addresses(grid, corners);
    let channels = header.grids[grid].channels;
    let bits = header.grids[grid].bits;
    var next = lane;
    for (var corner = 0u; corner < 4u; corner++) {
        for (var channel = 0u; channel < channels; channel++) {
            let value = latent_value(fetch(grid, addresses[corner], channel, corner), bits);
            write_input(next, corner_input(value, bits, PROFILE_INPUT));
            next++;
        }
    }
    return next;
}

// Writes the waves: octave by octave, x then y, phase 0 then a quarter; gives the lane after them.
fn waves(request: Request, lane: u32) -> u32 {
    for (var octave = 0u; octave < header.octaves; octave++) {
        let next = lane + WAVES_PER_OCTAVE * octave;
        write_input(next, wave_input(request.x, request.mip, octave, false));
        write_input(next + 1u, wave_input(request.x, request.mip, octave, true));
        write_input(next + 2u, wave_input(request.y, request.mip, octave, false));
        write_input(next + 3u, wave_input(request.y, request.mip, octave, true));
    }
    return lane + WAVES_PER_OCTAVE * header.octaves;
}

// Writes the level; gives the lane after it.
fn level(request: Request, lane: u32) -> u32 {
    write_input(lane, level_input(request.mip, header.mip_count));
    return lane + 1u;
}
