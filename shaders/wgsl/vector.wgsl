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

fn read_lane(vector: u32, lane: u32) -> i32 {
    let word = vectors[vector_start(vector) + (lane >> 4u)][(lane >> 2u) & 3u];
    return extractBits(bitcast<i32>(word), (lane & 3u) * 8u, 8u);
}

fn write_input(lane: u32, value: i32) {
    tap(header.tap_inputs + lane, value);
    write_lane(0u, lane, value);
}

// Puts the vectors away until the next dispatch.
fn save_vectors(texel: u32) {
    let texels = arrayLength(&requests);
    for (var element = 0u; element < VECTOR_STEPS * VECTOR_COUNT; element++) {
        waiting[element * texels + texel] = vectors[element];
    }
}

fn restore_vectors(texel: u32) {
    let texels = arrayLength(&requests);
    for (var element = 0u; element < VECTOR_STEPS * VECTOR_COUNT; element++) {
        vectors[element] = waiting[element * texels + texel];
    }
}
