// Layer: one fully connected layer. See isa/src/layer.rs.

fn is_half(layer: Layer) -> bool {
    return HAS_HALF_LAYERS && (!HAS_INTEGER_LAYERS || layer.arithmetic == ARITHMETIC_HALF);
}

// An accumulator after its activation, at the scale of the layer's output. A hard GELU has used
// the row's multiplier for its argument, and its product has one of its own; a table's entry is at
// that scale already.
fn rescale(layer: Layer, row: Row, activated: i32) -> i32 {
    if (has_activation(layer, ACTIVATION_TABLE)) {
        return activated;
    }
    let mantissa = select(row.mantissa, layer.gate_mantissa, is_gated(layer));
    let shift = select(row.shift, layer.gate_shift, is_gated(layer));
    return requantizer_apply(PROFILE_REQUANTIZE, activated, mantissa, shift);
}

// The skip path's term: its source's value without the source's zero point, rescaled and saturated.
fn skip_term(layer: Layer, value: i32) -> i32 {
    let real = value - layer.skip_zero_point;
    let range = signed_range(PROFILE_RESIDUAL_BITS);
    let term = requantizer_apply(PROFILE_SKIP, real, layer.skip_mantissa, layer.skip_shift);
    return clamp(term, range.x, range.y);
}

// saturate(rescaled + skip + zero_point) to `bits` bits. Where `rescaled + skip` itself saturates,
// the sum lies far outside the range whatever the zero point; and the range moves rather than the
// sum, so that nothing else can overflow.
fn to_activation(rescaled: i32, skip: i32, zero_point: i32, bits: u32) -> i32 {
    let sum = saturating_add(rescaled, skip);
    let range = signed_range(bits);
    return clamp(sum, range.x - zero_point, range.y - zero_point) + zero_point;
}

// One row of hidden integer layer `index`, from accumulator to activation.
fn finish(layer: Layer, index: u32, row: u32, accumulator: i32) {
    let parameters = rows[layer.row + row];
    let activated = activate(layer, parameters, accumulator);
    var skip = 0i;
    if (layer.skip_span != 0u) {
        let source = index + 1u - layer.skip_span;
        skip = skip_term(layer, read_lane(source, layer.skip_lanes, row));
    }
    let rescaled = rescale(layer, parameters, activated);
    let output = to_activation(rescaled, skip, layer.zero_point, layer.output_bits);
    put(layer, index, row, accumulator, activated, output);
}

// A row's output goes to its vector, and the values on its way to the taps.
fn put(layer: Layer, index: u32, row: u32, sum: i32, activated: i32, output: i32) {
    write_lane(index + 1u, layer.output_lanes, row, output);
    tap(layer.tap + row, sum);
    tap(layer.tap + layer.outputs + row, activated);
    tap(layer.tap + 2u * layer.outputs + row, output);
}

// Rows `first_row` to `end_row` of layer `index`: vector `index` to vector `index + 1`, or in the
// last layer to the channel codes of a texel. Rows past the last are computed with the others of
// their four, and dropped.
fn run_layer(index: u32, texel: u32, first_row: u32, end_row: u32) {
    let layer = header.layers[index];
    let is_last = index + 1u == header.layers_count;
    let end = min(end_row, layer.outputs);
    for (var first = first_row; first < end; first += 4u) {
        var sums: vec4<i32>;
        if (is_half(layer)) {
            sums = bitcast<vec4<i32>>(dense_half(layer, index, first));
        } else {
            sums = dense(layer, index, first);
        }
        for (var row = first; row < min(first + 4u, end); row++) {
            let sum = sums[row - first];
            if (is_last) {
                emit(layer, texel, row, sum);
            } else if (is_half(layer)) {
                finish_half(layer, index, row, bitcast<u32>(sum));
            } else {
                finish(layer, index, row, sum);
            }
        }
    }
}
