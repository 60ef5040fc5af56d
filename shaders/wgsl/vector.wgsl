// Vector: the inputs of the synthesizer and the outputs of its layers, as packed signed bytes.
//
// Vector 0 holds the inputs, vector i + 1 the outputs of layer i. A layer reads its input and at
// most one older vector (its skip path's source), so the last VECTOR_COUNT are kept, in a ring.
// VECTOR_STEPS and VECTOR_COUNT come from the asset: see `sizes` in src/source.rs.

// Sixteen lanes an element: the lane in the lowest bits first. Each invocation has its own.
var<private> vectors: array<vec4<u32>, VECTOR_STEPS * VECTOR_COUNT>;

// The first element of a vector.
fn vector_start(vector: u32) -> u32 {
    return (vector % VECTOR_COUNT) * VECTOR_STEPS;
}

fn write_lane(vector: u32, lane: u32, value: i32) {
    let element = vector_start(vector) + (lane >> 4u);
    let word = (lane >> 2u) & 3u;
    let bit = (lane & 3u) * 8u;
    let others = vectors[element][word] & ~(0xffu << bit);
    vectors[element][word] = others | ((bitcast<u32>(value) & 0xffu) << bit);
}

// Four lanes at once, from a lane that is a multiple of four.
fn write_quad(vector: u32, lane: u32, values: vec4<i32>) {
    let bytes = (bitcast<vec4<u32>>(values) & vec4<u32>(0xffu)) << vec4<u32>(0u, 8u, 16u, 24u);
    let packed = bytes.x | bytes.y | bytes.z | bytes.w;
    vectors[vector_start(vector) + (lane >> 4u)][(lane >> 2u) & 3u] = packed;
}

fn read_quad(vector: u32, lane: u32) -> vec4<i32> {
    let packed = vectors[vector_start(vector) + (lane >> 4u)][(lane >> 2u) & 3u];
    // Each byte goes to the top of its word, and comes down with its sign.
    return bitcast<vec4<i32>>(vec4<u32>(packed) << vec4<u32>(24u, 16u, 8u, 0u)) >> vec4<u32>(24u);
}

fn write_input(lane: u32, value: i32) {
    tap(header.tap_inputs + lane, value);
    write_lane(0u, lane, value);
}
