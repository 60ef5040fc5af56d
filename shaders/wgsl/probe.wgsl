// Probe: single functions of the stages, for tests. One case an invocation. Those of fp16 layers are
// in probe_half.wgsl.

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

// pyramid, mip: the level, the mip in it.
@compute @workgroup_size(WORKGROUP)
fn probe_pyramid(
    @builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = case_index(id, groups);
    if (index >= arrayLength(&cases)) {
        return;
    }
    let c = cases[index];
    let served = bitcast<vec2<i32>>(pyramid_level(c.x, c.y));
    answers[index] = vec4<i32>(served, 0, 0);
}

// fractions, bits, rule: the four weights.
@compute @workgroup_size(WORKGROUP)
fn probe_interpolate(
    @builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = case_index(id, groups);
    if (index >= arrayLength(&cases)) {
        return;
    }
    let c = cases[index];
    answers[index] = corner_weights(c.w, c.xy, c.z);
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

// value, bits, mode, bits of the input: the corner input.
@compute @workgroup_size(WORKGROUP)
fn probe_input(
    @builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = case_index(id, groups);
    if (index >= arrayLength(&cases)) {
        return;
    }
    let c = cases[index];
    answers[index] = vec4<i32>(corner_input(bitcast<i32>(c.x), c.y, c.w, c.z), 0, 0, 0);
}

// four codes; two fractions; and in bytes the bits of a fraction, of a latent and of an input, and
// rule | mode << 4: the interpolated input.
@compute @workgroup_size(WORKGROUP)
fn probe_lerp(
    @builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = case_index(id, groups);
    if (index >= arrayLength(&cases)) {
        return;
    }
    let c = cases[index];
    let codes_of_corners = unpack4xU8(c.x);
    let bits = unpack4xU8(c.z);
    let values = vec4<i32>(
        latent_value(codes_of_corners.x, bits.y),
        latent_value(codes_of_corners.y, bits.y),
        latent_value(codes_of_corners.z, bits.y),
        latent_value(codes_of_corners.w, bits.y),
    );
    let fractions = vec2<u32>(c.y & 0xffffu, c.y >> 16u);
    let input = lerp_input(bits.w & 15u, values, fractions, bits.x, bits.y, bits.z, bits.w >> 4u);
    answers[index] = vec4<i32>(input, 0, 0, 0);
}

// texel, mip, octave, bits of an input: both waves, each also a quarter period on.
@compute @workgroup_size(WORKGROUP)
fn probe_waves(
    @builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = case_index(id, groups);
    if (index >= arrayLength(&cases)) {
        return;
    }
    let c = cases[index];
    let bits = c.w;
    answers[index] = vec4<i32>(
        wave_input(WAVE_TRIANGLE, c.x, c.y, c.z, false, bits),
        wave_input(WAVE_TRIANGLE, c.x, c.y, c.z, true, bits),
        wave_input(WAVE_SAW, c.x, c.y, c.z, false, bits),
        wave_input(WAVE_SAW, c.x, c.y, c.z, true, bits),
    );
}

// mip, mip count, bits of an input: the level.
@compute @workgroup_size(WORKGROUP)
fn probe_level(
    @builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = case_index(id, groups);
    if (index >= arrayLength(&cases)) {
        return;
    }
    let c = cases[index];
    answers[index] = vec4<i32>(level_input(c.x, c.y, c.z), 0, 0, 0);
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

// accumulator, mantissa, shift, requantizer: the arguments of both gates, the index of a table.
@compute @workgroup_size(WORKGROUP)
fn probe_scaled(
    @builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = case_index(id, groups);
    if (index >= arrayLength(&cases)) {
        return;
    }
    let c = cases[index];
    let value = bitcast<i32>(c.x);
    answers[index] = vec4<i32>(
        gate_argument(value, c.y, c.z, c.w, false),
        gate_argument(value, c.y, c.z, c.w, true),
        bitcast<i32>(table_index(value, c.y, c.z, c.w)),
        0,
    );
}

// rescaled, skip, zero point, bits: the activation.
@compute @workgroup_size(WORKGROUP)
fn probe_activation_sum(
    @builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = case_index(id, groups);
    if (index >= arrayLength(&cases)) {
        return;
    }
    let c = cases[index];
    answers[index] = vec4<i32>(
        to_activation(bitcast<i32>(c.x), bitcast<i32>(c.y), bitcast<i32>(c.z), c.w), 0, 0, 0,
    );
}

// two words in two places, and a word of the other factor: the dot product of sixteen bytes.
@compute @workgroup_size(WORKGROUP)
fn probe_dot(
    @builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = case_index(id, groups);
    if (index >= arrayLength(&cases)) {
        return;
    }
    let c = cases[index];
    let a = vec4<u32>(c.x, 0u, c.y, 0u);
    let b = vec4<u32>(c.z, c.z, c.z, c.z);
    answers[index] = vec4<i32>(dot16(a, b), 0, 0, 0);
}

// sum, product, bits: by every overflow.
@compute @workgroup_size(WORKGROUP)
fn probe_accumulate(
    @builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = case_index(id, groups);
    if (index >= arrayLength(&cases)) {
        return;
    }
    let c = cases[index];
    let sum = bitcast<i32>(c.x);
    let product = bitcast<i32>(c.y);
    answers[index] = vec4<i32>(
        accumulator_add(OVERFLOW_WRAP, c.z, sum, product),
        accumulator_add(OVERFLOW_SATURATE, c.z, sum, product),
        0,
        0,
    );
}
