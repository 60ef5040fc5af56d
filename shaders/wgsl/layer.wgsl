// Layer: one fully connected layer. See isa/src/layer.rs.

// Sixteen products of signed bytes, summed. The device's own integer dot product where it has
// one; elsewhere the WGSL compiler writes out the four products.
fn dot16(a: vec4<u32>, b: vec4<u32>) -> i32 {
    return dot4I8Packed(a.x, b.x) + dot4I8Packed(a.y, b.y) + dot4I8Packed(a.z, b.z)
        + dot4I8Packed(a.w, b.w);
}

// The accumulators of four rows: bias first, k ascending in steps of sixteen lanes.
//
// No sum of a validated asset leaves 31 bits (isa/src/limits.rs, MAX_LANES), and i32 additions
// that do not overflow are associative: the order cannot show. It is kept all the same. Weights
// beyond the last lane or row are zero, so whatever a vector holds there does not count.
fn dense(layer: Layer, source: u32, row: u32) -> vec4<i32> {
    let at = layer.row + row;
    var sums = vec4<i32>(rows[at].bias, rows[at + 1u].bias, rows[at + 2u].bias, rows[at + 3u].bias);
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
    return sums;
}

// An accumulator after its activation, at the scale of the layer's output. A hard GELU has used
// the row's multiplier for its argument; its product has one of its own.
fn rescale(layer: Layer, row: Row, activated: i32) -> i32 {
    let is_gated = layer.activation == ACTIVATION_HARD_GELU;
    let mantissa = select(row.mantissa, layer.gate_mantissa, is_gated);
    let shift = select(row.shift, layer.gate_shift, is_gated);
    return requantizer_apply(PROFILE_REQUANTIZE, activated, mantissa, shift);
}

// The skip path's term: its source's value without the source's zero point, rescaled.
fn skip_term(layer: Layer, value: i32) -> i32 {
    let real = value - layer.skip_zero_point;
    return requantizer_apply(PROFILE_SKIP, real, layer.skip_mantissa, layer.skip_shift);
}

// saturate(rescaled + skip + zero_point). Where `rescaled + skip` itself saturates, the sum lies
// far outside the range whatever the zero point; and the range moves rather than the sum, so that
// nothing else can overflow.
fn to_activation(rescaled: i32, skip: i32, zero_point: i32) -> i32 {
    let sum = saturating_add(rescaled, skip);
    return clamp(sum, ACTIVATION_MIN - zero_point, ACTIVATION_MAX - zero_point) + zero_point;
}

// One row of hidden layer `index`, from accumulator to activation.
fn finish(layer: Layer, index: u32, row: u32, accumulator: i32) {
    let parameters = rows[layer.row + row];
    let activated = activate(layer, parameters, accumulator);
    var skip = 0i;
    if (layer.skip_span != 0u) {
        skip = skip_term(layer, read_lane(index + 1u - layer.skip_span, row));
    }
    let output = to_activation(rescale(layer, parameters, activated), skip, layer.zero_point);
    write_lane(index + 1u, row, output);
    tap(layer.tap + row, accumulator);
    tap(layer.tap + layer.outputs + row, activated);
    tap(layer.tap + 2u * layer.outputs + row, output);
}

// Layer `index`: vector `index` to vector `index + 1`, or in the last layer to the channel codes
// of a texel. Rows past the last are computed with the others of their four, and dropped.
fn run_layer(index: u32, texel: u32) {
    let layer = header.layers[index];
    let is_last = index + 1u == header.layers_count;
    for (var first = 0u; first < layer.outputs; first += 4u) {
        let sums = dense(layer, index, first);
        for (var row = first; row < min(first + 4u, layer.outputs); row++) {
            if (is_last) {
                emit(layer, texel, row, sums[row - first]);
            } else {
                finish(layer, index, row, sums[row - first]);
            }
        }
    }
}
