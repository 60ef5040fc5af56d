// Vector: the inputs of the synthesizer and the outputs of its layers, as packed signed bytes.
//
// Vector 0 holds the inputs, vector i + 1 the outputs of layer i. A layer reads its input and at
// most one older vector (its skip path's source), so the last VECTOR_COUNT are kept, in a ring.
// VECTOR_STEPS and VECTOR_COUNT come from the asset: see `Sizes` in src/source.rs.
//
// They are in memory rather than in private arrays: an array of this size and indexed this way
// ends in memory on every device, and the compilers take seconds to put it there.

var<private> vector_texel: u32;
var<private> vector_texels: u32;

fn vector_start(texel: u32) {
    vector_texel = texel;
    vector_texels = arrayLength(&requests);
}

// The place of sixteen lanes of a vector. Neighbouring texels are neighbours in memory.
fn vector_element(vector: u32, step: u32) -> u32 {
    return ((vector % VECTOR_COUNT) * VECTOR_STEPS + step) * vector_texels + vector_texel;
}

fn write_lane(vector: u32, lane: u32, value: i32) {
    let element = vector_element(vector, lane >> 4u);
    let word = (lane >> 2u) & 3u;
    vectors[element][word] = insertBits(
        vectors[element][word], bitcast<u32>(value), (lane & 3u) * 8u, 8u,
    );
}

fn read_lane(vector: u32, lane: u32) -> i32 {
    let word = vectors[vector_element(vector, lane >> 4u)][(lane >> 2u) & 3u];
    return extractBits(bitcast<i32>(word), (lane & 3u) * 8u, 8u);
}

fn write_input(lane: u32, value: i32) {
    tap(header.tap_inputs + lane, value);
    write_lane(0u, lane, value);
}
