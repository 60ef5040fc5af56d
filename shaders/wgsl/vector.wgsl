// Vector: the inputs of the synthesizer and the outputs of its layers.
//
// Vector 0 holds the inputs, vector i + 1 the outputs of layer i. A layer reads its input and at
// most one older vector (its skip path's source), so the last VECTOR_COUNT are kept, in a ring.
// VECTOR_ELEMENTS and VECTOR_COUNT come from the asset: see src/variant.rs.
//
// A vector is of signed bytes where its integers have eight bits or fewer, so that four can be
// multiplied at once; otherwise of 16-bit words, integers or halves.
//
// They are in memory rather than in private arrays: an array of this size and indexed this way
// ends in memory on every device, and the compilers take seconds to put it there.

var<private> vector_texel: u32;
var<private> vector_texels: u32;

fn vector_start(texel: u32) {
    vector_texel = texel;
    vector_texels = arrayLength(&requests);
}

fn lanes_are_bytes(lanes: u32) -> bool {
    return HAS_BYTES && (!HAS_WORDS || lanes == LANES_BYTES);
}

// The place of 128 bits of a vector. Neighbouring texels are neighbours in memory.
fn vector_element(vector: u32, element: u32) -> u32 {
    return ((vector % VECTOR_COUNT) * VECTOR_ELEMENTS + element) * vector_texels + vector_texel;
}

// The lane in the lowest bits comes first.
fn write_lane(vector: u32, lanes: u32, lane: u32, value: i32) {
    if (lanes_are_bytes(lanes)) {
        let element = vector_element(vector, lane >> 4u);
        let word = (lane >> 2u) & 3u;
        vectors[element][word] = insertBits(
            vectors[element][word], bitcast<u32>(value), (lane & 3u) * 8u, 8u,
        );
    } else {
        let element = vector_element(vector, lane >> 3u);
        let word = (lane >> 1u) & 3u;
        vectors[element][word] = insertBits(
            vectors[element][word], bitcast<u32>(value), (lane & 1u) * 16u, 16u,
        );
    }
}

fn read_lane(vector: u32, lanes: u32, lane: u32) -> i32 {
    if (lanes_are_bytes(lanes)) {
        let word = vectors[vector_element(vector, lane >> 4u)][(lane >> 2u) & 3u];
        return extractBits(bitcast<i32>(word), (lane & 3u) * 8u, 8u);
    }
    let word = vectors[vector_element(vector, lane >> 3u)][(lane >> 1u) & 3u];
    return extractBits(bitcast<i32>(word), (lane & 1u) * 16u, 16u);
}

fn write_input(lane: u32, value: i32) {
    tap(header.tap_inputs + lane, value);
    write_lane(0u, INPUT_LANES, lane, value);
}
