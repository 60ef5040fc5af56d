// Interpolation among the four corners, by the profile's rule. See isa/src/filter.rs.

// The weights of the corners (0,0), (1,0), (0,1), (1,1): products in 1/2^(2·bits), or where they
// are factored one rounded product and its complements in 1/2^bits.
fn corner_weights(rule: u32, fractions: vec2<u32>, bits: u32) -> vec4<i32> {
    let one = 1i << bits;
    let x = bitcast<i32>(fractions.x);
    let y = bitcast<i32>(fractions.y);
    if (rule == FILTER_FACTORED) {
        let both = (x * y + one / 2) >> bits;
        return vec4<i32>(one - x - y + both, x - both, y - both, both);
    }
    return vec4<i32>(one - x, x, one - x, x) * vec4<i32>(one - y, one - y, y, y);
}

// Between two inputs at fraction/2^bits, rounded: by a shift, or where the weights are
// k/(2^bits − 1) to the nearest quotient, which has no ties.
fn linear(rule: u32, ends: vec2<i32>, fraction: u32, bits: u32, mode: u32) -> i32 {
    let weight = bitcast<i32>(fraction);
    if (rule == FILTER_ALL_ONES) {
        let ones = (1i << bits) - 1;
        let sum = ends.x * (ones - weight) + ends.y * weight + ones / 2;
        return (sum - euclid(sum, ones)) / ones;
    }
    return rounding_shift(mode, ends.x * ((1i << bits) - weight) + ends.y * weight, bits);
}

// An interpolated latent as an input. `values` are those of the corners; the fractions have
// `fraction_bits` bits, few enough that no sum leaves 31: see LERP_FRACTION_BITS in src/variant.rs.
fn lerp_input(
    rule: u32, values: vec4<i32>, fractions: vec2<u32>, fraction_bits: u32, bits: u32,
    input_bits: u32, mode: u32,
) -> i32 {
    if (rule == FILTER_EXACT || rule == FILTER_FACTORED) {
        let weighted = values * corner_weights(rule, fractions, fraction_bits);
        let sum = weighted.x + weighted.y + weighted.z + weighted.w;
        let sum_bits = select(2u * fraction_bits, fraction_bits, rule == FILTER_FACTORED);
        return fixed_to_input(sum, bits + sum_bits, input_bits, mode);
    }
    let corners = vec4<i32>(
        corner_input(values.x, bits, input_bits, mode),
        corner_input(values.y, bits, input_bits, mode),
        corner_input(values.z, bits, input_bits, mode),
        corner_input(values.w, bits, input_bits, mode),
    );
    let top = linear(rule, corners.xy, fractions.x, fraction_bits, mode);
    let bottom = linear(rule, corners.zw, fractions.x, fraction_bits, mode);
    let result = linear(rule, vec2<i32>(top, bottom), fractions.y, fraction_bits, mode);
    let range = signed_range(input_bits);
    return clamp(result, range.x, range.y);
}

// Writes the interpolated latents of a grid as inputs; gives the lane after them.
fn lerp(grid: u32, corners: Corners, lane: u32) -> u32 {
    let fractions = vec2<u32>(corners.x.phase, corners.y.phase) << vec2<u32>(
        LERP_FRACTION_BITS - PHASE_BITS, LERP_FRACTION_BITS - PHASE_BITS,
    );
    let addresses = corner_addresses(grid, corners);
    let channels = header.grids[grid].channels;
    let bits = header.grids[grid].bits;
    for (var channel = 0u; channel < channels; channel++) {
        let values = vec4<i32>(
            latent_value(fetch(grid, addresses.x, channel, 0u), bits),
            latent_value(fetch(grid, addresses.y, channel, 1u), bits),
            latent_value(fetch(grid, addresses.z, channel, 2u), bits),
            latent_value(fetch(grid, addresses.w, channel, 3u), bits),
        );
        write_input(lane + channel, lerp_input(
            PROFILE_INTERPOLATE, values, fractions, LERP_FRACTION_BITS, bits, INPUT_BITS,
            PROFILE_INPUT,
        ));
    }
    return lane + channels;
}
