// Probe: single functions of fp16 layers, for tests. See probe.wgsl.

// a half, leak shift: as binary32, and its activations.
@compute @workgroup_size(WORKGROUP)
fn probe_half(
    @builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = case_index(id, groups);
    if (index >= arrayLength(&cases)) {
        return;
    }
    let c = cases[index];
    let sum = half_to_float(c.x);
    answers[index] = vec4<i32>(
        bitcast<i32>(sum), bitcast<i32>(half_round(sum)), bitcast<i32>(relu_half(sum)),
        bitcast<i32>(leak_half(sum, c.y)),
    );
}

// a binary32 number, leak shift: the nearest half, and its activations.
@compute @workgroup_size(WORKGROUP)
fn probe_float(
    @builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = case_index(id, groups);
    if (index >= arrayLength(&cases)) {
        return;
    }
    let c = cases[index];
    answers[index] = vec4<i32>(
        bitcast<i32>(half_round(c.x)), bitcast<i32>(leak_half(c.x, c.y)),
        bitcast<i32>(gate_half(c.x, false)), bitcast<i32>(gate_half(c.x, true)),
    );
}

// two binary32 numbers: sum and product.
@compute @workgroup_size(WORKGROUP)
fn probe_float_pair(
    @builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = case_index(id, groups);
    if (index >= arrayLength(&cases)) {
        return;
    }
    let c = cases[index];
    answers[index] = vec4<i32>(
        bitcast<i32>(float_add(c.x, c.y)), bitcast<i32>(float_multiply(c.x, c.y)), 0, 0,
    );
}

// three halves: the product of the first two, and the fused multiply-add.
@compute @workgroup_size(WORKGROUP)
fn probe_fused(
    @builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = case_index(id, groups);
    if (index >= arrayLength(&cases)) {
        return;
    }
    let c = cases[index];
    answers[index] = vec4<i32>(
        bitcast<i32>(half_product(c.x, c.y)), bitcast<i32>(half_fused(c.x, c.y, c.z)), 0, 0,
    );
}

// a binary32 number, factor, exponent, mode: the integer.
@compute @workgroup_size(WORKGROUP)
fn probe_to_integer(
    @builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = case_index(id, groups);
    if (index >= arrayLength(&cases)) {
        return;
    }
    let c = cases[index];
    answers[index] = vec4<i32>(
        float_to_integer(c.w, c.x, c.y, bitcast<i32>(c.z)), 0, 0, 0,
    );
}

// value low, value high, fraction bits: the half.
@compute @workgroup_size(WORKGROUP)
fn probe_from_fixed(
    @builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = case_index(id, groups);
    if (index >= arrayLength(&cases)) {
        return;
    }
    let c = cases[index];
    answers[index] = vec4<i32>(bitcast<i32>(half_from_fixed(Wide(c.x, c.y), c.z)), 0, 0, 0);
}
