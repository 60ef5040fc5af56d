// Dense: the sums of four rows of an integer layer. See isa/src/accumulate.rs.

// Sixteen products of signed bytes, summed. The device's own integer dot product where it has
// one; elsewhere the WGSL compiler writes out the four products.
fn dot16(a: vec4<u32>, b: vec4<u32>) -> i32 {
    return dot4I8Packed(a.x, b.x) + dot4I8Packed(a.y, b.y) + dot4I8Packed(a.z, b.z)
        + dot4I8Packed(a.w, b.w);
}

// The accumulators: bias first, k ascending.
fn dense(layer: Layer, source: u32, row: u32) -> vec4<i32> {
    if (PROFILE_OVERFLOW == OVERFLOW_WRAP && lanes_are_bytes(layer.input_lanes)) {
        return dense_packed(layer, source, row);
    }
    return dense_lanes(layer, source, row);
}

fn integer_bias(layer: Layer, row: u32) -> vec4<i32> {
    let at = layer.row + row;
    return vec4<i32>(rows[at].bias, rows[at + 1u].bias, rows[at + 2u].bias, rows[at + 3u].bias);
}

// Sixteen lanes a step. What wraps is a sum modulo 2^32, in which the order does not show and of
// which a narrower accumulator keeps the low bits. Weights beyond the last lane or row are zero, so
// whatever a vector holds there does not count.
fn dense_packed(layer: Layer, source: u32, row: u32) -> vec4<i32> {
    var sums = integer_bias(layer, row);
    var lanes = vector_element(source, 0u);
    var weight = layer.weight + row * layer.steps;
    for (var step = 0u; step < layer.steps; step++) {
        let values = vectors[lanes];
        sums += vec4<i32>(
            dot16(weights[weight], values),
            dot16(weights[weight + 1u], values),
            dot16(weights[weight + 2u], values),
            dot16(weights[weight + 3u], values),
        );
        weight += 4u;
        lanes += vector_texels;
    }
    return vec4<i32>(
        accumulator_wrap(sums.x, PROFILE_ACCUMULATOR_BITS),
        accumulator_wrap(sums.y, PROFILE_ACCUMULATOR_BITS),
        accumulator_wrap(sums.z, PROFILE_ACCUMULATOR_BITS),
        accumulator_wrap(sums.w, PROFILE_ACCUMULATOR_BITS),
    );
}

// The weights of four rows for one lane.
fn integer_weights(layer: Layer, row: u32, lane: u32) -> vec4<i32> {
    let at = layer.weight + row * layer.steps + (lane >> 4u) * 4u;
    let word = (lane >> 2u) & 3u;
    let words = vec4<i32>(vec4<u32>(
        weights[at][word], weights[at + 1u][word], weights[at + 2u][word], weights[at + 3u][word],
    ));
    return extractBits(words, (lane & 3u) * 8u, 8u);
}

// One lane a step: where lanes are wider than a byte, or a sum saturates after every product.
fn dense_lanes(layer: Layer, source: u32, row: u32) -> vec4<i32> {
    var sums = integer_bias(layer, row);
    for (var lane = 0u; lane < layer.inputs; lane++) {
        let products = integer_weights(layer, row, lane)
            * read_lane(source, layer.input_lanes, lane);
        sums = vec4<i32>(
            accumulator_add(PROFILE_OVERFLOW, PROFILE_ACCUMULATOR_BITS, sums.x, products.x),
            accumulator_add(PROFILE_OVERFLOW, PROFILE_ACCUMULATOR_BITS, sums.y, products.y),
            accumulator_add(PROFILE_OVERFLOW, PROFILE_ACCUMULATOR_BITS, sums.z, products.z),
            accumulator_add(PROFILE_OVERFLOW, PROFILE_ACCUMULATOR_BITS, sums.w, products.w),
        );
    }
    return sums;
}
