// Probe: single functions of the stages, for tests. One case an invocation.

@group(0) @binding(10) var<storage, read> cases: array<vec4<u32>>;
@group(0) @binding(11) var<storage, read_write> answers: array<vec4<i32>>;

// Rows of workgroups that fill the dispatch.
fn case_index(id: vec3<u32>, groups: vec3<u32>) -> u32 {
    return id.y * groups.x * WORKGROUP + id.x;
}

// value low, value high, shift, mode: the quotient's words; and the 32-bit twin of the low word.
@compute @workgroup_size(WORKGROUP)
fn probe_round(
    @builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = case_index(id, groups);
    if (index >= arrayLength(&cases)) {
        return;
    }
    let c = cases[index];
    let long = rounding_shift_wide(c.w, Wide(c.x, c.y), c.z);
    let short = rounding_shift(c.w, bitcast<i32>(c.x), c.z & 31u);
    let saturated = wide_saturate(Wide(c.x, c.y));
    answers[index] = vec4<i32>(bitcast<i32>(long.low), bitcast<i32>(long.high), short, saturated);
}

// value, mantissa, shift, requantizer.
@compute @workgroup_size(WORKGROUP)
fn probe_rescale(
    @builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = case_index(id, groups);
    if (index >= arrayLength(&cases)) {
        return;
    }
    let c = cases[index];
    answers[index] = vec4<i32>(requantizer_apply(c.w, bitcast<i32>(c.x), c.y, c.z), 0, 0, 0);
}

// texel, mip, scale | snap << 8 | address mode << 16, grid size: first, phase, both corners.
@compute @workgroup_size(WORKGROUP)
fn probe_position(
    @builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = case_index(id, groups);
    if (index >= arrayLength(&cases)) {
        return;
    }
    let c = cases[index];
    let axis = axis_position(c.x, c.y, c.z & 0xffu, (c.z >> 8u) & 0xffu);
    let corners = bitcast<vec2<i32>>(axis_corners(axis, c.w, c.z >> 16u));
    answers[index] = vec4<i32>(axis.first, bitcast<i32>(axis.phase), corners.x, corners.y);
}

// phases: the four weights.
@compute @workgroup_size(WORKGROUP)
fn probe_interpolate(
    @builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = case_index(id, groups);
    if (index >= arrayLength(&cases)) {
        return;
    }
    answers[index] = corner_weights(cases[index].x, cases[index].y);
}

// two words, bit offset, bits: the code and its value.
@compute @workgroup_size(WORKGROUP)
fn probe_unpack(
    @builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = case_index(id, groups);
    if (index >= arrayLength(&cases)) {
        return;
    }
    let c = cases[index];
    let code = unpack(c.x, c.y, c.z, c.w);
    answers[index] = vec4<i32>(bitcast<i32>(code), latent_value(code, c.w), 0, 0);
}

// value or sum, bits, mode: corner and interpolated input.
@compute @workgroup_size(WORKGROUP)
fn probe_input(
    @builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = case_index(id, groups);
    if (index >= arrayLength(&cases)) {
        return;
    }
    let c = cases[index];
    let value = bitcast<i32>(c.x);
    answers[index] = vec4<i32>(corner_input(value, c.y, c.z), lerp_input(value, c.y, c.z), 0, 0);
}

// texel, mip, octave, mip count: both waves and the level.
@compute @workgroup_size(WORKGROUP)
fn probe_embed(
    @builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = case_index(id, groups);
    if (index >= arrayLength(&cases)) {
        return;
    }
    let c = cases[index];
    answers[index] = vec4<i32>(
        wave_input(c.x, c.y, c.z, false), wave_input(c.x, c.y, c.z, true), level_input(c.y, c.w), 0,
    );
}

// accumulator, leak shift, mode: the leak; and the gate of the accumulator cut to its range.
@compute @workgroup_size(WORKGROUP)
fn probe_activation(
    @builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = case_index(id, groups);
    if (index >= arrayLength(&cases)) {
        return;
    }
    let c = cases[index];
    let value = bitcast<i32>(c.x);
    answers[index] = vec4<i32>(leak(value, c.y, c.z), gate(clamp(value, GATE_MIN, GATE_MAX)), 0, 0);
}

// rescaled, skip, zero point: the activation. And the dot product of sixteen copies of two bytes.
@compute @workgroup_size(WORKGROUP)
fn probe_layer(
    @builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = case_index(id, groups);
    if (index >= arrayLength(&cases)) {
        return;
    }
    let c = cases[index];
    let activation = to_activation(bitcast<i32>(c.x), bitcast<i32>(c.y), bitcast<i32>(c.z));
    // One pair of words in each place, and zero in the others.
    let a = vec4<u32>(c.x, 0u, c.y, 0u);
    let b = vec4<u32>(c.w, c.w, c.w, c.w);
    answers[index] = vec4<i32>(activation, dot16(a, b), 0, 0);
}
