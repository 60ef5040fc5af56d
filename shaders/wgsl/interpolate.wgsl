// Interpolation: exact in full width. See isa/src/position.rs, `corner_weights`.

// The weights of the corners (0,0), (1,0), (0,1), (1,1), in 1/256.
fn corner_weights(x_phase: u32, y_phase: u32) -> vec4<i32> {
    let one = 1i << PHASE_BITS;
    let x = bitcast<i32>(x_phase);
    let y = bitcast<i32>(y_phase);
    return vec4<i32>(one - x, x, one - x, x) * vec4<i32>(one - y, one - y, y, y);
}

// Writes the interpolated latents of a grid as inputs; gives the lane after them.
fn lerp(grid: u32, corners: Corners, lane: u32) -> u32 {
    let weights = corner_weights(corners.x.phase, corners.y.phase);
    let addresses = corner_addresses(grid, corners);
    let channels = header.grids[grid].channels;
    let bits = header.grids[grid].bits;
    for (var channel = 0u; channel < channels; channel++) {
        var sum = 0i;
        for (var corner = 0u; corner < 4u; corner++) {
            let code = fetch(grid, addresses[corner], channel, corner);
            sum += weights[corner] * latent_value(code, bits);
        }
        write_input(lane + channel, lerp_input(sum, bits, PROFILE_INPUT));
    }
    return lane + channels;
}
