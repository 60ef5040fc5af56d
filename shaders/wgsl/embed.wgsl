// Embedding: the integers that enter the synthesizer. See isa/src/embed.rs.

// A number with `fraction_bits` fractional bits as an input of `input_bits` bits, which has one
// fewer; saturated.
fn fixed_to_input(value: i32, fraction_bits: u32, input_bits: u32, mode: u32) -> i32 {
    let target_bits = input_bits - 1u;
    var scaled = 0i;
    if (fraction_bits <= target_bits) {
        scaled = value << (target_bits - fraction_bits);
    } else {
        scaled = rounding_shift(mode, value, fraction_bits - target_bits);
    }
    let range = signed_range(input_bits);
    return clamp(scaled, range.x, range.y);
}

fn corner_input(value: i32, bits: u32, input_bits: u32, mode: u32) -> i32 {
    return fixed_to_input(value, bits, input_bits, mode);
}

// The wave of a texel's centre along one axis, of which a period has sixteen half-texels of mip 0,
// halved by each octave. Exact, but for a triangle's 1.
fn wave_input(
    wave: u32, texel: u32, mip: u32, octave: u32, quarter: bool, input_bits: u32,
) -> i32 {
    let place = (((texel << 1u) | 1u) << (mip + octave)) + select(0u, 4u, quarter);
    let fraction = bitcast<i32>(place & 15u);
    // In eighths: of a period's fraction f, 4·|f − 1/2| − 1 or 2·f − 1.
    let eighths = select(abs(fraction - 8) * 2 - 8, fraction - 8, wave == WAVE_SAW);
    return fixed_to_input(eighths, 3u, input_bits, ROUNDING_FLOOR);
}

// The largest input times mip/(mip_count − 1), ties up; 0 in a chain of one mip.
fn level_input(mip: u32, mip_count: u32, input_bits: u32) -> i32 {
    if (mip_count <= 1u) {
        return 0;
    }
    let last = mip_count - 1u;
    let largest = (1u << (input_bits - 1u)) - 1u;
    return bitcast<i32>((2u * largest * mip + last) / (2u * last));
}

// Writes what a grid gives; gives the lane after it.
fn sample(grid: u32, sampling: u32, corners: Corners, lane: u32) -> u32 {
    if (sampling == SAMPLING_CORNERS) {
        return concat(grid, corners, lane);
    }
    return lerp(grid, corners, lane);
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
            write_input(next, corner_input(value, bits, INPUT_BITS, PROFILE_INPUT));
            next++;
        }
    }
    return next;
}

// Writes the waves: octave by octave, x then y, phase 0 then a quarter; gives the lane after them.
fn waves(request: Request, lane: u32) -> u32 {
    for (var octave = 0u; octave < header.octaves; octave++) {
        let next = lane + WAVES_PER_OCTAVE * octave;
        write_wave(next, request.x, request.mip, octave, false);
        write_wave(next + 1u, request.x, request.mip, octave, true);
        write_wave(next + 2u, request.y, request.mip, octave, false);
        write_wave(next + 3u, request.y, request.mip, octave, true);
    }
    return lane + WAVES_PER_OCTAVE * header.octaves;
}

fn write_wave(lane: u32, texel: u32, mip: u32, octave: u32, quarter: bool) {
    write_input(lane, wave_input(header.wave, texel, mip, octave, quarter, INPUT_BITS));
}

// Writes the level; gives the lane after it.
fn level(request: Request, lane: u32) -> u32 {
    write_input(lane, level_input(request.mip, header.mip_count, INPUT_BITS));
    return lane + 1u;
}

// Writes the zeros after the level.
fn padding(lane: u32) {
    for (var zero = 0u; zero < header.padding; zero++) {
        write_input(lane + zero, 0);
    }
}
